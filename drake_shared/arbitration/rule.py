"""What an arbiter computes, for many trials at once: one formula for diagrams and for trials in lock-step."""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
State = dict[str, NDArray[Any]]
"""Arrays by name, whose last axis is that of the trials."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ArbiterInputs:
    """What arbiters receive in one step of n trials.

    Attributes:
        human: Shape (M, n), in the robot's units; finite.
        autonomous: Shape (M, n), in the robot's units; NaN where the agent has no command.
        confidence: Shape (n,), from 0 to 1; NaN where there is none.
        pose: Shape (C, n), configurations of the robot; empty (0, n) for arbiters that do not ask for it.
        clearance: Shape (n,), distance to the nearest obstacle, in [m]; infinite for those that do not ask.
    """

    human: Floats
    autonomous: Floats
    confidence: Floats
    pose: Floats
    clearance: Floats


class ArbitrationRule(Protocol):
    """Divides the control of n trials, with a state.

    Where the agent's command is not finite, the caller gives the control to the human.
    """

    def initial_state(self, count: int, /) -> State:
        """Before the first step of ``count`` trials."""
        ...

    def step(self, state: State, inputs: ArbiterInputs, /) -> tuple[Floats, Floats, State]:
        """w (n,), from 0 to 1, the shared command (M, n), and the state of the next step.

        Args:
            state: Of the step before; it must be left as it is.
            inputs: Of this step.
        """
        ...
