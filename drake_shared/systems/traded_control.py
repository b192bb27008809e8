"""Traded control: one of the two drives, depending on the agent's confidence."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues

from drake_shared.arbitration.blend import traded_weight
from drake_shared.common.errors import InputError
from drake_shared.robots import Robot
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate


class TradedControl(Arbiter):
    """Gives the whole control to the agent while its confidence is high, and else to the human.

    .. pydrake_system::

        name: TradedControl
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        output_ports:
        - shared_command
        - human_weight

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`; w is 0 or 1.

    State:
        agent (1): 1 if the agent drove in the step before, else 0.

    The agent takes over where its confidence is at least ``threshold`` + ``margin`` and gives back where it
    is at most ``threshold`` - ``margin``. This hysteresis keeps a confidence that fluctuates about the
    threshold from switching the driver at every step.

    Args:
        threshold: Of the confidence.
        margin: Half the width of the hysteresis.
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.

    Raises:
        InputError: The hysteresis does not lie within (0, 1].
    """

    def __init__(
        self,
        *,
        threshold: float = 0.5,
        margin: float = 0.05,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
    ) -> None:
        super().__init__(
            robot=robot, period=period, driver=driver, weight_inputs=("autonomous_command", "confidence")
        )
        if not (margin >= 0.0 and threshold - margin > 0.0 and threshold + margin <= 1.0):
            got = f"{threshold} and {margin}"
            raise InputError("TradedControl", "threshold", "plus and minus margin must be from 0 to 1", got)
        self._threshold, self._margin = float(threshold), float(margin)
        self._agent_index = self.DeclareDiscreteState(1)
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    @property
    def configuration(self) -> dict[str, Any]:
        """Threshold and margin."""
        return {"threshold": self._threshold, "margin": self._margin}

    def DoCalcWeight(self, context: Context) -> float:
        """1 while the human drives, 0 while the agent does."""
        agent = context.get_discrete_state(self._agent_index)[0]
        weight: float = traded_weight(self.confidence(context), agent, self._threshold, self._margin)
        return weight

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._agent_index, np.array([1.0 - self._weight_port.Eval(context).item()]))
