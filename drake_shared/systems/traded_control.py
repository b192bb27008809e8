"""Traded control: one of the two drives, depending on the agent's confidence and on the obstacles."""

from __future__ import annotations

import math
from typing import Any

from drake_shared.arbitration.traded import Traded
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.robots import Robot
from drake_shared.systems.rule_arbiter import RuleArbiter


class TradedControl(RuleArbiter):
    """Gives the whole control to the agent while its confidence is high, and else to the human.

    .. pydrake_system::

        name: TradedControl
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        - clearance
        output_ports:
        - shared_command
        - human_weight

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`; w is 0 or 1.
    The input ``clearance`` (1), in [m], exists only with a ``least_clearance``.

    State:
        Whether the agent drove in the step before.

    The agent takes over where its confidence is at least ``threshold`` + ``margin`` and gives back where it
    is at most ``threshold`` - ``margin``. This hysteresis keeps a confidence that fluctuates about the
    threshold from switching the driver at every step. Near obstacles the human drives, whatever the
    confidence, if a ``least_clearance`` is given; `drake_shared.arbitration.traded` names the source.

    Args:
        threshold: Of the confidence.
        margin: Half the width of the hysteresis.
        least_clearance: The human drives where an obstacle is nearer, in [m].
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.

    Raises:
        InputError: The hysteresis does not lie within (0, 1], or the clearance is negative or not finite.
    """

    def __init__(
        self,
        *,
        threshold: float = 0.5,
        margin: float = 0.05,
        least_clearance: float = 0.0,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
    ) -> None:
        if not (margin >= 0.0 and threshold - margin > 0.0 and threshold + margin <= 1.0):
            got = f"{threshold} and {margin}"
            raise InputError("TradedControl", "threshold", "plus and minus margin must be from 0 to 1", got)
        if not 0.0 <= least_clearance < math.inf:
            expected = "must be finite and not negative"
            raise InputError("TradedControl", "least_clearance", expected, least_clearance)
        super().__init__(
            robot=robot,
            period=period,
            driver=driver,
            optional_inputs=("clearance",) if least_clearance > 0.0 else (),
        )
        self._rule = Traded(
            threshold=float(threshold), margin=float(margin), least_clearance=float(least_clearance)
        )
        self.DeclareRule()

    @property
    def configuration(self) -> dict[str, Any]:
        """Threshold and margin, and the least clearance if there is one."""
        found = {"threshold": self._rule.threshold, "margin": self._rule.margin}
        if self._rule.least_clearance > 0.0:
            found["least_clearance"] = self._rule.least_clearance
        return found

    def MakeRule(self, learner: Learner | None) -> Traded:
        """The rule, which is the same for all learners."""
        return self._rule
