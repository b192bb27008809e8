"""Arbitration that heeds nobody's confidence: fixed shares of the control."""

from __future__ import annotations

import math
from typing import Any

from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_shared.systems.confidence_blender import blend, finite_weight


class ConstantWeightBlender(LeafSystem):
    """Blends both commands with a weight that never changes: 1 and 0 are the human and the agent alone.

    .. pydrake_system::

        name: ConstantWeightBlender
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        output_ports:
        - shared_command
        - human_weight

    Inputs and outputs are those of :class:`~drake_shared.systems.confidence_blender.ConfidenceBlender`, and
    so is what happens where a command is no number; the confidence is not looked at.

    Args:
        weight: w, in [0, 1].

    Raises:
        ValueError: The weight is out of range.
    """

    def __init__(self, weight: float = 0.5) -> None:
        super().__init__()
        if not (math.isfinite(weight) and 0.0 <= weight <= 1.0):
            raise ValueError(f"weight must be from 0 to 1, got {weight}")
        self._weight = float(weight)
        self._human_port = self.DeclareVectorInputPort("human_command", 2)
        self._autonomous_port = self.DeclareVectorInputPort("autonomous_command", 2)
        self.DeclareVectorInputPort("confidence", 1)
        human, autonomous = (
            self.input_port_ticket(port.get_index()) for port in (self._human_port, self._autonomous_port)
        )
        self._weight_port = self.DeclareVectorOutputPort("human_weight", 1, self._calc_weight, {autonomous})
        self.DeclareVectorOutputPort("shared_command", 2, self._calc_command, {human, autonomous})

    @property
    def configuration(self) -> dict[str, Any]:
        """What a log says of it."""
        return {"weight": self._weight}

    @property
    def alone(self) -> str | None:
        """Who drives alone, "human" or "agent", if anyone does."""
        return {1.0: "human", 0.0: "agent"}.get(self._weight)

    def _calc_weight(self, context: Context, output: BasicVector) -> None:
        output[0] = finite_weight(self._weight, self._autonomous_port.Eval(context).tolist())

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        weight = self._weight_port.Eval(context).item()
        autonomous = self._autonomous_port.Eval(context).tolist()
        output.set_value(blend(weight, self._human_port.Eval(context).tolist(), autonomous))
