"""Builds the diagram of a shared-control loop and runs trials in it."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import importlib.metadata
import math
from collections.abc import Callable
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, EventStatus
from pydrake.systems.primitives import VectorLog

from drake_shared.common.threads import limit_blas
from drake_shared.demonstrations import LOG_FORMAT
from drake_shared.demonstrations.log_table import LOG_VERSION
from drake_shared.learners import Learner
from drake_shared.operators.behaviour import behaviour_for
from drake_shared.robots import describe_robot
from drake_shared.scenario import Scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.diagram import AddSharedControl
from drake_shared.simulation.log import Trial, log_columns, read_log, write_log
from drake_shared.simulation.settings import TrialSettings, settings_of_log
from drake_shared.simulation.shared_control import SharedControl
from drake_shared.simulation.wiring import Systems
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.failure import reraise
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.surrogate_operator import Behaviour, SurrogateOperator
from drake_shared.systems.tip_operator import TipOperator

__all__ = [
    "Behaviour",
    "RunningTrial",
    "Simulation",
    "Trial",
    "TrialSettings",
    "log_columns",
    "read_log",
    "run_trial",
    "settings_of_log",
    "write_log",
]


class Simulation:
    """A diagram that is built once in a process, and runs any number of trials.

    Args:
        scenario: The task.
        learner: Predicts intentions; the human drives alone without one.
        config: How control is shared; if None, the one that the learner's preset names.
        operator, arbiter, controller, plant, robot, meshcat, show_intention: See
            :func:`drake_shared.simulation.diagram.MakeSharedControlDiagram`.

    Raises:
        InputError: There is no arbiter of that name; a system lacks a port, or has an input that nothing
            connects.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        config: SharedControlConfig | None = None,
        **systems: Unpack[Systems],
    ) -> None:
        # A second thread makes matrix products this small up to twenty times slower, and changes bits.
        limit_blas()
        self.scenario = scenario
        self.learner = systems.get("learner")
        # Part of the metadata of every trial.
        self.scenario_as_data = dataclasses.asdict(scenario)
        builder = DiagramBuilder()
        self.parts = AddSharedControl(builder, scenario=scenario, config=config, **systems)
        self.robot = self.parts.robot
        self.robot_as_data = describe_robot(self.robot).to_json()
        self.config = config = self.parts.config
        # What the metadata of all trials state of it.
        self._config_as_data = config.to_json()
        self._optional_data: dict[str, Any] = {}
        if config.safety_clearance is not None:
            self._optional_data["safety_clearance"] = config.safety_clearance
        if config.faults:
            self._optional_data["faults"] = config.faults.to_json()
        self.parts.check_inputs(builder)
        self.diagram = builder.Build()
        self.diagram.set_name("shared_control")

    def begin(
        self, settings: TrialSettings, *, learner: Learner | None = None, ends_at_goal: bool = True
    ) -> RunningTrial:
        """Sets up a fresh Context for a trial, at its start.

        Args:
            settings: Of the trial.
            learner: Replaces the simulation's own in this trial.
            ends_at_goal: False leaves it to the caller to end the trial at the goal.

        Raises:
            InputError: The settings name a route that the scenario does not have.
        """
        return RunningTrial(self, settings, learner or self.learner, ends_at_goal=ends_at_goal)

    def run(self, settings: TrialSettings, *, learner: Learner | None = None) -> Trial:
        """Runs a trial to its end, as fast as the machine allows; the arguments are those of `begin`."""
        running = self.begin(settings, learner=learner)
        running.advance(self.scenario.duration)
        return running.finish()

    def driver_of(self, settings: TrialSettings, learner: Learner | None) -> str:
        """Who drives in a trial with ``learner``."""
        return "human" if learner is None else settings.driver or self.config.driver

    def describe(self, settings: TrialSettings, *, learner: Learner | None = None) -> dict[str, Any]:
        """The metadata of a trial, without its status; the arguments are those of `begin`."""
        learner = learner or self.learner
        config, operator = self.config, self.parts.operator
        gain = self._confidence_gain(settings)
        if gain is None and learner is not None:
            gain = learner.confidence_gain
        described: dict[str, Any] = {
            "format": LOG_FORMAT,
            "version": LOG_VERSION,
            "software": {"drake_shared": _version("drake_shared"), "drake": _version("drake")},
            "scenario": self.scenario_as_data,
            "robot": self.robot_as_data,
            "learner": None if learner is None else learner.name,
            "learner_id": None if learner is None else learner.metadata.get("id"),
            "learner_file": None if learner is None else learner.metadata.get("file"),
            "preset": None if learner is None else learner.preset,
            "operator": type(operator).__name__,
            "config": self._config_as_data,
            "mode": self.driver_of(settings, learner),
            "arbitration": self.parts.arbitration,
            "route": settings.route,
            "then": settings.then,
            "seed": settings.seed,
            "end": config.end,
            "confidence_gain": gain,
            "look_ahead": config.look_ahead,
            **self._optional_data,
        }
        if isinstance(operator, SurrogateOperator | TipOperator):
            described["behaviour"] = dataclasses.asdict(behaviour_for(self.robot, settings.behaviour))
        if isinstance(operator, RecordedInput) and settings.recording is not None:
            played = np.ascontiguousarray(settings.recording, dtype="<f8")
            described["recording"] = hashlib.sha256(played.tobytes()).hexdigest()[:24]
        return described

    def _confidence_gain(self, settings: TrialSettings) -> float | None:
        return self.config.confidence_gain if settings.confidence_gain is None else settings.confidence_gain


class RunningTrial:
    """A trial that has begun; :meth:`Simulation.begin` makes it."""

    def __init__(
        self, simulation: Simulation, settings: TrialSettings, learner: Learner | None, *, ends_at_goal: bool
    ) -> None:
        self.simulation = simulation
        self.settings = settings
        self.learner = learner
        scenario, parts = simulation.scenario, simulation.parts
        self._ends_at_goal = ends_at_goal and simulation.config.end == "reached"
        self._route = None if settings.route is None else scenario.route(settings.route)
        root = simulation.diagram.CreateDefaultContext()
        # This resets every parameter to its default, and so comes first.
        simulation.diagram.SetRandomContext(root, RandomGenerator(settings.seed))
        self.driver = simulation.driver_of(settings, learner)
        parts.SetDriver(root, self.driver)
        if learner is not None:
            parts.estimator.SetLearner(
                parts.estimator.GetMyMutableContextFromRoot(root),
                learner,
                confidence_gain=simulation._confidence_gain(settings),
                # The agent alone takes no account of the human's command.
                use_human_command=self.driver != "agent",
            )
            if isinstance(parts.arbiter, Arbiter):
                parts.arbiter.SetLearner(parts.arbiter.GetMyMutableContextFromRoot(root), learner)
        own = parts.operator.GetMyMutableContextFromRoot(root)
        if isinstance(parts.operator, SurrogateOperator | TipOperator):
            route = self._route or scenario.routes[0]
            then = None if settings.then is None else scenario.route(settings.then)
            behaviour = behaviour_for(simulation.robot, settings.behaviour)
            parts.operator.SetBehaviour(own, route=route, then=then, behaviour=behaviour)
        elif isinstance(parts.operator, RecordedInput) and settings.recording is not None:
            parts.operator.SetRecording(own, settings.recording)
        self.simulator = Simulator(simulation.diagram, root)
        self.root = root
        self._log = parts.log_sink.FindLog(root)
        self._is_at_goal = _goal_check(scenario, parts, self._log)
        if self._ends_at_goal:
            # A method of this object, which owns the Simulator, would make a cycle that Python cannot free.
            self.simulator.set_monitor(_goal_monitor(simulation.diagram, self._is_at_goal))
        self.simulator.Initialize()

    @property
    def time(self) -> float:
        """Since the start of the trial, in [s]."""
        time: float = self.root.get_time()
        return time

    @property
    def reached(self) -> bool:
        """Whether the robot is at a goal, by the last row of the log.

        An operator with a period of its own makes steps between the rows, at which the pose is already that
        of the next row: by the pose the log would end before its robot arrives.
        """
        return self._is_at_goal()

    @property
    def status(self) -> str | None:
        """ "reached" or "timed_out" once the trial is over, else None."""
        over = self.time >= self.simulation.scenario.duration - 1e-9
        if self.reached and (over or self._ends_at_goal):
            return "reached"
        return "timed_out" if over else None

    def advance(self, time: float) -> None:
        """Runs until ``time``, in [s] from the start, or to the end of the trial if that comes first.

        Raises:
            RunError: A system from outside this package raises an exception or breaks its contract; it names
                the system and the time.
        """
        if self.status is not None:
            return
        try:
            self.simulator.AdvanceTo(min(time, self.simulation.scenario.duration))
        except Exception as error:  # Systems from outside this package may raise anything.
            reraise(error, self.time)

    def finish(self, status: str | None = None, **metadata: Any) -> Trial:
        """The log so far, as a trial that ended with ``status``.

        Args:
            status: "reached", "timed_out" or "stopped" if None.
            metadata: Further metadata.
        """
        described = self.describe() | metadata
        return Trial(columns=self.rows(), metadata=described | {"status": status or self.status or "stopped"})

    def describe(self) -> dict[str, Any]:
        """The metadata of the trial, without its status."""
        return self.simulation.describe(self.settings, learner=self.learner)

    def rows(self, first: int = 0) -> dict[str, NDArray[Any]]:
        """The columns of the log so far, from row ``first`` on."""
        columns: dict[str, NDArray[Any]] = {"t": self._log.sample_times()[first:].copy()}
        values = self._log.data()[:, first:].copy()
        columns |= dict(zip(self.simulation.parts.columns, values, strict=True))
        columns["contact"] = columns["contact"] > 0.5
        return columns


def run_trial(
    scenario: Scenario,
    learner: Learner | None = None,
    *,
    config: SharedControlConfig | None = None,
    **settings: Any,
) -> Trial:
    """Builds the diagram and runs one trial of a simulated operator; for many, keep a :class:`Simulation`.

    Args:
        scenario: The task.
        learner: Predicts intentions; the human drives alone without one.
        config: How control is shared; if None, the one that the learner's preset names.
        settings: See :class:`TrialSettings`.
    """
    return Simulation(scenario, learner=learner, config=config).run(TrialSettings(**settings))


def _goal_check(scenario: Scenario, parts: SharedControl, log: VectorLog) -> Callable[[], bool]:
    """A function that tells whether the last row of ``log`` is at a goal."""
    names = parts.robot.position_names
    rows = [parts.columns.index(name) for name in names]
    goals = [(goal.position(names), goal.radius) for goal in scenario.all_goals]

    def is_at_goal() -> bool:
        last = log.data()[:, -1].tolist()
        position = [last[row] for row in rows]
        return any(math.dist(position, goal) <= radius for goal, radius in goals)

    return is_at_goal


def _goal_monitor(diagram: Diagram, is_at_goal: Callable[[], bool]) -> Callable[[Context], EventStatus]:
    def stop_at_goal(_: Context) -> EventStatus:
        if is_at_goal():
            return EventStatus.ReachedTermination(diagram, "the goal is reached")
        return EventStatus.DidNothing()

    return stop_at_goal


@functools.cache
def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"
