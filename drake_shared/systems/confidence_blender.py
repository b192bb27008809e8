"""Arbitration: how much of the command is the person's."""

from __future__ import annotations

import math

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, LeafSystem

MODES = ("shared", "human", "agent")


class ConfidenceBlender(LeafSystem):
    """Blends both commands, the agent's by how sure it is: eq. (2) of Amirshirzad et al. 2022.

    .. pydrake_system::

        name: ConfidenceBlender
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        output_ports:
        - shared_command
        - human_weight

    Inputs:
        human_command (2): Wheel speeds [left, right] in [rad/s].
        autonomous_command (2): The same, of the agent.
        confidence (1): c_f, in [0, 1].

    Outputs:
        shared_command (2): w human + (1 - w) autonomous, in [rad/s]. Feeds through.
        human_weight (1): w = 1 - c_f, from 0 (the agent drives) to 1 (the human drives). Feeds through.

    Where confidence or the agent's command is no number, the human drives alone (w = 1). A human command
    that is no number counts as zero.

    Parameters (of the Context):
        mode: "shared", or "human" (w = 1) or "agent" (w = 0) for comparison; see :meth:`set_mode`.
    """

    def __init__(self) -> None:
        super().__init__()
        self._human_port = self.DeclareVectorInputPort("human_command", 2)
        self._autonomous_port = self.DeclareVectorInputPort("autonomous_command", 2)
        self._confidence_port = self.DeclareVectorInputPort("confidence", 1)
        self._mode_index = self.DeclareAbstractParameter(Value("shared"))
        human, autonomous, confidence = (
            self.input_port_ticket(port.get_index())
            for port in (self._human_port, self._autonomous_port, self._confidence_port)
        )
        mode = self.pa_ticket()
        self._weight_port = self.DeclareVectorOutputPort(
            "human_weight", 1, self._calc_weight, {autonomous, confidence, mode}
        )
        self.DeclareVectorOutputPort(
            "shared_command", 2, self._calc_command, {human, autonomous, confidence, mode}
        )

    def set_mode(self, context: Context, mode: str) -> None:
        """Sets who takes part: "shared", "human" or "agent".

        Raises:
            ValueError: It is none of these.
        """
        if mode not in MODES:
            raise ValueError(f"mode must be one of {', '.join(MODES)}, got {mode!r}")
        context.get_mutable_abstract_parameter(self._mode_index).set_value(mode)

    def _calc_weight(self, context: Context, output: BasicVector) -> None:
        mode = context.get_abstract_parameter(self._mode_index).get_value()
        weight = 1.0 if mode == "human" else 0.0
        if mode == "shared":
            weight = 1.0 - min(max(self._confidence_port.Eval(context).item(), 0.0), 1.0)
        output[0] = finite_weight(weight, self._autonomous_port.Eval(context))

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        weight = self._weight_port.Eval(context).item()
        autonomous = self._autonomous_port.Eval(context)
        output.set_value(blend(weight, self._human_port.Eval(context), autonomous))


def finite_weight(weight: float, autonomous: np.ndarray) -> float:
    """The human's weight, 1 where it or the agent's command (2,) is no finite number."""
    left, right = autonomous.tolist()
    # A sum with what is no finite number is none either.
    return weight if math.isfinite(weight + left + right) else 1.0


def blend(weight: float, human: np.ndarray, autonomous: np.ndarray) -> np.ndarray:
    """w human + (1 - w) autonomous (2,); a human command that is no number is zero."""
    if not all(map(math.isfinite, human.tolist())):
        human = np.zeros(2)
    if weight < 1.0:
        human = weight * human + (1.0 - weight) * autonomous
    return human
