"""One run of the loop, its log, and the file of it."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import importlib.metadata
import json
import math
import os
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pydrake.common import RandomGenerator
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, EventStatus, LeafSystem
from pydrake.systems.primitives import VectorLog
from threadpoolctl import threadpool_limits

from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing
from drake_shared.demonstrations import LOG_FORMAT, METADATA_KEY
from drake_shared.learners import Learner
from drake_shared.scenario import Goal, Scenario
from drake_shared.simulation.config import DRIVERS, SharedControlConfig
from drake_shared.simulation.diagram import LOG_COLUMNS, AddSharedControl
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.surrogate_operator import Behaviour, SurrogateOperator

LOG_VERSION = 1
# So many can be told apart by Drake's generator.
_SEEDS = 2**32


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrialSettings:
    """What differs from trial to trial.

    Attributes:
        driver: "shared", "human" or "agent"; the config's if None.
        seed: Of the simulated operator's noise.
        route: Name of the route that the operator means; for a person, the one instructed. None: unknown.
        then: Name of the route to which a simulated operator changes at ``behaviour.switch_time``, if any.
        behaviour: Of a simulated operator.
        recording: Shape (n, 2), commands in [rad/s] for :class:`RecordedInput`.
        confidence_gain: K of eq. (1), in [1/m^2]; the config's if None.

    Raises:
        InputError: A value is out of range.
    """

    driver: str | None = None
    seed: int = 0
    route: str | None = None
    then: str | None = None
    behaviour: Behaviour = dataclasses.field(default_factory=Behaviour)
    recording: np.ndarray | None = None
    confidence_gain: float | None = None

    def __post_init__(self) -> None:
        if self.driver not in (None, *DRIVERS):
            raise InputError("trial", "driver", f"must be one of {', '.join(DRIVERS)}", repr(self.driver))
        if not 0 <= self.seed < _SEEDS:
            raise InputError("trial", "seed", f"must be from 0 to {_SEEDS - 1}", self.seed)
        gain = self.confidence_gain
        if gain is not None and not (math.isfinite(gain) and gain > 0):
            raise InputError("trial", "confidence_gain", "must be positive and finite", gain)


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """What happened in a trial.

    Attributes:
        columns: Each name of the log to an array (n,); row k holds what is applied from t_k to t_k+1, its
            ``contact`` is of the step that led to it, and the last row is not applied.
        metadata: Scenario, learner, operator, seed, status and every setting that matters, as JSON holds it.
    """

    columns: Mapping[str, np.ndarray]
    metadata: Mapping[str, Any]

    def __getitem__(self, column: str) -> np.ndarray:
        return self.columns[column]

    @property
    def status(self) -> str:
        """How it ended: "reached", "timed_out", or why it was broken off."""
        return self.metadata["status"]

    @property
    def positions(self) -> np.ndarray:
        """Shape (n, 2), in [m], world frame."""
        return np.stack([self["x"], self["y"]], axis=-1)

    def commands(self, who: str) -> np.ndarray:
        """Shape (n, 2), wheel speeds in [rad/s]: "human", "autonomous", "shared" or (if logged) "safe"."""
        return np.stack([self[f"{who}_left"], self[f"{who}_right"]], axis=-1)


class Simulation:
    """The diagram, built once in a process, and the trials that are run in it.

    Args:
        scenario: The task.
        learner: Predicts intentions; the human drives alone without one.
        config: How control is shared; if None, the one that the learner's preset names.
        operator, arbiter, controller, plant, meshcat: See
            :func:`drake_shared.simulation.diagram.MakeSharedControlDiagram`.

    Raises:
        InputError: There is no arbiter of that name; a system lacks a port, or has an input that nothing
            connects.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        learner: Learner | None = None,
        config: SharedControlConfig | None = None,
        operator: LeafSystem | None = None,
        arbiter: LeafSystem | None = None,
        controller: LeafSystem | None = None,
        plant: LeafSystem | None = None,
        meshcat: Meshcat | None = None,
    ) -> None:
        # A second thread for products this small costs up to twenty times what it saves, and changes bits.
        threadpool_limits(1, user_api="blas")
        self.scenario = scenario
        self.learner = learner
        # In the metadata of every trial: made once, and never changed.
        self.scenario_as_data = dataclasses.asdict(scenario)
        builder = DiagramBuilder()
        self.parts = AddSharedControl(
            builder,
            scenario=scenario,
            config=config,
            learner=learner,
            operator=operator,
            arbiter=arbiter,
            controller=controller,
            plant=plant,
            meshcat=meshcat,
        )
        self.config = self.parts.config
        self.diagram = builder.Build()
        self.diagram.set_name("shared_control")

    def begin(
        self, settings: TrialSettings, *, learner: Learner | None = None, ends_at_goal: bool = True
    ) -> RunningTrial:
        """Sets up a fresh Context for a trial and stands at its start.

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
        """The metadata of a trial to be run, all but its status; the arguments are those of `begin`."""
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
            "learner": None if learner is None else learner.name,
            "learner_id": None if learner is None else learner.metadata.get("id"),
            "learner_file": None if learner is None else learner.metadata.get("file"),
            "preset": None if learner is None else learner.preset,
            "operator": type(operator).__name__,
            "config": config.to_json(),
            "mode": self.driver_of(settings, learner),
            "arbitration": self.parts.arbitration,
            "route": settings.route,
            "then": settings.then,
            "seed": settings.seed,
            "end": config.end,
            "confidence_gain": gain,
            "look_ahead": config.look_ahead,
        }
        if config.safety_clearance is not None:
            described["safety_clearance"] = config.safety_clearance
        if config.faults:
            described["faults"] = config.faults.to_json()
        if isinstance(operator, SurrogateOperator):
            described["behaviour"] = dataclasses.asdict(settings.behaviour)
        if isinstance(operator, RecordedInput) and settings.recording is not None:
            played = np.ascontiguousarray(settings.recording, dtype="<f8")
            described["recording"] = hashlib.sha256(played.tobytes()).hexdigest()[:24]
        return described

    def _confidence_gain(self, settings: TrialSettings) -> float | None:
        return self.config.confidence_gain if settings.confidence_gain is None else settings.confidence_gain


class RunningTrial:
    """A trial under way. Not made directly: :meth:`Simulation.begin` does."""

    def __init__(
        self, simulation: Simulation, settings: TrialSettings, learner: Learner | None, *, ends_at_goal: bool
    ) -> None:
        self.simulation = simulation
        self.settings = settings
        self.learner = learner
        scenario, parts = simulation.scenario, simulation.parts
        self._goal = scenario.goal
        self._ends_at_goal = ends_at_goal and simulation.config.end == "reached"
        self._route = None if settings.route is None else scenario.route(settings.route)
        root = simulation.diagram.CreateDefaultContext()
        # First of all: it puts every parameter back to its default.
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
        own = parts.operator.GetMyMutableContextFromRoot(root)
        if isinstance(parts.operator, SurrogateOperator):
            route = self._route or scenario.routes[0]
            then = None if settings.then is None else scenario.route(settings.then)
            parts.operator.SetBehaviour(own, route=route, then=then, behaviour=settings.behaviour)
        elif isinstance(parts.operator, RecordedInput) and settings.recording is not None:
            parts.operator.SetRecording(own, settings.recording)
        self.simulator = Simulator(simulation.diagram, root)
        self.root = root
        self._log = parts.log_sink.FindLog(root)
        if self._ends_at_goal:
            # Not a method of this object: it owns the Simulator, and Python cannot see that cycle to free it.
            self.simulator.set_monitor(_goal_monitor(simulation.diagram, self._log, self._goal))
        self.simulator.Initialize()

    @property
    def time(self) -> float:
        """Since the start of the trial, in [s]."""
        return self.root.get_time()

    @property
    def reached(self) -> bool:
        """Whether the robot is at the goal, by the last row of the log.

        The pose itself will not do: an operator with a period of its own makes steps between the rows, at
        which it is already that of the row to come, and the log would end before its robot is there.
        """
        return _at_goal(self._log, self._goal)

    @property
    def status(self) -> str | None:
        """ "reached" or "timed_out" once the trial is over, else None."""
        over = self.time >= self.simulation.scenario.duration - 1e-9
        if self.reached and (over or self._ends_at_goal):
            return "reached"
        return "timed_out" if over else None

    def advance(self, time: float) -> None:
        """Runs on until ``time``, in [s] from the start, or to the end of the trial if that comes first."""
        if self.status is None:
            self.simulator.AdvanceTo(min(time, self.simulation.scenario.duration))

    def finish(self, status: str | None = None, **metadata: Any) -> Trial:
        """What happened so far, as a trial that ended in ``status``.

        Args:
            status: How it ended, if not by itself.
            metadata: What else there is to say of it.
        """
        parts = self.simulation.parts
        columns = {"t": self._log.sample_times().copy()}
        columns |= dict(zip(parts.columns, self._log.data().copy(), strict=True))
        columns["contact"] = columns["contact"] > 0.5
        described = self.simulation.describe(self.settings, learner=self.learner) | metadata
        return Trial(columns=columns, metadata=described | {"status": status or self.status or "stopped"})


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


def settings_of_log(trial: Trial) -> TrialSettings:
    """The settings with which a logged trial was run, without a recording.

    With `drake_shared.simulation.config.config_of_log`, scenario and learner they give the same trial again.

    Raises:
        InputError: The log's metadata hold no valid settings.
    """
    metadata = trial.metadata
    behaviour = metadata.get("behaviour", {})
    try:
        return TrialSettings(
            driver=metadata["mode"],
            seed=metadata.get("seed", 0),
            route=metadata.get("route"),
            then=metadata.get("then"),
            behaviour=Behaviour(**behaviour),
            confidence_gain=metadata.get("confidence_gain"),
        )
    except (KeyError, TypeError) as error:
        raise InputError("the log", "metadata", f"must hold the settings of a trial ({error})") from error


def write_log(trial: Trial, path: str | os.PathLike[str]) -> None:
    """Writes a trial as Parquet, whole or not at all.

    Raises:
        InputError: The folder cannot be written to.
    """
    table = pa.table(dict(trial.columns))
    table = table.replace_schema_metadata({METADATA_KEY: json.dumps(dict(trial.metadata))})
    with replacing(path) as temporary:
        pq.write_table(table, temporary)


def read_log(path: str | os.PathLike[str]) -> Trial:
    """Reads a trial back.

    Raises:
        InputError: The file is missing, is no log, is of another version, or is not what a log must be.
    """
    if not os.path.isfile(path):
        raise InputError(path, "", "must be a log; there is no such file")
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise InputError(path, "", "cannot be read as a log") from error
    try:
        metadata = json.loads((table.schema.metadata or {}).get(METADATA_KEY, b"null"))
    except ValueError as error:
        raise InputError(path, "metadata", "must be JSON") from error
    if not isinstance(metadata, dict) or metadata.get("format") != LOG_FORMAT:
        raise InputError(path, "format", f"must be {LOG_FORMAT!r}")
    if metadata.get("version") != LOG_VERSION:
        raise InputError(path, "version", f"must be {LOG_VERSION}", metadata.get("version"))
    missing = [name for name in ("t", *LOG_COLUMNS) if name not in table.column_names]
    if missing:
        raise InputError(path, "columns", f"must include {', '.join(missing)}")
    if not table.num_rows:
        raise InputError(path, "", "must hold at least one row")
    columns = {name: table[name].to_numpy() for name in table.column_names}
    for name in ("t", *LOG_COLUMNS):
        if columns[name].dtype.kind not in "bif":
            raise InputError(path, name, "must hold numbers", table.schema.field(name).type)
    if not (np.diff(columns["t"]) > 0).all():
        raise InputError(path, "t", "must increase")
    _check_metadata(metadata, path)
    return Trial(columns=columns, metadata=metadata)


def _check_metadata(metadata: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """What the measures of a trial rely on is there."""
    scenario = metadata.get("scenario")
    parts = {"name": str, "goal": dict, "robot": dict, "obstacles": list, "routes": list}
    if not isinstance(scenario, dict) or not all(isinstance(scenario.get(k), v) for k, v in parts.items()):
        raise InputError(path, "scenario", f"must be an object with {', '.join(parts)}")
    if not isinstance(metadata.get("status"), str):
        raise InputError(path, "status", "must be given", metadata.get("status"))
    names = [route.get("name") for route in scenario["routes"]]
    for field in ("route", "then"):
        if metadata.get(field) not in (None, *names):
            raise InputError(path, field, f"must be one of {', '.join(names)}", repr(metadata[field]))


def _at_goal(log: VectorLog, goal: Goal) -> bool:
    x, y = log.data()[:2, -1].tolist()
    return math.hypot(x - goal.x, y - goal.y) <= goal.radius


def _goal_monitor(diagram: Diagram, log: VectorLog, goal: Goal) -> Callable[[Context], EventStatus]:
    def stop_at_goal(_: Context) -> EventStatus:
        if _at_goal(log, goal):
            return EventStatus.ReachedTermination(diagram, "the goal is reached")
        return EventStatus.DidNothing()

    return stop_at_goal


@functools.cache
def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"
