"""A custom operator: somebody who drives a route with the arrow keys, which are pressed or not.

Usage: python examples/keyboard_operator.py

`drake_shared.systems.operators` is the contract. A package registers `make_operator` in the entry point group
drake_shared.operators; Python code passes a system.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_shared import Scenario, Simulation, TrialSettings, load_learner, load_scenario, metrics
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate


class KeyboardOperator(LeafSystem):
    """Drives forward along the first route, and presses left or right when the robot points elsewhere.

    .. pydrake_system::

        name: KeyboardOperator
        input_ports:
        - pose
        output_ports:
        - human_command
        - keys

    Ports:
        pose (3): [x, y, yaw] in [m, m, rad], world frame.
        human_command (2): Wheel speeds in [rad/s]. State, as the contract requires.
        keys (2): 1, 0 or -1 for forward and for left or right, for the log. State.
    """

    log_columns: ClassVar[dict[str, tuple[str, ...]]] = {"keys": ("key_forward", "key_left")}

    def __init__(self, scenario: Scenario, period: float) -> None:
        super().__init__()
        self._robot = scenario.robot
        self._path = scenario.path_of(scenario.routes[0])
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._command_index = self.DeclareDiscreteState(2)
        self._keys_index = self.DeclareDiscreteState(2)
        self.DeclareStateOutputPort("human_command", self._command_index)
        self.DeclareStateOutputPort("keys", self._keys_index)
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        x, y, yaw = self._pose_port.Eval(context).tolist()
        reached = self._path.nearest(x, y, between=(0.0, self._path.length))
        target_x, target_y = self._path.position(np.array([reached + 0.5]))[0]
        bearing = math.remainder(math.atan2(target_y - y, target_x - x) - yaw, math.tau)
        left = 0.0 if abs(bearing) < 0.1 else math.copysign(1.0, bearing)
        command = self._robot.stick_command(1.0, left, max_speed=0.5, max_yaw_rate=1.0)
        state.set_value(self._command_index, command)
        state.set_value(self._keys_index, [1.0, left])


def make_operator(*, scenario: Scenario, source: Any, period: float) -> LeafSystem:
    """The entry point. ``source`` is the page's input, which a simulated operator does not need."""
    return KeyboardOperator(scenario, period)


def main() -> dict[str, Any]:
    """Drives the shipped task alone and with help."""
    scenario = load_scenario("two_obstacles")
    learner = load_learner("two_obstacles")
    operator = make_operator(scenario=scenario, source=None, period=scenario.control_period)
    simulation = Simulation(scenario, learner=learner, operator=operator)
    results = {}
    for driver in ("human", "shared"):
        trial = simulation.run(TrialSettings(driver=driver))
        results[driver] = dict(metrics(trial))
        pressed = np.abs(trial["key_left"]).mean()
        print(f"{driver}: {trial.status}, left or right pressed {pressed:.0%} of the time")
    return results


if __name__ == "__main__":
    main()
