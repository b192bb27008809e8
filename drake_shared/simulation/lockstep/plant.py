"""The kinematic robots of many trials among static obstacles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.elementwise import ARRAYS
from drake_shared.robots.contact import MARGIN, drive_until_contact, speeds_in_contact
from drake_shared.robots.motion import motion, motion_end, speeds_after
from drake_shared.scenario import Scenario
from drake_shared.scenario.planar_distance import PlanarDistance

Floats = NDArray[np.float64]


class Plants:
    """Moves many robots as `drake_shared.systems.diff_drive_plant.DiffDrivePlant` moves one.

    Args:
        scenario: Robot, control period, and obstacles, which must be static.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._robot = scenario.diff_drive
        self._period = scenario.control_period
        self._distance = PlanarDistance(scenario.obstacles)

    def clearance(self, pose: Floats) -> Floats:
        """Distance (n,) of each body to the nearest obstacle, in [m]; infinite without obstacles."""
        return self._distance.least(pose[0], pose[1]) - self._robot.footprint_radius

    def update(
        self, pose: Floats, wheels: Floats, command: Floats, clearance: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Poses (3, n), wheel speeds (2, n) and contacts (n,), 0 or 1, of the next step.

        Args:
            pose: Shape (3, n), in [m, m, rad].
            wheels, command: Shape (2, n), in [rad/s].
            clearance: Shape (n,), at ``pose``.
        """
        robot, period = self._robot, self._period
        fastest = robot.max_wheel_speed
        possible = np.clip(np.where(np.isfinite(command), command, 0.0), -fastest, fastest)
        reached = np.stack(speeds_after(robot, tuple(wheels), tuple(possible), period, ARRAYS))
        after = np.stack(motion_end(robot, tuple(pose), tuple(wheels), tuple(possible), period))
        contact = np.zeros(pose.shape[1])
        reach = period * np.maximum(abs(wheels), abs(reached)).max(axis=0) * robot.wheel_radius
        for row in np.flatnonzero(~(clearance > reach + MARGIN)).tolist():
            before, speeds, wanted, end = (
                tuple(part[:, row].tolist()) for part in (pose, wheels, possible, reached)
            )
            path = motion(robot, before, speeds, wanted, period)
            *place, touches = drive_until_contact(self._distance.within, robot.footprint_radius, before, path)
            after[:, row] = place
            if touches:
                reached[:, row] = speeds_in_contact(end)
                contact[row] = 1.0
        return after, reached, contact
