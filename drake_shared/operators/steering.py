"""Steering law of the simulated operator: its command along a route, without noise.

:class:`drake_shared.systems.surrogate_operator.SurrogateOperator` drives by it, and
:mod:`drake_shared.analysis.operator_fit` fits it to recorded drives.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.elementwise import FLOATS, Elementwise, Real
from drake_shared.operators.behaviour import LONGEST_DELAY
from drake_shared.robots import scaled_length
from drake_shared.scenario import Scenario

Pose = tuple[Real, Real, Real]


class Curve(Protocol):
    """What the law uses of a `Path`, or of one path for each of n trials, with arrays (n,) for numbers."""

    @property
    def length(self) -> Real:
        """See `Path`."""

    def frame(self, arc_length: Real) -> tuple[Real, Real, Real, Real]:
        """See `Path`."""

    def nearest(self, x: Real, y: Real, *, between: tuple[Real, Real]) -> Real:
        """See `Path`."""


class SteeringLaw:
    """Follows a route by the pose that was seen a reaction delay ago.

    The operator aims at the position on the route of a constant pace with a smooth start and end, slows down
    in sharp curves, and steers by the route's curvature ahead and the seen errors in direction and sideways
    position: yaw rate = v kappa + skill (k1 direction - k2 v offset). This is not the law of the agent's
    controller, so that agreement between the two is not built in.

    Args:
        scenario: Gives robot, travel time, start and control period.
    """

    # Gains of the errors in direction, in [1/s], sideways position, in [1/m^2] for the Pioneer P3-DX, and
    # progress, in [1/s].
    _DIRECTION_GAIN = 1.7
    _OFFSET_GAIN = 1.7
    _PROGRESS_GAIN = 0.8
    # Largest yaw rate in curves, in [rad/s]; the operator slows down for it.
    _COMFORTABLE_YAW_RATE = 1.5
    # Share of the travel time in which the pace rises, and in which it falls.
    _RAMP = 0.2
    # Length of the route in which the nearest point is searched, in [m] for the Pioneer P3-DX.
    _SEARCH = 0.3

    def __init__(self, scenario: Scenario) -> None:
        self._period = scenario.control_period
        self._travel_time = scenario.travel_time
        self._max_speed = scenario.robot.max_speed
        scale = scaled_length(scenario.robot, 1.0)
        self.search = self._SEARCH * scale
        # A yaw rate per speed and offset: both grow with the robot.
        self._offset_gain = self._OFFSET_GAIN / scale**2
        start = scenario.start
        count = math.ceil(LONGEST_DELAY / self._period) + 2
        self.initial_memory: NDArray[np.float64] = np.tile([start.x, start.y, start.yaw], count)
        """Initial memory of poses, flat, the newest first: the robot at its start."""

    def recall(self, seen: NDArray[np.float64], delay: float) -> Pose:
        """The pose seen ``delay`` before the command takes effect, between two remembered poses.

        Args:
            seen: Poses [x, y, yaw, x, y, ...] in [m, m, rad], one a period, the newest first.
            delay: From seeing to the command, in [s]. It includes the period after which the command takes
                effect.
        """
        index, share = divmod(max(delay - self._period, 0.0) / self._period, 1.0)
        first = 3 * int(index)
        x, y, yaw, older_x, older_y, older_yaw = seen[first : first + 6].tolist()
        return x + share * (older_x - x), y + share * (older_y - y), yaw + share * (older_yaw - yaw)

    def progress(self, path: Curve, pose: Pose, reached: Real) -> Real:
        """Arc length of the route, in [m], reached at ``pose`` after ``reached``, in [m]."""
        return path.nearest(pose[0], pose[1], between=(reached, reached + self.search))

    def steer(
        self,
        path: Curve,
        pose: Pose,
        reached: Real,
        *,
        time: Real,
        delay: Real,
        speed_factor: Real,
        xp: Elementwise = FLOATS,
    ) -> tuple[Real, Real, Real]:
        """Speed and yaw rate at ``pose``, which was seen ``delay`` s ago.

        Args:
            path: Of the intended route.
            pose: [x, y, yaw] in [m, m, rad].
            reached: Arc length reached, in [m].
            time: Since the operator started, in [s].
            delay: In [s].
            speed_factor: See :class:`drake_shared.operators.behaviour.Behaviour`.
            xp: For numbers or arrays.

        Returns:
            Speed, in [m/s]; yaw rate of the route ahead at that speed, in [rad/s]; and yaw rate that corrects
            the seen errors at skill 1, in [rad/s].
        """
        x, y, yaw = pose
        planned, pace = self._plan(path.length, time, self._travel_time / speed_factor, xp)
        # The pose is old: the robot has moved on since.
        ahead = reached + pace * delay
        speed = pace + self._PROGRESS_GAIN * (planned - ahead)
        on_x, on_y, direction, _ = path.frame(reached)
        curvature = path.frame(ahead)[3]
        fastest = xp.minimum(self._max_speed, self._COMFORTABLE_YAW_RATE / xp.maximum(abs(curvature), 1e-6))
        speed = xp.minimum(xp.maximum(speed, 0.0), fastest)
        offset = xp.cos(direction) * (y - on_y) - xp.sin(direction) * (x - on_x)
        off_direction = xp.remainder(direction - yaw, math.tau)
        correction = self._DIRECTION_GAIN * off_direction - self._offset_gain * speed * offset
        return speed, speed * curvature, correction

    def _plan(self, length: Real, time: Real, travel_time: Real, xp: Elementwise) -> tuple[Real, Real]:
        """Planned arc length, in [m], and pace, in [m/s], at ``time``."""
        ramp = self._RAMP * travel_time
        cruise = length / (travel_time - ramp)
        to_end = travel_time - time
        ramps = (time < ramp) | (to_end < ramp)
        if not xp.any(ramps):
            return cruise * (time - 0.5 * ramp), cruise
        # 0 after the end, 1 between the ramps.
        share = xp.maximum(xp.minimum(xp.minimum(time, to_end) / ramp, 1.0), 0.0)
        gone = cruise * ramp * share * share * share * (1.0 - 0.5 * share)
        pace = cruise * share * share * (3.0 - 2.0 * share)
        before_end = xp.where(to_end < ramp, length - gone, cruise * (time - 0.5 * ramp))
        return xp.where(time < ramp, gone, before_end), pace
