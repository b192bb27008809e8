"""Where a robot is on each of several routes, and the commands that follow them, for many trials at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.routes import POINTS, Routes
from drake_shared.common.elementwise import ARRAYS
from drake_shared.robots import DiffDrive

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Indices = NDArray[np.int64]

# A robot moves by about two points of a route in a step; a rollout's end is found from where its length ends.
_ITERATIONS = 2


class RoutePursuit:
    """Pure pursuit along K routes, and the projection of positions onto them.

    Positions are complex numbers x + iy, in [m]. The axes of arrays end with those of K routes and n trials.

    Args:
        routes: K routes.
        robot: Steers toward points.
        look_ahead: Time ahead on a route of the point to which it steers, in [s].
        travel_time: Time in which a route is taken from start to goal, in [s].
    """

    def __init__(self, routes: Routes, *, robot: DiffDrive, look_ahead: float, travel_time: float) -> None:
        self.count = len(routes.lengths)
        self._points: Complexes = routes.points[..., 0] + 1j * routes.points[..., 1]
        steps = np.gradient(self._points, axis=1)
        # Multiplied by these, an offset has its part along the route as its real part.
        self._turns: Complexes = (steps / np.abs(steps)).conj()
        self._spacings = (routes.lengths / (POINTS - 1))[:, None]
        self._ahead = look_ahead * (POINTS - 1) / travel_time
        self._first = POINTS * np.arange(self.count)[:, None]
        self._robot = robot
        self._look_ahead = look_ahead

    def initial(self, count: int) -> Indices:
        """Index (K, n) of the first point of each route."""
        return np.zeros((self.count, count), dtype=np.int64)

    def project(self, position: Complexes, near: Indices) -> tuple[Indices, Floats, Floats]:
        """Projects positions onto the routes.

        Args:
            position: Broadcasts with (..., K, n).
            near: Index of the point at which the search begins; broadcasts with (..., K, n).

        Returns:
            Index of the nearest point; length of the route that is left from there, in [m]; and distance from
            the route, in [m].
        """
        index = near
        for _ in range(_ITERATIONS):
            along = self._offset(position, index).real / self._spacings
            index = np.minimum(np.maximum(index + np.rint(along).astype(np.int64), 0), POINTS - 1)
        offset, half = self._offset(position, index), 0.5 * self._spacings
        along = np.minimum(np.maximum(offset.real, -half), half)
        left = (POINTS - 1 - index) * self._spacings - along
        return index, np.maximum(left, 0.0), np.abs(offset - along)

    def commands(self, index: Indices, pose: Floats) -> Floats:
        """Commands (2, K, n), in [rad/s], that steer toward the point ahead of ``index`` on each route.

        Args:
            index: Shape (K, n), as `project` returns it.
            pose: Shape (3, n), [x, y, yaw] in [m, m, rad].
        """
        ahead = np.minimum(index + self._ahead, POINTS - 1.0)
        before = np.minimum(ahead.astype(np.int64), POINTS - 2)
        share = ahead - before
        points, flat = self._points.ravel(), self._first + before
        target = (1.0 - share) * points[flat] + share * points[flat + 1]
        return np.stack(
            self._robot.command_toward(pose, (target.real, target.imag), self._look_ahead, ARRAYS)
        )

    def _offset(self, position: Complexes, index: Indices) -> Complexes:
        """Offsets from points of the routes: along them, and to their left as the imaginary part."""
        flat = self._first + index
        return np.asarray((position - self._points.ravel()[flat]) * self._turns.ravel()[flat])
