"""Commands along each route that a driver may intend, for many robots at once."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.routes import POINTS, Routes
from drake_shared.common.elementwise import ARRAYS
from drake_shared.robots import DiffDrive
from drake_shared.scenario import Scenario
from drake_shared.scenario.planar_distance import PlanarDistance

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Integers = NDArray[np.int64]

# Points of a route that are searched for the one nearest to the robot, and those of a line that are tested.
_WINDOW, _SAMPLES = 25, 12
# A line that comes this near to an obstacle is blocked, and the cells of the map of those places, both in
# radii of the robot.
_NEAR, _CELL = 0.5, 0.1
# In a workspace with more cells than these they are larger, so that the map stays small.
_MOST_CELLS = 1_000_000


class RouteGuide:
    """Pure pursuit along K routes, and straight to each of J goals: K + J destinations.

    The straight line is what every route ends with once the last obstacle is passed. Places are complex
    numbers x + iy, in [m].

    Args:
        routes: K routes.
        scenario: Its goals, static obstacles and travel time.
        robot: Steers toward points.
    """

    def __init__(self, routes: Routes, scenario: Scenario, robot: DiffDrive) -> None:
        self._robot = robot
        self._count = len(routes.lengths)
        self._points = (routes.points[..., 0] + 1j * routes.points[..., 1]).ravel()
        self._first = POINTS * np.arange(self._count)[:, None]
        self._goals = np.array([[goal.x + 1j * goal.y] for goal in scenario.all_goals])
        self._window = np.arange(_WINDOW)
        self._samples = np.linspace(0.0, 1.0, _SAMPLES + 1)[1:, None, None]
        # Points of a route in the travel time, and speed to the goals.
        self._pace = (POINTS - 1) / scenario.travel_time
        self._speed = float(routes.lengths.mean()) / scenario.travel_time
        space, radius = scenario.workspace, robot.footprint_radius
        area = (space.x_max - space.x_min) * (space.y_max - space.y_min)
        self._cell = max(_CELL * radius, math.sqrt(area / _MOST_CELLS))
        self._corner = space.x_min + 1j * space.y_min
        # No place in a cell may be nearer to an obstacle than its corners show.
        near = max(_NEAR * radius, self._cell)
        axes = [
            np.arange(low, high + self._cell, self._cell)
            for low, high in ((space.x_min, space.x_max), (space.y_min, space.y_max))
        ]
        places = np.meshgrid(*axes, indexing="ij")
        self._is_near = PlanarDistance(scenario.static_obstacles).least(*places) < near
        self._most = np.array(self._is_near.shape) - 1.0

    def initial_progress(self, count: int) -> Integers:
        """Progress (K, n) of ``count`` robots at the start: the index of a point of each route."""
        return np.zeros((self._count, count), dtype=np.int64)

    def advance(self, progress: Integers, pose: Floats) -> Integers:
        """Index (K, n) of the point of each route nearest to the pose (3, n), at or after ``progress``."""
        index = np.minimum(progress[..., None] + self._window, POINTS - 1)
        offset = self._points[self._first[..., None] + index] - _place(pose)[:, None]
        square = offset.real**2 + offset.imag**2
        return np.asarray(np.minimum(progress + square.argmin(axis=-1), POINTS - 1))

    def commands(
        self, progress: Integers, pose: Floats, look_aheads: Floats
    ) -> tuple[Floats, Floats, Complexes]:
        """Wheel speeds and the places to which they steer, for several look-aheads.

        Args:
            progress: Shape (K, n).
            pose: Shape (3, n), in [m, m, rad].
            look_aheads: Shape (L,), time ahead of those places, in [s].

        Returns:
            Speeds of the left and of the right wheel, in [rad/s], and places, each (L, K + J, n).
        """
        times = look_aheads[:, None, None]
        ahead = np.minimum(progress + times * self._pace, POINTS - 1.0)
        before = np.minimum(ahead.astype(np.int64), POINTS - 2)
        share, index = ahead - before, self._first + before
        along = (1.0 - share) * self._points[index] + share * self._points[index + 1]
        place = _place(pose)
        to_goal = self._goals - place
        reach = times * self._speed
        part = reach / np.maximum(np.abs(to_goal), reach)
        target = np.concatenate([along, place + part * to_goal], axis=1)
        left, right = self._robot.command_toward(pose, (target.real, target.imag), times, ARRAYS)
        return left, right, target

    def is_blocked(self, pose: Floats, target: Complexes) -> NDArray[np.bool_]:
        """Whether an obstacle separates a robot from its destination: shape (K + J, n).

        Args:
            pose: Shape (3, n), in [m, m, rad].
            target: Of `commands` with one look-ahead, shape (K + J, n). Of a goal the whole line counts.
        """
        place = _place(pose)
        end = np.concatenate([target[: self._count], np.repeat(self._goals, len(place), axis=1)])
        cells = (place + self._samples * (end - place) - self._corner) / self._cell
        rows = np.rint(cells).view(np.float64).reshape(*cells.shape, 2)
        index = np.minimum(np.maximum(rows, 0.0), self._most).astype(np.int64)
        return np.asarray(self._is_near[index[..., 0], index[..., 1]].any(axis=0))


def _place(pose: Floats) -> Complexes:
    """Shape (n,)."""
    return np.asarray(pose[0] + 1j * pose[1])
