"""Commands along each route that a driver may intend, for many robots at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.routes import POINTS, Routes
from drake_shared.common.elementwise import ARRAYS
from drake_shared.robots import DiffDrive
from drake_shared.scenario import Scenario
from drake_shared.scenario.planar_distance import PlanarDistance

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Points of a route that are searched for the one nearest to the robot, and those of a line that are tested.
_WINDOW, _SAMPLES = 25, 12
# A line that comes this near to an obstacle is blocked, and the cells of the map of those places, both in
# radii of the robot.
_NEAR, _CELL = 0.5, 0.1


class RouteGuide:
    """Pure pursuit along K routes, and straight to each of J goals: K + J destinations.

    The straight line is what every route ends with once the last obstacle is passed.

    Args:
        routes: K routes.
        scenario: Its goals, static obstacles and travel time.
        robot: Steers toward points.
    """

    def __init__(self, routes: Routes, scenario: Scenario, robot: DiffDrive) -> None:
        self._robot = robot
        self._points = routes.points
        self._count = len(routes.lengths)
        self._goals = np.array([[goal.x, goal.y] for goal in scenario.all_goals])
        # Points of a route in the travel time, and speed to the goals.
        self._pace = (POINTS - 1) / scenario.travel_time
        self._speed = float(routes.lengths.mean()) / scenario.travel_time
        space, radius = scenario.workspace, robot.footprint_radius
        self._cell, self._corner = _CELL * radius, np.array([space.x_min, space.y_min])
        axes = [
            np.arange(low, high + self._cell, self._cell)
            for low, high in ((space.x_min, space.x_max), (space.y_min, space.y_max))
        ]
        places = np.meshgrid(*axes, indexing="ij")
        self._is_near = PlanarDistance(scenario.static_obstacles).least(*places) < _NEAR * radius

    def initial_progress(self, count: int) -> Integers:
        """Progress (K, n) of ``count`` robots at the start: the index of a point of each route."""
        return np.zeros((self._count, count), dtype=np.int64)

    def advance(self, progress: Integers, pose: Floats) -> Integers:
        """Index (K, n) of the point of each route nearest to the pose (3, n), at or after ``progress``."""
        index = np.minimum(progress[..., None] + np.arange(_WINDOW), POINTS - 1)
        points = self._points[np.arange(self._count)[:, None, None], index]
        square = np.square(points - pose[:2].T[:, None]).sum(axis=-1)
        return np.asarray(np.minimum(progress + square.argmin(axis=-1), POINTS - 1))

    def commands(self, progress: Integers, pose: Floats, look_aheads: Floats) -> tuple[Floats, Floats]:
        """Commands and the points to which they steer, for several look-aheads.

        Args:
            progress: Shape (K, n).
            pose: Shape (3, n), in [m, m, rad].
            look_aheads: Shape (L,), time ahead of those points, in [s].

        Returns:
            Commands (L, K + J, 2, n), in [rad/s], and points (L, K + J, n, 2), in [m].
        """
        times = look_aheads[:, None, None]
        ahead = np.minimum(progress + times * self._pace, POINTS - 1.0)
        before = np.minimum(ahead.astype(np.int64), POINTS - 2)
        share = (ahead - before)[..., None]
        route = np.arange(self._count)[:, None]
        along = (1.0 - share) * self._points[route, before] + share * self._points[route, before + 1]
        to_goal = self._goals[:, None] - pose[:2].T
        reach = times * self._speed
        part = reach / np.maximum(np.hypot(to_goal[..., 0], to_goal[..., 1]), reach)
        target = np.concatenate([along, pose[:2].T + part[..., None] * to_goal], axis=1)
        command = self._robot.command_toward(pose, (target[..., 0], target[..., 1]), times, ARRAYS)
        return np.stack(command, axis=2), target

    def is_blocked(self, pose: Floats, target: Floats) -> NDArray[np.bool_]:
        """Whether an obstacle separates a robot from its destination: shape (K + J, n).

        Args:
            pose: Shape (3, n), in [m, m, rad].
            target: Of `commands`. Of a goal the whole line counts.
        """
        place = pose[:2].T
        end = np.concatenate(
            [target[: self._count], np.broadcast_to(self._goals[:, None], target[self._count :].shape)]
        )
        share = np.linspace(0.0, 1.0, _SAMPLES + 1)[1:, None, None, None]
        cells = np.rint((place + share * (end - place) - self._corner) / self._cell)
        most = np.array(self._is_near.shape) - 1
        index = np.minimum(np.maximum(cells, 0.0), most).astype(np.int64)
        return np.asarray(self._is_near[index[..., 0], index[..., 1]].any(axis=0))
