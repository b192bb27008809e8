"""Pure-pursuit controller toward the predicted position."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, InputPort, LeafSystem, OutputPort

from drake_shared.robots import Robot, check_robot
from drake_shared.systems.discrete_update import check_positive
from drake_shared.systems.intention import Intention, empty_intention


class WaypointController(LeafSystem):
    """Commands the robot toward the position expected a look-ahead from now, to be there by then.

    .. pydrake_system::

        name: WaypointController
        input_ports:
        - pose
        - intention
        output_ports:
        - autonomous_command

    Inputs:
        pose: Configuration of the robot, such as [x, y, yaw] in [m, m, rad], world frame.
        intention: :class:`~drake_shared.systems.intention.Intention`.

    Outputs:
        autonomous_command (M): The robot's ``command_toward`` that position, within the robot's limits; NaN
            where the intention is NaN. Direct feedthrough. For the differential drive this is pure pursuit
            (Coulter 1992).

    Args:
        robot: Gives the sizes of the ports, and the command toward a position.
        look_ahead: In [s]. One control step is the paper's; a robot of limited acceleration needs more.

    Raises:
        InputError: ``look_ahead`` is not positive and finite, or ``robot`` is not a Robot.
    """

    def __init__(self, *, robot: Robot, look_ahead: float = 0.6) -> None:
        super().__init__()
        self.set_name("waypoint_controller")
        check_robot(robot)
        check_positive(self, look_ahead=look_ahead)
        self._robot = robot
        self._look_ahead = look_ahead
        self._pose_port = self.DeclareVectorInputPort("pose", len(robot.configuration_names))
        self._intention_port = self.DeclareAbstractInputPort(
            "intention", Value(empty_intention(len(robot.position_names)))
        )
        self._command_port = self.DeclareVectorOutputPort(
            "autonomous_command",
            len(robot.command_names),
            self._calc_command,
            {
                self.input_port_ticket(self._pose_port.get_index()),
                self.input_port_ticket(self._intention_port.get_index()),
            },
        )

    def get_pose_input_port(self) -> InputPort:
        """The port ``pose``."""
        return self._pose_port

    def get_intention_input_port(self) -> InputPort:
        """The port ``intention``."""
        return self._intention_port

    def get_autonomous_command_output_port(self) -> OutputPort:
        """The port ``autonomous_command``."""
        return self._command_port

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        intention: Intention = self._intention_port.Eval(context)
        target = intention.position_at(intention.time + self._look_ahead)
        pose = self._pose_port.Eval(context).tolist()
        output.set_value(np.array(self._robot.command_toward(pose, target, self._look_ahead)))
