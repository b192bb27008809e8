"""An operator of one's own: it steers straight at the goal, whatever is in between.

Usage: python examples/own_operator.py
"""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_shared import Scenario, Simulation, Trial, TrialSettings, load_learner, load_scenario


class BeelineOperator(LeafSystem):
    """Steers straight at the goal at a constant speed.

    .. pydrake_system::

        name: BeelineOperator
        input_ports:
        - pose
        output_ports:
        - human_command
    """

    def __init__(self, scenario: Scenario, speed: float = 0.5) -> None:
        super().__init__()
        self._robot, self._goal, self._speed = scenario.robot, scenario.goal, speed
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        command = self.DeclareDiscreteState(2)
        self.DeclareStateOutputPort("human_command", command)
        self.DeclarePeriodicDiscreteUpdateEvent(scenario.control_period, 0.0, self._update)
        self.DeclareForcedDiscreteUpdateEvent(self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        x, y, yaw = self._pose_port.Eval(context)
        bearing = math.remainder(math.atan2(self._goal.y - y, self._goal.x - x) - yaw, math.tau)
        state.set_value(np.array(self._robot.wheel_speeds(self._speed, 2.0 * bearing)))


def main() -> Trial:
    """Runs a trial of the operator with assistance."""
    scenario = load_scenario("two_obstacles")
    operator = BeelineOperator(scenario)
    trial = Simulation(scenario, learner=load_learner("two_obstacles"), operator=operator).run(
        TrialSettings()
    )
    print(trial.status, "with contact" if trial["contact"].any() else "without contact")
    return trial


if __name__ == "__main__":
    main()
