"""Leader and follower: one chooses where to go, the other one goes along at a pace of their own.

Source: the strategy of Evrard and Kheddar, "Homotopy switching model for dyad haptic interaction in physical
collaborative tasks", World Haptics 2009, to which Amirshirzad et al. 2022 refer. There a homotopy between the
motions of leader and follower is applied to an object that both hold. A robot has one command, of which the
leader gives the direction here, and both the pace.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.rule import ArbiterInputs, State

Floats = NDArray[np.float64]

# Of a follower, relative to the leader.
_FASTEST = 2.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class LeaderFollower:
    """The rule of leader and follower: an `ArbitrationRule`.

    Attributes:
        human_leads: Whether the human leads; else the agent does.
        share: Of the follower in the pace, from 0 to 1.
        limits: Largest absolute value (M,) of each element of a command, in the robot's units.
    """

    human_leads: bool
    share: float
    limits: Sequence[float]

    def initial_state(self, count: int) -> State:
        """See `ArbitrationRule`; there is no state."""
        return {}

    def step(self, state: State, inputs: ArbiterInputs) -> tuple[Floats, Floats, State]:
        """See `ArbitrationRule`; w is the human's share of the pace."""
        leader, follower = inputs.human, inputs.autonomous
        if not self.human_leads:
            leader, follower = follower, leader
        own = self._pace(leader)
        # What is hardly a command has no direction to go along with.
        other = np.minimum(self._pace(follower), _FASTEST * own)
        pace = (1.0 - self.share) * own + self.share * other
        command = leader * (pace / np.where(own > 0.0, own, 1.0))
        weight = 1.0 - self.share if self.human_leads else self.share
        return np.full(len(own), weight), command, state

    def _pace(self, command: Floats) -> Floats:
        """The largest element (n,) of a command (M, n), as a share of its limit."""
        return np.asarray((np.abs(command) / np.reshape(self.limits, (-1, 1))).max(axis=0))
