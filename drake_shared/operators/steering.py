"""How a simulated operator steers along a route: what it would command without noise, seen from afar.

The same arithmetic drives :class:`drake_shared.systems.surrogate_operator.SurrogateOperator` and is fitted
to recorded drives by :mod:`drake_shared.analysis.operator_fit`.
"""

from __future__ import annotations

import math

import numpy as np

from drake_shared.operators.behaviour import LONGEST_DELAY
from drake_shared.scenario import Scenario
from drake_shared.scenario.paths import Path

Pose = tuple[float, float, float]


class SteeringLaw:
    """Where to look, where to be by now and how to get there.

    The operator wants to be where an even pace along the route, with a smooth start and end, would be by
    now, slows down in sharp curves, and steers by the route's curvature ahead and the errors seen in
    direction and sideways position: yaw rate = v kappa + skill (k1 direction - k2 v offset). This is not the
    law of the agent's controller, so agreement between the two is not built in.

    Args:
        scenario: Gives robot, travel time, start and control period.
    """

    # Of the errors in direction, in [1/s], sideways position, in [1/m^2], and progress, in [1/s].
    _DIRECTION_GAIN = 1.7
    _OFFSET_GAIN = 1.7
    _PROGRESS_GAIN = 0.8
    # In curves an operator slows down to turn no faster than this, in [rad/s].
    _COMFORTABLE_YAW_RATE = 1.5
    # Share of the travel time in which the pace rises, and in which it falls.
    _RAMP = 0.2
    # How far beyond the point reached the nearest one is looked for, in [m].
    _SEARCH = 0.3

    def __init__(self, scenario: Scenario) -> None:
        self._period = scenario.control_period
        self._travel_time = scenario.travel_time
        self._max_speed = scenario.robot.max_speed
        start = scenario.start
        count = math.ceil(LONGEST_DELAY / self._period) + 2
        self.nothing_seen: np.ndarray = np.tile([start.x, start.y, start.yaw], count)
        """Poses remembered at first, flat, the newest first: the robot stood at the start."""

    def recall(self, seen: np.ndarray, delay: float) -> Pose:
        """The pose to react to, between two that are remembered.

        Args:
            seen: Poses [x, y, yaw, x, y, ...] in [m, m, rad], one a period, the newest first.
            delay: From what is seen to the command, in [s]. The command takes effect a period from now, and
                that is part of it.
        """
        index, share = divmod(max(delay - self._period, 0.0) / self._period, 1.0)
        first = 3 * int(index)
        x, y, yaw, older_x, older_y, older_yaw = seen[first : first + 6].tolist()
        return x + share * (older_x - x), y + share * (older_y - y), yaw + share * (older_yaw - yaw)

    def progress(self, path: Path, pose: Pose, reached: float) -> float:
        """Arc length of the route, in [m], that is reached at ``pose`` if ``reached`` was before."""
        return path.nearest(pose[0], pose[1], between=(reached, reached + self._SEARCH))

    def steer(
        self, path: Path, pose: Pose, reached: float, *, time: float, delay: float, speed_factor: float
    ) -> tuple[float, float, float]:
        """What to do at ``pose``, which was seen ``delay`` s ago.

        Args:
            path: Of the route in mind.
            pose: [x, y, yaw] in [m, m, rad].
            reached: Arc length reached, in [m].
            time: Since the operator began, in [s].
            delay: In [s].
            speed_factor: See :class:`drake_shared.operators.behaviour.Behaviour`.

        Returns:
            Speed, in [m/s]; the yaw rate of the route ahead at that speed; and that of the correction of the
            errors seen at skill 1, both in [rad/s].
        """
        x, y, yaw = pose
        planned, pace = self._plan(path.length, time, self._travel_time / speed_factor)
        # What is seen is old: by now the robot is further on.
        ahead = reached + pace * delay
        speed = pace + self._PROGRESS_GAIN * (planned - ahead)
        on_x, on_y, direction, _ = path.frame(reached)
        curvature = path.frame(ahead)[3]
        fastest = min(self._max_speed, self._COMFORTABLE_YAW_RATE / max(abs(curvature), 1e-6))
        speed = min(max(speed, 0.0), fastest)
        offset = math.cos(direction) * (y - on_y) - math.sin(direction) * (x - on_x)
        off_direction = math.remainder(direction - yaw, math.tau)
        correction = self._DIRECTION_GAIN * off_direction - self._OFFSET_GAIN * speed * offset
        return speed, speed * curvature, correction

    def _plan(self, length: float, time: float, travel_time: float) -> tuple[float, float]:
        """Where on the route to be at ``time``, in [m], and how fast, in [m/s]."""
        ramp = self._RAMP * travel_time
        cruise = length / (travel_time - ramp)
        to_end = travel_time - time
        if to_end <= 0.0:
            return length, 0.0
        if time < ramp or to_end < ramp:
            share = min(time, to_end) / ramp
            gone = cruise * ramp * share**3 * (1.0 - 0.5 * share)
            pace = cruise * share**2 * (3.0 - 2.0 * share)
            return (gone if time < ramp else length - gone), pace
        return cruise * (time - 0.5 * ramp), cruise
