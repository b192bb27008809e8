"""Consistency shared autonomy: the driver's command counts as a noisy sample of the demonstrated ones.

Source: Sun, Ji, Tan and Walter, "FlashBack: consistency model-accelerated shared autonomy", CoRL 2025
(arXiv 2505.16892). As in its public code no noise is drawn: the driver's action itself is taken for a sample
with a given level of noise, and one step of a consistency model leads to the demonstrated action from which
it came. The published model may also see the direction in which the driver's action leads; an action is a
displacement here, whose direction would leave nothing to denoise.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.rule import ArbiterInputs, State
from drake_shared.robots import Robot

Floats = NDArray[np.float64]
Denoiser = Callable[[Floats, Floats], Floats]
"""The demonstrated action (D,) for a position (D,) and the action (D,) of a driver, all in [m]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ConsistencySharedAutonomy:
    """The rule of consistency shared autonomy: an `ArbitrationRule`.

    The action of a command is the displacement to which it leads within the horizon, so that demonstrated
    positions suffice for robots of any kind.

    Attributes:
        robot: Tells where commands lead, and steers.
        horizon: In [s].
        denoise: One step of a consistency model, with its degree of noise; None without demonstrations, where
            the human drives alone.
        share: w, the share of the driver's action that the model passes on as it is, from 0 to 1; the rest is
            what its network adds.
    """

    robot: Robot
    horizon: float
    denoise: Denoiser | None
    share: float

    def initial_state(self, count: int) -> State:
        """See `ArbitrationRule`; there is no state."""
        return {}

    def step(self, state: State, inputs: ArbiterInputs) -> tuple[Floats, Floats, State]:
        """See `ArbitrationRule`; pose and the drivers' commands are used. Where w is 1 the human drives."""
        count = inputs.human.shape[1]
        if self.denoise is None or self.share == 1.0:
            return np.ones(count), inputs.human, state
        # One by one, since robots steer one by one, and BLAS would round a product of many rows differently.
        commands = [
            self._command(pose, human, self.denoise)
            for pose, human in zip(inputs.pose.T.tolist(), inputs.human.T.tolist(), strict=True)
        ]
        return np.full(count, self.share), np.array(commands).T, state

    def _command(self, pose: list[float], human: list[float], denoise: Denoiser) -> tuple[float, ...]:
        here = np.array(self.robot.position(pose))
        led = np.array(self.robot.rollout(pose, human, self.horizon))
        target = here + denoise(here, led - here)
        return self.robot.command_toward(pose, target.tolist(), self.horizon)
