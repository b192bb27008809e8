"""Curves in the plane: smooth ones through waypoints, and on which side one passes a point."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

_SPACING = 0.005


class Path:
    """A twice differentiable curve through waypoints, by arc length.

    Args:
        waypoints: Points (n, 2), n >= 2, in [m].
        heading: Direction at the first waypoint, in [rad]; free if None.
    """

    def __init__(self, waypoints: np.ndarray, *, heading: float | None = None) -> None:
        chords = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
        knots = np.concatenate([[0.0], np.cumsum(chords)])
        free = (2, np.zeros(2))
        first = free if heading is None else (1, np.array([np.cos(heading), np.sin(heading)]))
        curve = CubicSpline(knots, waypoints, bc_type=(first, free))
        u = np.linspace(0.0, knots[-1], max(int(knots[-1] / _SPACING), 100) + 1)
        points = curve(u)
        self._arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        self._points = points
        dx, dy = curve(u, 1).T
        ddx, ddy = curve(u, 2).T
        self._headings = np.unwrap(np.arctan2(dy, dx))
        self._curvatures = (dx * ddy - dy * ddx) / np.maximum(np.hypot(dx, dy), 1e-9) ** 3
        self.length = float(self._arc[-1])
        """In [m]."""

    def position(self, arc_length: np.ndarray) -> np.ndarray:
        """Points (n, 2) in [m] at ``arc_length`` (n,) in [m], held at the ends."""
        return np.stack([np.interp(arc_length, self._arc, self._points[:, axis]) for axis in (0, 1)], axis=-1)

    def frame(self, arc_length: float) -> tuple[float, float, float, float]:
        """Position x, y in [m], direction in [rad] and curvature in [1/m] at ``arc_length`` in [m]."""
        index = self._index(arc_length)
        x, y = self._points[index]
        return x, y, self._headings[index], self._curvatures[index]

    def nearest(self, x: float, y: float, *, between: tuple[float, float]) -> float:
        """Arc length, in [m], of the point nearest to (``x``, ``y``) in an interval of arc lengths."""
        first, last = self._index(between[0]), self._index(between[1]) + 1
        offset = self._points[first:last] - (x, y)
        return float(self._arc[first + int(np.argmin(np.einsum("ij,ij->i", offset, offset)))])

    def _index(self, arc_length: float) -> int:
        # Samples are nearly even: the spacing is fine enough to stand for the curve itself.
        return min(int(np.searchsorted(self._arc, arc_length)), len(self._arc) - 1)


def passing_side(positions: np.ndarray, point: tuple[float, float]) -> str:
    """The side, "left" or "right", on which a curve (n, 2) passes ``point``.

    It is "left" if, seen from ``point``, the curve sweeps clockwise: someone who walks it has the point
    to the right hand. Whole detours count with their sign, so a loop that comes back does not matter.
    """
    bearing = np.arctan2(positions[:, 1] - point[1], positions[:, 0] - point[0])
    swept = np.unwrap(bearing)
    return "left" if swept[-1] < swept[0] else "right"
