"""Shared control as a Gymnasium environment; needs the extra ``gym``.

Importing this module registers ``drake_shared/SharedControl-v0``. It runs trials as `Simulation` does, whose
seeds, routes and learners `pydrake.gym.DrakeGymEnv` could not set.
"""

from __future__ import annotations

from typing import Any, Literal

import gymnasium
import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_shared.common.errors import InputError
from drake_shared.learners import Learner, load_learner
from drake_shared.robots import Robot
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import RunningTrial, Simulation, TrialSettings
from drake_shared.systems.intention import empty_intention
from drake_shared.systems.recorded_input import RecordedInput

NAME = "drake_shared/SharedControl-v0"
Array = NDArray[np.float32]
_FARTHEST = 100.0  # Bound of all observations: Gymnasium wants finite ones.


class AgentCommand(LeafSystem):
    """Outputs a command that its Context holds as a parameter, in place of a controller.

    .. pydrake_system::

        name: AgentCommand
        input_ports:
        - pose
        - intention
        output_ports:
        - autonomous_command

    Args:
        robot: Gives the sizes of pose and command.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self.set_name("agent_command")
        size = len(robot.command_names)
        self.DeclareVectorInputPort("pose", len(robot.configuration_names))
        self.DeclareAbstractInputPort("intention", Value(empty_intention(len(robot.position_names))))
        self._index = self.DeclareNumericParameter(BasicVector(size))
        self.DeclareVectorOutputPort(
            "autonomous_command", size, self._calc, prerequisites_of_calc={self.all_parameters_ticket()}
        )

    def SetCommand(self, context: Context, command: NDArray[np.float64]) -> None:
        """Sets the command (M,) in the robot's units."""
        context.get_mutable_numeric_parameter(self._index).SetFromVector(command)

    def _calc(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_numeric_parameter(self._index).value())


class SharedControlEnv(gymnasium.Env[Array, Array]):
    """A trial of shared control, in which the action is the command of the human or of the agent.

    The action (M,) is a share of the command's limits, from -1 to 1. The observation (C + D + 2M + 3,) is the
    robot's configuration, the goal's position in [m], human and autonomous command as shares of their limits,
    confidence, human weight, and the share of the time that is over. The reward is the progress toward the
    goal in [m], 1 more at the goal and 1 less for a contact, which ends the episode.

    Args:
        scenario: File or name.
        role: Whose command the action is. The other one is a simulated operator, or the usual agent.
        learner: Of the agent; None: without one, which role "agent" does not allow, or by name or file.
        config: How control is shared.

    Raises:
        InputError: Role "agent" has no learner.
    """

    def __init__(
        self,
        scenario: str = "two_obstacles",
        *,
        role: Literal["human", "agent"] = "human",
        learner: str | Learner | None = "two_obstacles",
        config: SharedControlConfig | None = None,
        render_mode: None = None,
    ) -> None:
        task = load_scenario(scenario)
        found = load_learner(learner) if isinstance(learner, str) else learner
        if role == "agent" and found is None:
            raise InputError(NAME, "learner", "must be given where the action is the agent's command")
        self.render_mode = render_mode
        self._role = role
        self._system: Any = RecordedInput(robot=task.robot, period=task.control_period)
        parts: dict[str, Any] = {"operator": self._system}
        if role == "agent":
            self._system = AgentCommand(task.robot)
            parts = {"controller": self._system}
        self._simulation = Simulation(task, learner=found, config=config, **parts)
        robot = task.robot
        self._limits = np.array(robot.command_limits, dtype=float)
        self._goal = np.array(task.goal.position(robot.position_names))
        self._running: RunningTrial | None = None
        size = len(robot.configuration_names) + len(self._goal) + 2 * len(self._limits) + 3
        self.observation_space = gymnasium.spaces.Box(-_FARTHEST, _FARTHEST, (size,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, self._limits.shape, np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begins a trial on a random route, or on the route that ``options`` name."""
        super().reset(seed=seed)
        routes = [route.name for route in self._simulation.scenario.routes]
        route = (options or {}).get("route", routes[int(self.np_random.integers(len(routes)))])
        settings = TrialSettings(route=route, seed=int(self.np_random.integers(2**32)))
        self._running = self._simulation.begin(settings)
        return self._observe(), {"route": route}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Applies the action for one control period."""
        running = self._running
        if running is None:
            raise RuntimeError("reset must be called first")
        command = np.clip(np.asarray(action, dtype=float), -1.0, 1.0) * self._limits
        own = self._system.GetMyMutableContextFromRoot(running.root)
        if self._role == "agent":
            self._system.SetCommand(own, command)
        else:
            self._system.SetRecording(own, np.tile(command, (self._simulation.scenario.steps + 2, 1)))
        before = self._distance()
        period = self._simulation.scenario.control_period
        running.advance(round(running.time / period + 1) * period)
        row = running.rows(-1)
        contact = bool(row["contact"][-1])
        reward = before - self._distance() + float(running.reached) - float(contact)
        over = running.status == "timed_out"
        return self._observe(), reward, running.reached or contact, over, {"contact": contact}

    def _distance(self) -> float:
        return float(np.linalg.norm(self._last(self._simulation.robot.position_names) - self._goal))

    def _last(self, names: Any) -> NDArray[np.float64]:
        assert self._running is not None
        row = self._running.rows(-1)
        return np.array([float(row[name][-1]) for name in names])

    def _observe(self) -> Array:
        assert self._running is not None
        robot = self._simulation.robot
        human, autonomous = (
            self._last([f"{who}_{name}" for name in robot.command_names]) / self._limits
            for who in ("human", "autonomous")
        )
        measures = self._last(("confidence", "human_weight"))
        share = self._running.time / self._simulation.scenario.duration
        parts = (self._last(robot.configuration_names), self._goal, human, autonomous, measures, [share])
        values = np.clip(np.nan_to_num(np.concatenate(parts)), -_FARTHEST, _FARTHEST)
        observation: Array = values.astype(np.float32)
        return observation


gymnasium.register(NAME, entry_point=f"{__name__}:SharedControlEnv")
