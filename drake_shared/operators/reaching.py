"""Steering law of a simulated operator who moves the tip of an arm: its command, without noise."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drake_shared.operators.behaviour import LONGEST_DELAY, Behaviour
from drake_shared.scenario import Scenario
from drake_shared.scenario.space_path import SpacePath

Floats = NDArray[np.float64]

PLANES = (np.array([1.0, 1.0, 0.0]), np.array([0.0, 1.0, 1.0]))
"""Axes of the tip's velocity that two axes of a stick move: x-y, or y-z after a click (Herlant et al.
2016)."""

CORRECTION_TIME = 0.7
"""Time in which the tip is led back to the route by an operator of skill 1, in [s]."""

AIM_AHEAD = 0.08
"""How far ahead on the route an operator aims who switches planes, in [m], where nothing else is set."""

# Length of the route in which the nearest point is searched, and along which its direction is taken, in [m].
_SEARCH, _DIRECTION = 0.08, 0.05
# Distance to the end within which the operator slows down, in [m].
_SLOWING = 0.05
# An operator who aims at a point moves toward it in this time, in [s], and not much faster than along a
# route.
_AIMING_TIME, _HASTE = 0.33, 1.2
# Share of a period that rounding of a delay explains.
_ROUNDING = 1e-9
# Errors of the tip that an operator who switches planes no longer minds, in [m].
_CLOSE = 0.02


class ReachingLaw:
    """Leads the tip along a route by the position that was seen a reaction delay ago.

    The operator moves along the route at an even pace and back to it; or, with ``aim_ahead``, straight to the
    position that far ahead on the route; or, with ``plane_switch_time``, so in one plane at a time.

    Args:
        scenario: Gives travel time and control period.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._period, self._travel_time = scenario.control_period, scenario.travel_time
        self.memory = math.ceil(LONGEST_DELAY / self._period) + 2
        """Number of positions that are remembered."""

    def recall(self, seen: Floats, delay: float) -> Floats:
        """The position (3,), in [m], seen ``delay`` before the command takes effect, a period from now.

        Args:
            seen: Positions [x, y, z, x, y, ...] in [m], one a period, the newest first.
            delay: In [s]. Between two remembered positions it interpolates.
        """
        periods = max(delay - self._period, 0.0) / self._period
        newer = int(periods + _ROUNDING)
        position: Floats = seen[3 * newer : 3 * newer + 3]
        # A delay of whole periods takes the position itself.
        if (share := periods - newer) > _ROUNDING:
            position = position + share * (seen[3 * newer + 3 : 3 * newer + 6] - position)
        return position

    def progress(self, path: SpacePath, position: Floats, reached: float) -> float:
        """Arc length of the route, in [m], reached at ``position`` after ``reached``, in [m]."""
        return path.nearest(position, between=(reached, reached + _SEARCH))

    def follow(self, path: SpacePath, position: Floats, reached: float, behaviour: Behaviour) -> Floats:
        """Velocity (3,), in [m/s], along the route and back to it."""
        slowing, direction, offset = self.guide(path, position, reached)
        pace = behaviour.speed_factor * self.pace(path)
        velocity: Floats = pace * slowing * direction + behaviour.skill * offset / CORRECTION_TIME
        return velocity

    def guide(self, path: SpacePath, position: Floats, reached: float) -> tuple[float, Floats, Floats]:
        """What an operator who follows the route sees.

        Returns:
            Share of the pace, which falls before the end; direction (3,) of the route; and offset (3,), in
            [m], from ``position`` to the route.
        """
        nearest = path.position(reached)
        along = path.position(reached + _DIRECTION) - nearest
        direction = along / max(math.sqrt(along @ along), 0.4 * _DIRECTION)
        return min(1.0, (path.length - reached) / _SLOWING), direction, nearest - position

    def aim(
        self, path: SpacePath, position: Floats, reached: float, behaviour: Behaviour, axes: Floats
    ) -> tuple[Floats, Floats]:
        """Velocity (3,), in [m/s], toward the position ahead on the route, by ``axes`` (3,), and the error.

        The error (3,), in [m], is that of the position.
        """
        error = path.position(reached + (behaviour.aim_ahead or AIM_AHEAD)) - position
        return self.toward(error * axes, behaviour.speed_factor * self.pace(path)), error

    @staticmethod
    def toward(errors: Floats, pace: float) -> Floats:
        """Velocities (..., 3), in [m/s], that undo ``errors`` (..., 3), in [m]; ``pace`` is that of the
        route."""
        velocity = errors / _AIMING_TIME
        # As numpy.linalg.norm computes it, of many vectors too.
        speed = np.sqrt(np.vecdot(velocity, velocity))
        scaled: Floats = velocity * np.minimum(1.0, _HASTE * pace / np.maximum(speed, 1e-9))[..., None]
        return scaled

    def wants_other_plane(self, error: Floats, plane: int) -> bool:
        """Whether all is done that the axes of ``plane`` can do, and the third one is needed."""
        done = float(np.linalg.norm(error * PLANES[plane])) < _CLOSE
        return done and abs(float(error[2 if plane == 0 else 0])) > _CLOSE

    def pace(self, path: SpacePath) -> float:
        """Speed along the route, in [m/s], at a speed factor of 1."""
        return path.length / self._travel_time
