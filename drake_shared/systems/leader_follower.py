"""Arbitration with a leader, who chooses the direction, and a follower."""

from __future__ import annotations

from typing import Any

from drake_shared.arbitration import leader_follower
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.robots import Robot
from drake_shared.systems.rule_arbiter import RuleArbiter

LEADERS = ("human", "agent")


class LeaderFollower(RuleArbiter):
    """Lets one of the two choose the direction, while the other one takes part in the pace.

    .. pydrake_system::

        name: LeaderFollower
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        output_ports:
        - shared_command
        - human_weight

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`. The shared
    command is the leader's, scaled to the mean pace of both commands; see
    `drake_shared.arbitration.leader_follower`, which names the source. It is not a convex combination of the
    two commands, since only the pace of the follower's counts; its pace lies between theirs, and w is the
    human's share of it. The confidence plays no part.

    Args:
        leader: "human" or "agent".
        share: Of the follower in the pace, from 0 to 1.
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.

    Raises:
        InputError: ``leader`` is unknown, or ``share`` is out of range.
    """

    def __init__(
        self,
        *,
        leader: str = "human",
        share: float = 0.5,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
    ) -> None:
        super().__init__(robot=robot, period=period, driver=driver)
        if leader not in LEADERS:
            raise InputError("LeaderFollower", "leader", f"must be one of {', '.join(LEADERS)}", repr(leader))
        if not (isinstance(share, int | float) and 0.0 <= share <= 1.0):
            raise InputError("LeaderFollower", "share", "must be from 0 to 1", repr(share))
        self._leader, self._share = leader, float(share)
        self.DeclareRule()

    @property
    def configuration(self) -> dict[str, Any]:
        """Leader and share."""
        return {"leader": self._leader, "share": self._share}

    def MakeRule(self, learner: Learner | None) -> leader_follower.LeaderFollower:
        """The rule, which is the same for all learners."""
        return leader_follower.LeaderFollower(
            human_leads=self._leader == "human", share=self._share, limits=self.robot.command_limits
        )
