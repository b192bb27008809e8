"""The human command channels of many trials, with their faults."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.simulation.faults import Faults
from drake_shared.simulation.lockstep.noise import Noise

Floats = NDArray[np.float64]
State = dict[str, Any]

# After the operator's noise and chance.
_SOURCE = 2


class Channels:
    """Does for many trials what `drake_shared.systems.channel_fault.ChannelFault` does for one.

    Args:
        faults: Those of the channel are injected.
        period: Of the control step, in [s].
        noise: Of the trials' seeds.
    """

    def __init__(self, faults: Faults, period: float, noise: Noise) -> None:
        self._faults = faults
        self._period = period
        self._slack = 1e-6 * period
        self._depth = int((faults.delay + faults.jitter) / period) + 1
        self._chance = noise.uniform(_SOURCE, 3)

    def initial_state(self, count: int) -> State:
        """The state at the start."""
        return {
            "trial": np.arange(count),
            "drawn": np.repeat([[1.0], [0.0], [1.0]], count, axis=1),
            "past": np.full((self._depth, 3, count), math.inf),
            "held": np.zeros((2, count)),
        }

    def receive(self, state: State, step: int, sent: Floats) -> Floats:
        """The commands (2, n) received at ``step``; replaces ``state`` by that of the next step.

        Args:
            state: At ``step``.
            step: Index of the control step.
            sent: Shape (2, n), in [rad/s].
        """
        faults, now = self._faults, step * self._period
        lost, late, corrupted = state["drawn"]
        arrival = np.where(lost >= faults.loss, now + faults.delay + late * faults.jitter, math.inf)
        samples = np.concatenate([np.concatenate([arrival[None], sent])[None], state["past"]])
        freezes = faults.freeze_time - self._slack
        if not freezes <= now < freezes + faults.freeze:
            arrived = samples[:, 0] <= now + self._slack
            newest = samples[arrived.argmax(axis=0), 1:, np.arange(sent.shape[1])].T
            state["held"] = np.where(arrived.any(axis=0), newest, state["held"])
        state["past"] = samples[: self._depth]
        if step < len(self._chance):
            state["drawn"] = self._chance[step][:, state["trial"]]
        return np.where(corrupted < faults.human_nan, math.nan, state["held"])
