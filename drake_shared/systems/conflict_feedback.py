"""Lets a person feel where the agent disagrees with them."""

from __future__ import annotations

from pydrake.systems.framework import BasicVector, Context, LeafSystem, OutputPort

from drake_shared.arbitration.feedback import Feedback, conflict, resisted_command
from drake_shared.robots import Robot, check_robot


class ConflictFeedback(LeafSystem):
    """Computes the conflict between human and agent that a person feels or hears.

    .. pydrake_system::

        name: ConflictFeedback
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        output_ports:
        - conflict
        - resisted_command

    Inputs:
        human_command (M): In the robot's units.
        autonomous_command (M): In the robot's units.
        confidence (1): c_f, from 0 to 1.

    Outputs (both feed through):
        conflict (1 + M): Strength, from 0 to 1, and the direction from the human's command to the agent's;
            see `drake_shared.arbitration.feedback.conflict`. Zero while the human gives no command: when a
            driver is lost, so is what there was to feel.
        resisted_command (M): The human's command, reduced where the two point apart; the human's command
            itself without resistance.

    Rendering is left to whoever has the device: the page turns the conflict into rumble and tone. This is the
    tactile shared control to which Amirshirzad et al. 2022 refer ([5], [6], [19]).

    Args:
        robot: Sizes, limits, and the angle between two commands.
        feedback: Which feedback is on.

    Raises:
        InputError: ``robot`` is not a Robot.
    """

    def __init__(self, *, robot: Robot, feedback: Feedback) -> None:
        super().__init__()
        self.set_name("conflict_feedback")
        check_robot(robot)
        self._robot = robot
        self._feedback = feedback
        size = len(robot.command_names)
        self._human_port = self.DeclareVectorInputPort("human_command", size)
        self._agent_port = self.DeclareVectorInputPort("autonomous_command", size)
        self._confidence_port = self.DeclareVectorInputPort("confidence", 1)
        self._conflict_port = self.DeclareVectorOutputPort("conflict", 1 + size, self._calc_conflict)
        self._resisted_port = self.DeclareVectorOutputPort("resisted_command", size, self._calc_resisted)

    def get_conflict_output_port(self) -> OutputPort:
        """The port ``conflict``."""
        return self._conflict_port

    def get_resisted_command_output_port(self) -> OutputPort:
        """The port ``resisted_command``."""
        return self._resisted_port

    def _inputs(self, context: Context) -> tuple[list[float], list[float], float]:
        return (
            self._human_port.Eval(context).tolist(),
            self._agent_port.Eval(context).tolist(),
            self._confidence_port.Eval(context).item(),
        )

    def _calc_conflict(self, context: Context, output: BasicVector) -> None:
        strength, direction = conflict(self._robot, *self._inputs(context))
        output.set_value([strength, *direction])

    def _calc_resisted(self, context: Context, output: BasicVector) -> None:
        output.set_value(resisted_command(self._robot, *self._inputs(context), self._feedback.resistance))
