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

from drake_shared.arbitration.authority import Authority
from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing
from drake_shared.demonstrations import LOG_FORMAT, METADATA_KEY
from drake_shared.learners import Learner
from drake_shared.scenario import Goal, Scenario
from drake_shared.simulation.diagram import LOG_COLUMNS, AddSharedControl
from drake_shared.simulation.faults import Faults
from drake_shared.systems.arbiters import DEFAULT
from drake_shared.systems.confidence_blender import MODES, ConfidenceBlender
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.surrogate_operator import Behaviour, SurrogateOperator

LOG_VERSION = 1
ENDS = ("reached", "duration")
# So many can be told apart by Drake's generator.
_SEEDS = 2**32


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrialSettings:
    """What differs from trial to trial.

    Attributes:
        mode: "shared", "human" (alone) or "agent" (alone); only the arbiter "blend" has the last two.
        seed: Of the simulated operator's noise.
        route: Name of the route that the operator means; for a person, the one instructed. None: unknown.
        then: Name of the route to which a simulated operator changes at ``behaviour.switch_time``, if any.
        behaviour: Of a simulated operator.
        recording: Shape (n, 2), commands in [rad/s] for :class:`RecordedInput`.
        confidence_gain: K of eq. (1), in [1/m^2]; the learner's own if None.
        end: "reached" ends the trial at the goal, "duration" always at T.
    """

    mode: str = "shared"
    seed: int = 0
    route: str | None = None
    then: str | None = None
    behaviour: Behaviour = dataclasses.field(default_factory=Behaviour)
    recording: np.ndarray | None = None
    confidence_gain: float | None = None
    end: str = "reached"

    def __post_init__(self) -> None:
        for name, known in (("end", ENDS), ("mode", MODES)):
            if getattr(self, name) not in known:
                raise InputError(
                    "trial", name, f"must be one of {', '.join(known)}", repr(getattr(self, name))
                )
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
        operator: See :func:`drake_shared.simulation.diagram.MakeSharedControlDiagram`.
        arbiter: Who divides the control: a name or a system, see `drake_shared.systems.arbiters`.
        authority: What "blend" leaves to the human; as for
            :func:`drake_shared.simulation.diagram.MakeSharedControlDiagram`.
        look_ahead: Of the agent's controller, in [s].
        safety_clearance: Kept by a safety filter, in [m]; without one if None.
        faults: What goes wrong on purpose.
        meshcat: Shows the trials, if given.

    Raises:
        InputError: There is no arbiter of that name, or it lacks a port or has no authority to be set.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        learner: Learner | None = None,
        operator: LeafSystem | None = None,
        arbiter: LeafSystem | str = DEFAULT,
        authority: Authority | bool | None = None,
        look_ahead: float = 0.6,
        safety_clearance: float | None = None,
        faults: Faults | None = None,
        meshcat: Meshcat | None = None,
    ) -> None:
        # A second thread for products this small costs up to twenty times what it saves, and changes bits.
        threadpool_limits(1, user_api="blas")
        self.scenario = scenario
        self.learner = learner
        # In the metadata of every trial: made once, and never changed.
        self.scenario_as_data = dataclasses.asdict(scenario)
        self.look_ahead = look_ahead
        self.safety_clearance = safety_clearance
        self.faults = faults
        builder = DiagramBuilder()
        self.parts = AddSharedControl(
            builder,
            scenario=scenario,
            learner=learner,
            operator=operator,
            arbiter=arbiter,
            authority=authority,
            look_ahead=look_ahead,
            safety_clearance=safety_clearance,
            faults=faults,
            meshcat=meshcat,
        )
        self.diagram = builder.Build()
        self.diagram.set_name("shared_control")

    def begin(self, settings: TrialSettings, *, learner: Learner | None = None) -> RunningTrial:
        """Sets a fresh Context up for a trial and stands at its start.

        Args:
            settings: Of the trial.
            learner: Takes the place of the simulation's own in this trial.

        Raises:
            InputError: The settings name a route that the scenario has not, or a mode the arbiter has not.
        """
        return RunningTrial(self, settings, learner or self.learner)

    def run(self, settings: TrialSettings, *, learner: Learner | None = None) -> Trial:
        """Runs a trial to its end, as fast as the machine allows; the arguments are those of `begin`."""
        running = self.begin(settings, learner=learner)
        running.advance(self.scenario.duration)
        return running.finish()

    def describe(self, settings: TrialSettings, *, learner: Learner | None = None) -> dict[str, Any]:
        """The metadata of a trial to be run, all but its status; the arguments are those of `begin`."""
        learner = learner or self.learner
        gain = settings.confidence_gain
        if gain is None and learner is not None:
            gain = learner.confidence_gain
        operator = self.parts.operator
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
            "mode": self.mode_of(settings),
            "arbitration": self.parts.arbitration,
            "route": settings.route,
            "then": settings.then,
            "seed": settings.seed,
            "end": settings.end,
            "confidence_gain": gain,
            "look_ahead": self.look_ahead,
        }
        if self.safety_clearance is not None:
            described["safety_clearance"] = self.safety_clearance
        if self.faults is not None:
            described["faults"] = self.faults.to_json()
        if isinstance(operator, SurrogateOperator):
            described["behaviour"] = dataclasses.asdict(settings.behaviour)
        if isinstance(operator, RecordedInput) and settings.recording is not None:
            played = np.ascontiguousarray(settings.recording, dtype="<f8")
            described["recording"] = hashlib.sha256(played.tobytes()).hexdigest()[:24]
        return described

    def mode_of(self, settings: TrialSettings) -> str:
        """Who drives: an arbiter that leaves one of the two alone is that mode of the blend."""
        return getattr(self.parts.blender, "alone", None) or settings.mode


class RunningTrial:
    """A trial under way. Not made directly: :meth:`Simulation.begin` does."""

    def __init__(self, simulation: Simulation, settings: TrialSettings, learner: Learner | None) -> None:
        self.simulation = simulation
        self.settings = settings
        self.learner = learner
        scenario, parts = simulation.scenario, simulation.parts
        self._goal = scenario.goal
        self._route = None if settings.route is None else scenario.route(settings.route)
        root = simulation.diagram.CreateDefaultContext()
        # First of all: it puts every parameter back to its default.
        simulation.diagram.SetRandomContext(root, RandomGenerator(settings.seed))
        if isinstance(parts.blender, ConfidenceBlender):
            parts.blender.set_mode(parts.blender.GetMyMutableContextFromRoot(root), settings.mode)
        elif settings.mode != "shared":
            name = parts.arbitration["name"]
            raise InputError(
                "trial", "mode", f"must be shared where {name!r} divides the control", settings.mode
            )
        if learner is not None:
            parts.estimator.SetLearner(
                parts.estimator.GetMyMutableContextFromRoot(root),
                learner,
                confidence_gain=settings.confidence_gain,
                # An agent that is alone has nobody's command to go by.
                use_human_command=simulation.mode_of(settings) != "agent",
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
        if settings.end == "reached":
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
        if self.reached and (over or self.settings.end == "reached"):
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


def run_trial(scenario: Scenario, learner: Learner | None = None, **settings: Any) -> Trial:
    """Builds the diagram and runs one trial of a simulated operator; for many, keep a :class:`Simulation`.

    Args:
        scenario: The task.
        learner: Predicts intentions; the human drives alone without one.
        settings: See :class:`TrialSettings`.
    """
    return Simulation(scenario, learner=learner).run(TrialSettings(**settings))


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
