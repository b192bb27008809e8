"""The safety filters of many trials among static obstacles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.safety.barrier import safe_command
from drake_shared.scenario import Scenario
from drake_shared.scenario.planar_distance import PlanarDistance

Floats = NDArray[np.float64]

# Points of a path that are tested for all trials at once.
_SAMPLES = 17


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
        self._distance = PlanarDistance(scenario.obstacles)
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
        fastest = abs(wheels).max(axis=0) + acceleration * period
        # Obstacles out of reach leave the command as it is.
        reach = robot.wheel_radius * fastest * (period + fastest / (2 * acceleration)) + self._clearance
        near = np.flatnonzero(clearance <= reach + 1e-9)
        near = near[~self._keeps_clear(pose[:, near], wheels[:, near], safe[:, near])]
        for row in near.tolist():
            place, speeds, wanted = (tuple(part[:, row].tolist()) for part in (pose, wheels, safe))
            safe[:, row] = safe_command(
                robot, place, speeds, wanted, clearance=self._clearance, query=self._query, period=period
            )
        return safe

    def _keeps_clear(self, pose: Floats, wheels: Floats, command: Floats) -> NDArray[np.bool_]:
        """Which commands (2, n), followed by full braking, certainly keep the clearance.

        The paths are sampled; the margin is the largest distance between two samples, twice what is needed.
        """
        robot, period = self._robot, self._period
        limit, most = robot.max_wheel_acceleration, robot.max_wheel_speed
        change = limit * period
        reached = np.clip(np.clip(command, -most, most), wheels - change, wheels + change)
        share = np.linspace(0.0, 1.0, _SAMPLES)[:, None, None]
        time = share * (period + abs(reached).max(axis=0) / limit)
        # They ramp to the command, and are there when the period ends and braking begins.
        braked = limit * np.maximum(time - period, 0.0)
        ramped = wheels + np.clip(reached - wheels, -limit * time, limit * time)
        speeds = ramped - np.clip(reached, -braked, braked)
        steps = np.diff(time[:, 0], axis=0)
        speed, turn = robot.twist(*(0.5 * (speeds[1:] + speeds[:-1])).swapaxes(0, 1))
        yaw = pose[2] + np.cumsum(turn * steps, axis=0) - 0.5 * turn * steps
        x = pose[0] + np.cumsum(speed * steps * np.cos(yaw), axis=0)
        y = pose[1] + np.cumsum(speed * steps * np.sin(yaw), axis=0)
        gap = self._distance.least(np.stack([pose[0], *x]), np.stack([pose[1], *y])).min(axis=0)
        margin = abs(speed * steps).max(axis=0) + 1e-3 * robot.footprint_radius
        kept: NDArray[np.bool_] = gap - robot.footprint_radius > self._clearance + margin
        return kept

    def _query(self, x: float, y: float, threshold: float) -> list[_Found]:
        return [
            _Found(index, found[0], np.array(found[1:]))
            for index, distances in enumerate(self._distances)
            for found in distances.within(x, y, threshold)
        ]
