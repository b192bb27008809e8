"""What arbiters share: their ports, and the choice of who drives."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, InputPort, LeafSystem, OutputPort

from drake_shared.arbitration.blend import DRIVERS, blend, finite_weight
from drake_shared.common.errors import InputError, RunError
from drake_shared.learners import Learner
from drake_shared.robots import DiffDrive, Robot, check_robot
from drake_shared.systems.discrete_update import check_positive
from drake_shared.systems.failure import reraise
from drake_shared.systems.intention import empty_intention


class Arbiter(LeafSystem):
    """Divides the control between human and agent; a base class.

    A subclass implements :meth:`DoCalcWeight`, and :meth:`DoCalcCommand` if the shared command is not the
    blend of both by that weight.

    .. pydrake_system::

        name: Arbiter
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        output_ports:
        - shared_command
        - human_weight

    Inputs:
        human_command (M): In the robot's units. Counts as zero where it is NaN or infinite.
        autonomous_command (M): The same, of the agent. Where it is NaN or infinite the human drives alone.
        confidence (1): c_f, from 0 to 1; NaN means that there is none.
        pose, intention, idle_time, clearance: Those named in ``optional_inputs``; a diagram connects the ones
            that it has. See :data:`OPTIONAL_INPUTS`.

    Outputs:
        shared_command (M): In the robot's units. Feeds through.
        human_weight (1): w, from 0 (the agent drives) to 1 (the human drives). Feeds through.

    Parameters (of the Context):
        driver: "shared", or "human" (w = 1) or "agent" (w = 0); see :meth:`SetDriver`.

    Args:
        robot: States names, units and limits of commands; the Pioneer if None.
        period: Of the control step, in [s].
        driver: Default of the parameter.
        optional_inputs: Further input ports, of `OPTIONAL_INPUTS`.
        weight_inputs: Input ports on which w depends; all if None.

    Raises:
        InputError: The period is not positive and finite, or the driver is unknown.
    """

    OPTIONAL_INPUTS = ("pose", "intention", "idle_time", "clearance")
    """The robot's configuration; :class:`~drake_shared.systems.intention_estimator.Intention`; time since the
    human last touched the controls, in [s]; distance to the nearest obstacle, in [m]."""

    def __init__(
        self,
        *,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
        optional_inputs: Sequence[str] = (),
        weight_inputs: Sequence[str] | None = None,
    ) -> None:
        super().__init__()
        # Such as "confidence_blender"; a diagram may give another name.
        self.set_name(re.sub("(?<=[a-z])(?=[A-Z])", "_", type(self).__name__).lower())
        check_positive(self, period=period)
        self.robot: Robot = DiffDrive() if robot is None else robot
        check_robot(self.robot)
        self.period = period
        size = len(self.robot.command_names)
        self._human_port = self.DeclareVectorInputPort("human_command", size)
        self._autonomous_port = self.DeclareVectorInputPort("autonomous_command", size)
        self._confidence_port = self.DeclareVectorInputPort("confidence", 1)
        sizes = {"pose": len(self.robot.configuration_names), "idle_time": 1, "clearance": 1}
        for name in optional_inputs:
            if name == "intention":
                self.DeclareAbstractInputPort(name, Value(empty_intention(len(self.robot.position_names))))
            else:
                self.DeclareVectorInputPort(name, sizes[name])
        _check_driver(driver)
        self.default_driver = driver
        self._driver_index = self.DeclareAbstractParameter(Value(driver))
        prerequisites = {self.all_sources_ticket()}
        if weight_inputs is not None:
            ports = [self.GetInputPort(name) for name in weight_inputs]
            prerequisites = {self.input_port_ticket(port.get_index()) for port in ports}
            prerequisites |= {self.time_ticket(), self.all_state_ticket(), self.pa_ticket()}
        self._weight_port = self.DeclareVectorOutputPort("human_weight", 1, self._calc_weight, prerequisites)
        self._command_port = self.DeclareVectorOutputPort("shared_command", size, self._calc_command)

    @property
    def configuration(self) -> dict[str, Any]:
        """What a log holds of this arbiter: all that decides what it does, as JSON."""
        return {}

    def get_human_command_input_port(self) -> InputPort:
        """Input port ``human_command``."""
        return self._human_port

    def get_autonomous_command_input_port(self) -> InputPort:
        """Input port ``autonomous_command``."""
        return self._autonomous_port

    def get_confidence_input_port(self) -> InputPort:
        """Input port ``confidence``."""
        return self._confidence_port

    def get_shared_command_output_port(self) -> OutputPort:
        """Output port ``shared_command``."""
        return self._command_port

    def get_human_weight_output_port(self) -> OutputPort:
        """Output port ``human_weight``."""
        return self._weight_port

    def SetDriver(self, context: Context, driver: str) -> None:
        """Sets who drives: "shared", "human" or "agent".

        Raises:
            InputError: The driver is unknown.
        """
        _check_driver(driver)
        context.get_mutable_abstract_parameter(self._driver_index).set_value(driver)

    def GetDriver(self, context: Context) -> str:
        """Who drives: "shared", "human" or "agent"."""
        driver: str = context.get_abstract_parameter(self._driver_index).get_value()
        return driver

    def SetLearner(self, context: Context, learner: Learner) -> None:
        """Sets the learner of a trial; for arbiters that use more of it than its predictions."""

    def release_reason(self, context: Context) -> str | None:
        """Why the agent gives up control now, whatever its confidence: "conflict", "hands_off" or None."""
        return None

    def confidence(self, context: Context) -> float:
        """The confidence, from 0 to 1 or NaN.

        Raises:
            RunError: It is out of range.
        """
        confidence: float = self._confidence_port.Eval(context).item()
        if not (0.0 <= confidence <= 1.0 or confidence != confidence):
            raise self._out_of_range(context, "the input confidence must be from 0 to 1, or NaN", confidence)
        return confidence

    def DoCalcWeight(self, context: Context) -> float:
        """w in shared control, from 0 to 1."""
        raise NotImplementedError

    def DoCalcCommand(
        self, context: Context, weight: float, human: Sequence[float], autonomous: Sequence[float]
    ) -> Sequence[float]:
        """The command (M,) in shared control, given w and both commands (M,)."""
        return blend(weight, human, autonomous)

    def _calc_weight(self, context: Context, output: BasicVector) -> None:
        driver = self.GetDriver(context)
        try:
            weight = self.DoCalcWeight(context) if driver == "shared" else float(driver == "human")
            if not 0.0 <= weight <= 1.0:
                raise self._out_of_range(context, "the output human_weight must be from 0 to 1", weight)
            output[0] = finite_weight(weight, self._autonomous_port.Eval(context).tolist())
        except Exception as error:  # Arbiters and controllers from outside may raise anything.
            reraise(error, context.get_time(), self)

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        weight: float = self._weight_port.Eval(context).item()
        human = self._human_port.Eval(context).tolist()
        autonomous = self._autonomous_port.Eval(context).tolist()
        if self.GetDriver(context) != "shared":
            output.set_value(blend(weight, human, autonomous))
            return
        try:
            command = self.DoCalcCommand(context, weight, human, autonomous)
            if not math.isfinite(sum(command)):
                raise self._out_of_range(context, "the output shared_command must be finite", command)
            output.set_value(command)
        except Exception as error:
            reraise(error, context.get_time(), self)

    def _out_of_range(self, context: Context, expected: str, got: object) -> RunError:
        name, time = f"{self.get_name()} ({type(self).__name__})", context.get_time()
        return RunError(f"{name}: {expected}, got {got} at t = {time:.3f} s")


def _check_driver(driver: str) -> None:
    if driver not in DRIVERS:
        raise InputError("arbiter", "driver", f"must be one of {', '.join(DRIVERS)}", repr(driver))
