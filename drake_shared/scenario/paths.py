"""Smooth curves through waypoints in the plane, and the side on which a curve passes a point."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

SPACING = 0.005
"""Between the points of a curve, in [m], for a robot of the size of the Pioneer P3-DX."""

# A curve has at most so many points, unless it has many waypoints: 20,000 are 100 m for that robot. On a
# longer one they are further apart, and memory and time do not grow with the length.
_MAX_POINTS = 20_000
_POINTS_PER_WAYPOINT = 100


class Path:
    """A twice differentiable curve through waypoints, by arc length.

    Args:
        waypoints: Shape (n, 2), n >= 2, in [m].
        heading: Direction at the first waypoint, in [rad]; free if None.
        spacing: Distance between the points that represent the curve, in [m]; larger on a curve of more than
            20,000 points that has fewer than 200 waypoints.
    """

    def __init__(
        self, waypoints: NDArray[np.float64], *, heading: float | None = None, spacing: float = SPACING
    ) -> None:
        chords = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
        knots = np.concatenate([[0.0], np.cumsum(chords)])
        free = (2, np.zeros(2))
        first = free if heading is None else (1, np.array([np.cos(heading), np.sin(heading)]))
        curve = CubicSpline(knots, waypoints, bc_type=(first, free))
        spacing = max(spacing, knots[-1] / max(_MAX_POINTS, _POINTS_PER_WAYPOINT * len(waypoints)))
        fine = np.linspace(0.0, knots[-1], 4 * max(int(knots[-1] / spacing), 100) + 1)
        pieces = np.linalg.norm(np.diff(curve(fine), axis=0), axis=1)
        arc = np.concatenate([[0.0], np.cumsum(pieces)])
        self.length = float(arc[-1])
        """In [m]."""
        # Equidistant in arc length, so that a division finds a point.
        count = max(int(self.length / spacing), 100) + 1
        self.spacing = self.length / (count - 1)
        """Between the points that represent the curve, in [m]."""
        u = np.interp(np.arange(count) * self.spacing, arc, fine)
        self._points = curve(u)
        # As complex numbers, which numpy subtracts and measures with one call each.
        self._plane = self._points[:, 0] + 1j * self._points[:, 1]
        dx, dy = curve(u, 1).T
        ddx, ddy = curve(u, 2).T
        headings = np.unwrap(np.arctan2(dy, dx))
        curvatures = (dx * ddy - dy * ddx) / np.maximum(np.hypot(dx, dy), 1e-9) ** 3
        self.frames = list(zip(*self._points.T.tolist(), headings.tolist(), curvatures.tolist(), strict=True))
        """Of each of these points x, y in [m], direction in [rad] and curvature in [1/m]."""

    def position(self, arc_length: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 2) in [m] at ``arc_length`` (n,) in [m], held at the ends."""
        arc = np.arange(len(self._points)) * self.spacing
        return np.stack([np.interp(arc_length, arc, self._points[:, axis]) for axis in (0, 1)], axis=-1)

    def frame(self, arc_length: float) -> tuple[float, float, float, float]:
        """Position x, y in [m], direction in [rad] and curvature in [1/m] at ``arc_length`` in [m].

        Those of the nearest of the points that represent the curve.
        """
        return self.frames[self._index(arc_length)]

    def nearest(self, x: float, y: float, *, between: tuple[float, float]) -> float:
        """Arc length, in [m], of the point nearest to (``x``, ``y``), within an interval of arc lengths."""
        first, last = self._index(between[0]), self._index(between[1]) + 1
        return (first + int(np.abs(self._plane[first:last] - complex(x, y)).argmin())) * self.spacing

    def _index(self, arc_length: float) -> int:
        return min(max(round(arc_length / self.spacing), 0), len(self.frames) - 1)


def passing_side(positions: NDArray[np.float64], point: tuple[float, float]) -> str:
    """The side, "left" or "right", on which a curve (n, D), with x and y first, passes ``point`` (x, y).

    It is "left" if, seen from ``point``, the curve sweeps clockwise, so that the point lies to the right of
    the direction of motion. Whole turns count with their sign: a loop that returns does not matter. The curve
    is continued in the direction from its first to its last position.
    """
    # Otherwise the side of a point beside an end is a matter of centimetres.
    ahead = 1e3 * (positions[-1, :2] - positions[0, :2])
    plane = np.vstack([positions[0, :2] - ahead, positions[:, :2], positions[-1, :2] + ahead])
    bearing = np.arctan2(plane[:, 1] - point[1], plane[:, 0] - point[0])
    turned = np.diff(bearing)
    return "left" if (turned - math.tau * np.rint(turned / math.tau)).sum() < 0.0 else "right"
