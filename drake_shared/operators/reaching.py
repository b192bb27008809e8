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

# Time in which the tip is led back to the route by an operator of skill 1, in [s].
_CORRECTION_TIME = 0.7
# Length of the route in which the nearest point is searched, and along which its direction is taken, in [m].
_SEARCH, _DIRECTION = 0.08, 0.05
# Distance to the end within which the operator slows down, in [m].
_SLOWING = 0.05
# An operator who aims at a point moves toward it in this time, in [s], and not much faster than along a
# route.
_AIMING_TIME, _HASTE = 0.33, 1.2
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
        """The position (3,), in [m], seen ``delay`` s before the command takes effect, a period from now.

        Args:
            seen: Positions (n, 3) in [m], one a period, the newest first.
            delay: In [s].
        """
        position: Floats = seen[min(round(max(delay - self._period, 0.0) / self._period), len(seen) - 1)]
        return position

    def progress(self, path: SpacePath, position: Floats, reached: float) -> float:
        """Arc length of the route, in [m], reached at ``position`` after ``reached``, in [m]."""
        return path.nearest(position, between=(reached, reached + _SEARCH))

    def follow(self, path: SpacePath, position: Floats, reached: float, behaviour: Behaviour) -> Floats:
        """Velocity (3,), in [m/s], along the route and back to it."""
        along = path.position(reached + _DIRECTION) - path.position(reached)
        direction = along / max(float(np.linalg.norm(along)), 0.4 * _DIRECTION)
        slowing = min(1.0, (path.length - reached) / _SLOWING)
        correction = behaviour.skill * (path.position(reached) - position) / _CORRECTION_TIME
        velocity: Floats = self._pace(path, behaviour) * slowing * direction + correction
        return velocity

    def aim(
        self, path: SpacePath, position: Floats, reached: float, behaviour: Behaviour, axes: Floats
    ) -> tuple[Floats, Floats]:
        """Velocity (3,), in [m/s], toward the position ahead on the route, by ``axes`` (3,), and the error.

        The error (3,), in [m], is that of the position.
        """
        error = path.position(reached + (behaviour.aim_ahead or _SEARCH)) - position
        velocity = error * axes / _AIMING_TIME
        fastest = _HASTE * self._pace(path, behaviour)
        scaled: Floats = velocity * min(1.0, fastest / max(float(np.linalg.norm(velocity)), 1e-9))
        return scaled, error

    def wants_other_plane(self, error: Floats, plane: int) -> bool:
        """Whether all is done that the axes of ``plane`` can do, and the third one is needed."""
        done = float(np.linalg.norm(error * PLANES[plane])) < _CLOSE
        return done and abs(float(error[2 if plane == 0 else 0])) > _CLOSE

    def _pace(self, path: SpacePath, behaviour: Behaviour) -> float:
        return behaviour.speed_factor * path.length / self._travel_time
