"""A copilot that is trained in Gymnasium and then divides the control as an arbiter.

Usage: python examples/copilot.py [ROUNDS]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context

import drake_shared.analysis.gym_env  # noqa: F401  (registers the environment)
from drake_shared import (
    Robot,
    SharedControlConfig,
    Simulation,
    Trial,
    TrialSettings,
    load_learner,
    load_scenario,
)
from drake_shared.systems.arbiter import Arbiter

Array = NDArray[np.float64]
HUMAN = np.array([1.0, 1.0, 0.0])
"""The gains of a copilot that passes on the human's command."""
STEP_COST = 0.02
"""Taken from the reward at every step, so that a faster drive is a better one."""


def copilot(gains: Array, human: Array, pose: Array, goal: Array) -> Array:
    """The copilot's command: the human's speed and turn, each times a gain, and a turn toward the goal.

    Args:
        gains: Of speed, turn and goal, shape (3,).
        human: Speeds of the left and the right wheel, as shares of their limits, shape (2,).
        pose: x, y and yaw in [m, m, rad].
        goal: Position in [m], shape (2,).

    Returns:
        Wheel speeds as shares of their limits, from -1 to 1, shape (2,).
    """
    speed, turn = human.mean(), 0.5 * (human[1] - human[0])
    bearing = math.atan2(goal[1] - pose[1], goal[0] - pose[0])
    speed, turn = gains[0] * speed, gains[1] * turn + gains[2] * speed * math.sin(bearing - pose[2])
    return np.clip([speed - turn, speed + turn], -1.0, 1.0)


def score(env: gymnasium.Env, gains: Array, routes: Sequence[str]) -> float:
    """Mean return of one trial along each route, always with the same seeds."""
    total = 0.0
    for seed, route in enumerate(routes):
        observation, _ = env.reset(seed=seed, options={"route": route})
        over = False
        while not over:
            pose, goal, human = observation[:3], observation[3:5], observation[5:7]
            observation, reward, terminated, truncated, _ = env.step(copilot(gains, human, pose, goal))
            total += float(reward) - STEP_COST
            over = terminated or truncated
    return total / len(routes)


def train(
    env: gymnasium.Env, routes: Sequence[str], *, rounds: int, seed: int = 1
) -> tuple[Array, list[float]]:
    """Random search: varies the best gains, and keeps what drives better. Returns gains and scores."""
    random = np.random.default_rng(seed)
    best, scores = HUMAN, [score(env, HUMAN, routes)]
    for _ in range(rounds):
        tried = best + random.normal(0.0, 0.15, 3)
        found = score(env, tried, routes)
        if found > scores[-1]:
            best = tried
        scores.append(max(found, scores[-1]))
    return best, scores


class CopilotArbiter(Arbiter):
    """The copilot's command drives; w says how near it is to the human's.

    .. pydrake_system::

        name: CopilotArbiter
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        - pose
        output_ports:
        - shared_command
        - human_weight

    Args:
        gains: See `copilot`.
        goal: Position in [m], shape (2,).
        robot: A differential drive.
        options: See :class:`Arbiter`.
    """

    def __init__(self, gains: Array, *, goal: Array, robot: Robot, **options: Any) -> None:
        super().__init__(robot=robot, optional_inputs=("pose",), **options)
        self._gains, self._goal = gains, goal
        self._limits = np.array(robot.command_limits)

    @property
    def configuration(self) -> dict[str, list[float]]:
        """The gains; kept in every log."""
        return {"gains": self._gains.tolist()}

    def DoCalcWeight(self, context: Context) -> float:
        """1 if both commands are the same, and 0 if they differ by as much as a wheel's limit."""
        human = np.nan_to_num(self.get_human_command_input_port().Eval(context))
        difference = (self._command(context, human) - human) / self._limits
        return 1.0 - min(1.0, float(np.abs(difference).max()))

    def DoCalcCommand(
        self, context: Context, weight: float, human: Sequence[float], autonomous: Sequence[float]
    ) -> Sequence[float]:
        """The copilot's command."""
        found: list[float] = self._command(context, np.nan_to_num(human)).tolist()
        return found

    def _command(self, context: Context, human: Array) -> Array:
        pose = self.GetInputPort("pose").Eval(context)
        command: Array = copilot(self._gains, human / self._limits, pose, self._goal) * self._limits
        return command


def main(rounds: int = 12) -> list[Trial]:
    """Trains a copilot, and drives each route without and with it."""
    scenario, learner = load_scenario("two_obstacles"), load_learner("two_obstacles")
    routes = [route.name for route in scenario.routes]
    # The action drives, and the human's command is what the copilot sees of the human.
    config = SharedControlConfig(driver="agent")
    env = gymnasium.make("drake_shared/SharedControl-v0", role="agent", learner=learner, config=config)
    gains, scores = train(env, routes, rounds=rounds)
    print(f"score {scores[0]:.2f} of the human alone, {scores[-1]:.2f} with gains {gains.round(2).tolist()}")
    goal = np.array(scenario.goal.position(scenario.robot.position_names))
    trials = []
    for each in (HUMAN, gains):
        arbiter = CopilotArbiter(each, goal=goal, robot=scenario.robot, period=scenario.control_period)
        simulation = Simulation(scenario, learner=learner, arbiter=arbiter)
        trials += [simulation.run(TrialSettings(route=name, seed=9)) for name in routes]
    for trial in trials:
        print(trial.metadata["route"], trial.status, f"after {trial['t'][-1]:.2f} s")
    return trials


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
