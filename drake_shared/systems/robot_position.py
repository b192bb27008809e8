"""Position of a robot whose configuration does not contain it."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_shared.robots import Robot


class RobotPosition(LeafSystem):
    """Computes coordinates of the robot's position from its configuration, for the log.

    .. pydrake_system::

        name: RobotPosition
        input_ports:
        - pose
        output_ports:
        - position

    Inputs:
        pose: Configuration of the robot.

    Outputs:
        position: The coordinates that are not elements of the configuration, in [m]. Direct feedthrough.

    Args:
        robot: Computes the position.
    """

    def __init__(self, *, robot: Robot) -> None:
        super().__init__()
        self.set_name("robot_position")
        self._robot = robot
        self._indices = [
            index for index, name in enumerate(robot.position_names) if name not in robot.configuration_names
        ]
        self._pose_port = self.DeclareVectorInputPort("pose", len(robot.configuration_names))
        self.DeclareVectorOutputPort("position", len(self._indices), self._calc_position)

    def _calc_position(self, context: Context, output: BasicVector) -> None:
        position = self._robot.position(self._pose_port.Eval(context).tolist())
        output.set_value(np.array([position[index] for index in self._indices]))
