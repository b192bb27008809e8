"""Arbitration by turns: one of the two drives, and the agent's confidence says which."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from drake_shared.systems.confidence_blender import blend, finite_weight


class TradedControl(LeafSystem):
    """Gives the whole control to the agent while it is sure, and to the human while it is not.

    .. pydrake_system::

        name: TradedControl
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        output_ports:
        - shared_command
        - human_weight

    Inputs and outputs are those of :class:`~drake_shared.systems.confidence_blender.ConfidenceBlender`, and
    so is what happens where something is no number; w is 0 or 1.

    State:
        agent (1): 1 if the agent drove in the period before, else 0.

    The agent takes over where its confidence is at least ``threshold`` + ``margin`` and gives back where it
    is at most ``threshold`` - ``margin``: between the two nobody changes, so that a confidence that trembles
    about the threshold does not hand the robot to and fro.

    Args:
        threshold: Of the confidence.
        margin: Half the width of the band in which nobody changes.
        period: Of the control step, in [s].

    Raises:
        ValueError: The band does not lie within (0, 1].
    """

    def __init__(self, *, threshold: float = 0.5, margin: float = 0.05, period: float = 0.05) -> None:
        super().__init__()
        sound = math.isfinite(threshold) and math.isfinite(margin) and margin >= 0.0
        if not (sound and threshold - margin > 0.0 and threshold + margin <= 1.0):
            raise ValueError(f"threshold and margin must lie within 0 and 1, got {threshold}, {margin}")
        self._threshold, self._margin = float(threshold), float(margin)
        self._human_port = self.DeclareVectorInputPort("human_command", 2)
        self._autonomous_port = self.DeclareVectorInputPort("autonomous_command", 2)
        self._confidence_port = self.DeclareVectorInputPort("confidence", 1)
        self._agent_index = self.DeclareDiscreteState(1)
        human, autonomous, confidence = (
            self.input_port_ticket(port.get_index())
            for port in (self._human_port, self._autonomous_port, self._confidence_port)
        )
        before = self.discrete_state_ticket(self._agent_index)
        self._weight_port = self.DeclareVectorOutputPort(
            "human_weight", 1, self._calc_weight, {autonomous, confidence, before}
        )
        self.DeclareVectorOutputPort(
            "shared_command", 2, self._calc_command, {human, autonomous, confidence, before}
        )
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    @property
    def configuration(self) -> dict[str, Any]:
        """What a log says of it."""
        return {"threshold": self._threshold, "margin": self._margin}

    def _calc_weight(self, context: Context, output: BasicVector) -> None:
        agent = context.get_discrete_state(self._agent_index)[0] > 0.5
        confidence = self._confidence_port.Eval(context).item()
        bound = self._threshold + (-self._margin if agent else self._margin)
        # Someone who is sure enough at the bound itself takes over, and gives back, there.
        sure = confidence > bound if agent else confidence >= bound
        output[0] = finite_weight(0.0 if sure else 1.0, self._autonomous_port.Eval(context).tolist())

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        weight = self._weight_port.Eval(context).item()
        autonomous = self._autonomous_port.Eval(context).tolist()
        output.set_value(blend(weight, self._human_port.Eval(context).tolist(), autonomous))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._agent_index, np.array([1.0 - self._weight_port.Eval(context).item()]))
