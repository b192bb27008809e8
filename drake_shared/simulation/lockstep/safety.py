"""The safety filters of many trials among static obstacles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.safety.barrier import safe_command
from drake_shared.scenario import Scenario
from drake_shared.scenario.planar_distance import PlanarDistance

Floats = NDArray[np.float64]


class _Found(NamedTuple):
    """What the barrier uses of Drake's SignedDistanceToPoint."""

    id_G: int  # noqa: N815 (as in Drake)
    distance: float
    grad_W: Floats  # noqa: N815


class SafetyFilters:
    """Filters the commands of many trials as `drake_shared.systems.safety_filter.SafetyFilter` does for one.

    Args:
        scenario: Robot, control period, and obstacles, which must be static.
        clearance: To keep, in [m].
    """

    def __init__(self, scenario: Scenario, clearance: float) -> None:
        self._robot = scenario.diff_drive
        self._period = scenario.control_period
        self._clearance = clearance
        self._distances = [PlanarDistance([obstacle]) for obstacle in scenario.obstacles]

    def apply(self, pose: Floats, wheels: Floats, command: Floats, clearance: Floats) -> Floats:
        """The safe commands (2, n), in [rad/s].

        Args:
            pose: Shape (3, n), in [m, m, rad].
            wheels, command: Shape (2, n), in [rad/s].
            clearance: Shape (n,), at ``pose``, in [m].
        """
        robot, period = self._robot, self._period
        safe = np.where(np.isfinite(command), command, 0.0)
        acceleration = robot.max_wheel_acceleration
        fastest = np.minimum(abs(wheels).max(axis=0) + acceleration * period, robot.max_wheel_speed)
        # Obstacles out of reach leave the command as it is.
        reach = robot.wheel_radius * fastest * (period + fastest / (2 * acceleration)) + self._clearance
        for row in np.flatnonzero(clearance <= reach + 1e-9).tolist():
            place, speeds, wanted = (tuple(part[:, row].tolist()) for part in (pose, wheels, safe))
            safe[:, row] = safe_command(
                robot, place, speeds, wanted, clearance=self._clearance, query=self._query, period=period
            )
        return safe

    def _query(self, x: float, y: float, threshold: float) -> list[_Found]:
        return [
            _Found(index, found[0], np.array(found[1:]))
            for index, distances in enumerate(self._distances)
            for found in distances.within(x, y, threshold)
        ]
