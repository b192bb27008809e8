"""Smooth curves through waypoints in space."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

Floats = NDArray[np.float64]

# Points that represent a curve.
_POINTS = 401


class SpacePath:
    """A twice differentiable curve through waypoints, by arc length.

    Args:
        waypoints: Shape (n, D), n >= 2, in [m].
        count: Number of points that represent the curve.

    Attributes:
        length: In [m].
        points: Shape (count, D), in [m], at equal distances along the curve.
    """

    def __init__(self, waypoints: ArrayLike, *, count: int = _POINTS) -> None:
        corners = np.asarray(waypoints, dtype=float)
        knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
        fine = CubicSpline(knots, corners, bc_type="natural")(np.linspace(0.0, knots[-1], 4 * count))
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
        self.length = float(arc[-1])
        wanted = np.linspace(0.0, self.length, count)
        self.points: Floats = np.stack([np.interp(wanted, arc, axis) for axis in fine.T], axis=-1)
        self._last = count - 1
        self._spacing = self.length / self._last

    def position(self, arc_length: float) -> Floats:
        """Shape (D,), in [m]: the nearest of ``points`` to an arc length in [m], held at the ends."""
        position: Floats = self.points[self._index(arc_length)]
        return position

    def positions_at(self, arc_lengths: Floats) -> Floats:
        """Shape (n, D), in [m]: `position` of each of ``arc_lengths`` (n,)."""
        index = np.clip(np.rint(arc_lengths / self._spacing).astype(int), 0, self._last)
        found: Floats = self.points[index]
        return found

    def positions(self, count: int) -> Floats:
        """Shape (count, D), in [m]: points at equal distances along the curve."""
        index, wanted = np.arange(len(self.points)), np.linspace(0.0, float(self._last), count)
        return np.stack([np.interp(wanted, index, axis) for axis in self.points.T], axis=-1)

    def nearest(self, position: Floats, *, between: tuple[float, float]) -> float:
        """Arc length, in [m], of the point nearest to ``position`` (D,), within an interval of arc
        lengths."""
        first, last = self._index(between[0]), self._index(between[1]) + 1
        offsets = self.points[first:last] - position
        return (first + int((offsets * offsets).sum(axis=1).argmin())) * self._spacing

    def _index(self, arc_length: float) -> int:
        return min(max(round(arc_length / self._spacing), 0), self._last)
