"""A custom arbiter: the agent drives where it is confident, the human elsewhere.

Usage: python examples/own_arbiter.py
"""

from __future__ import annotations

from typing import Any

from pydrake.systems.framework import Context

from drake_shared import Simulation, Trial, TrialSettings, load_learner, load_scenario
from drake_shared.systems.arbiter import Arbiter


class ThresholdArbiter(Arbiter):
    """Gives the control to the agent where its confidence is above a threshold.

    .. pydrake_system::

        name: ThresholdArbiter
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        output_ports:
        - shared_command
        - human_weight

    Args:
        threshold: Confidence, from 0 to 1.
        options: See :class:`Arbiter`.
    """

    def __init__(self, threshold: float = 0.7, **options: Any) -> None:
        super().__init__(**options)
        self._threshold = threshold

    @property
    def configuration(self) -> dict[str, float]:
        """The threshold; kept in every log."""
        return {"threshold": self._threshold}

    def DoCalcWeight(self, context: Context) -> float:
        """1 or 0."""
        return 0.0 if self.confidence(context) > self._threshold else 1.0


def main() -> Trial:
    """Runs a trial in which the arbiter divides the control."""
    scenario = load_scenario("two_obstacles")
    arbiter = ThresholdArbiter(robot=scenario.robot, period=scenario.control_period)
    simulation = Simulation(scenario, learner=load_learner("two_obstacles"), arbiter=arbiter)
    trial = simulation.run(TrialSettings(route="right_left"))
    print(trial.status, trial.metadata["arbitration"])
    return trial


if __name__ == "__main__":
    main()
