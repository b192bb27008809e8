"""Traded control: one of the two drives at a time, under conditions.

Source: the strategy that Amirshirzad et al. 2022 name first, "applied in aircraft autopilot systems where the
control is given to the computer while cruising", and to the human in "more complex situations such as taking
off and landing".
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.rule import ArbiterInputs, State

Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Traded:
    """The rule of traded control: an `ArbitrationRule`.

    Attributes:
        threshold, margin: The agent takes over where c_f is at least their sum, and gives back where it is at
            most their difference. A c_f that is NaN gives the human the control.
        least_clearance: Where an obstacle is nearer than this, in [m], the human drives.
    """

    threshold: float
    margin: float
    least_clearance: float

    def initial_state(self, count: int) -> State:
        """See `ArbitrationRule`; the human drives first."""
        return {"agent": np.zeros(count, bool)}

    def step(self, state: State, inputs: ArbiterInputs) -> tuple[Floats, Floats, State]:
        """See `ArbitrationRule`; w is 0 or 1."""
        takes = inputs.confidence >= self.threshold + self.margin
        keeps = inputs.confidence > self.threshold - self.margin
        agent = np.where(state["agent"], keeps, takes)
        agent &= (inputs.clearance >= self.least_clearance) & np.isfinite(inputs.autonomous).all(axis=0)
        command = np.where(agent, inputs.autonomous, inputs.human)
        return np.where(agent, 0.0, 1.0), command, {"agent": agent}
