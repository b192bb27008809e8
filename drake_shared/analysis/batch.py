"""Batches of trials without a page, in one process or several, with the same bits whatever their number."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem

from drake_shared.analysis.log_folder import (
    LogStore,
    log_path,
    open_log_folder,
    rows_of,
    write_log_of_batch,
)
from drake_shared.common.errors import InputError
from drake_shared.common.memory import available_memory
from drake_shared.learners import load_learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.named import changes_of_route
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.lockstep.engine import BLOCK, Lockstep
from drake_shared.simulation.lockstep.support import ENGINES, reason_for_drake
from drake_shared.simulation.runner import Task, run_as_completed
from drake_shared.simulation.runner.tasks import canonical
from drake_shared.simulation.trial import Simulation, TrialSettings, read_log
from drake_shared.systems.operators import make_operator
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.robots import make_robot

MOST_PER_LOG = BLOCK
"""Most trials in one log."""

# Of a process that has loaded Drake, and of the metrics of a trial, in bytes.
_PROCESS_MEMORY, _ROW_MEMORY = 300_000_000, 5_000


@dataclasses.dataclass(frozen=True, kw_only=True)
class Batch:
    """Trials to run, as plain data that can be sent to another process.

    Attributes:
        scenario: File or name; see :func:`drake_shared.scenario.load_scenario`.
        model: File of the learner; without one the human drives alone.
        count: Number of trials. They alternate between the routes of the scenario.
        seed: Of the first trial; each later one has the next seed.
        config: How control is shared; if None, the config of the learner's preset.
        behaviour: Of the simulated operator.
        switching: Whether the operator changes to another route at ``behaviour.switch_time``; then the trials
            alternate between the possible changes, see `drake_shared.operators.named.changes_of_route`.
        recording: A log whose human commands are played back in place of a simulated operator.
        operator: Name of a registered operator that drives instead; no route is instructed then.
        robot: Name of a registered robot in place of the scenario's.
        out: Folder for the logs; none are written if None.
        trials_per_log: Most trials in one log, from 1 to `MOST_PER_LOG`. A file of several is written many
            times as fast for each, and is read like any log: ``FILE#3`` names its trial 3.
        engine: "drake" runs a diagram for each trial, "lockstep" all trials together, as arrays; "auto" takes
            the latter wherever it can run the trials. Their results agree within rounding.

    Raises:
        InputError: ``count`` or ``trials_per_log`` is out of range, or ``engine`` is unknown.
    """

    scenario: str | None = None
    model: str | None = None
    count: int = 1
    seed: int = 0
    config: SharedControlConfig | None = None
    behaviour: Behaviour = dataclasses.field(default_factory=Behaviour)
    switching: bool = False
    recording: str | None = None
    operator: str | None = None
    robot: str | None = None
    out: str | None = None
    trials_per_log: int = 1
    engine: str = "auto"

    def __post_init__(self) -> None:
        if self.count < 1:
            raise InputError("simulate", "trials", "must be at least 1", self.count)
        if not 1 <= self.trials_per_log <= MOST_PER_LOG:
            expected = f"must be from 1 to {MOST_PER_LOG}"
            raise InputError("simulate", "trials_per_log", expected, self.trials_per_log)
        if self.engine not in ENGINES:
            raise InputError("simulate", "engine", f"must be one of {', '.join(ENGINES)}", repr(self.engine))

    def to_json(self) -> dict[str, Any]:
        """All fields as plain values."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, fields: dict[str, Any]) -> Batch:
        """The inverse of `to_json`."""
        config = fields["config"]
        return cls(
            **fields
            | {
                "config": None if config is None else SharedControlConfig.from_json(config),
                "behaviour": Behaviour(**fields["behaviour"]),
            }
        )


def run_batch(
    batch: Batch,
    *,
    workers: int = 1,
    resume: bool = False,
    force: bool = False,
    inform: Callable[[str], None] | None = None,
) -> Iterator[dict[str, Any]]:
    """Runs the trials and yields the metrics of each, in order, with its seed, route and log.

    Args:
        batch: What to run.
        workers: Number of processes; 1 runs in this one.
        resume: Take the trials whose logs are in ``batch.out`` from there, and run the others.
        force: Overwrite the logs in ``batch.out``.
        inform: Receives a line about the engine that runs the trials, and why.

    Raises:
        InputError: There is too little memory for trials in lock-step; a file cannot be read, or the folder
            for logs cannot be written to, holds logs of trials and neither option is set, or holds logs of
            another configuration; or the lock-step engine is required and cannot run the trials.
        RunError: A log cannot be written, or a worker process died; the logs before it are kept.
    """
    if workers < 1:
        raise InputError("simulate", "workers", "must be at least 1", workers)
    # The files that the batch names may have changed since the last one.
    _trials.cache_clear()
    given = batch.to_json()
    reason = _trials(canonical(given)).reason_for_drake
    if inform is not None:
        inform("engine: lock-step" if reason is None else f"engine: Drake, since {reason}")
    if reason is None:
        _check_memory(_trials(canonical(given)).memory() + _ROW_MEMORY * batch.count, workers)
    store = None
    if batch.out is not None:
        store = _open_store(batch, batch.out, resume=resume, force=force)
    elif resume or force:
        option = "resume" if resume else "force"
        raise InputError("simulate", option, "requires a folder for the logs (--out)")
    # All logs are checked before any trial is run.
    kept = {} if store is None else store.rows()
    missing = [index for index in range(batch.count) if index not in kept]
    blocks = _blocks(batch, missing, workers, in_lockstep=reason is None)
    tasks = [Task.of(run_trials, batch=given, indices=block) for block in blocks]
    return _rows(tasks, kept, store, workers)


def run_trials(batch: dict[str, Any], indices: list[int]) -> list[dict[str, Any]]:
    """Runs trials of a batch, given as `Batch.to_json`, writes required logs, and returns rows."""
    return _trials(canonical(batch)).run(indices)


def _check_memory(needed: int, workers: int) -> None:
    """Refuses trials in lock-step that the memory would not hold, before any is run."""
    if workers > 1:
        needed = workers * (needed + _PROCESS_MEMORY)
    available = available_memory()
    if available is not None and needed > available:
        option = "fewer --workers" if workers > 1 else "--engine drake"
        expected = f"need about {needed / 1e6:,.0f} MB of memory, of which {available / 1e6:,.0f} MB are free"
        raise InputError("simulate", "trials", f"{expected}; use {option}")


def _blocks(batch: Batch, missing: list[int], workers: int, *, in_lockstep: bool) -> list[list[int]]:
    """The trials of each task: those of one log, or more where each trial has its own log or none."""
    if batch.out is not None and batch.trials_per_log > 1:
        # A log holds trials that follow each other, whatever the number of workers.
        gaps = np.flatnonzero(np.diff(missing) > 1) + 1
        return [
            run[begin : begin + batch.trials_per_log].tolist()
            for run in np.split(np.array(missing, dtype=int), gaps)
            for begin in range(0, len(run), batch.trials_per_log)
        ]
    if not missing or not in_lockstep:
        return [[index] for index in missing]
    # Blocks of equal size, at least one for each worker.
    count = max(-(-len(missing) // BLOCK), min(workers, len(missing)))
    return [part.tolist() for part in np.array_split(missing, count)]


def _open_store(batch: Batch, out: str, *, resume: bool, force: bool) -> LogStore:
    trials = functools.partial(_trials, canonical(batch.to_json()))
    if force:
        # Errors in the batch are found before any log is removed.
        if batch.recording is not None and Path(batch.recording).resolve().parent == Path(out).resolve():
            raise InputError(batch.recording, "", f"must not be in {out}, whose logs are overwritten")
        trials().check()
    logs = open_log_folder(out, count=batch.count, resume=resume, force=force)
    return LogStore(logs, lambda index: trials().describe(index))


def _rows(
    tasks: list[Task], kept: dict[int, Any], store: LogStore | None, workers: int
) -> Iterator[dict[str, Any]]:
    rows = dict(kept)
    total = len(rows) + sum(len(task.arguments["indices"]) for task in tasks)
    # A failure of a trial is not retried: the same trial fails again.
    completed = run_as_completed(tasks, store, workers=min(workers, max(1, len(tasks))), retries=0)
    for index in range(total):
        while index not in rows:
            task, found = next(completed)
            rows |= zip(task.arguments["indices"], found, strict=True)
        yield rows.pop(index)


class _Trials:
    """The diagram of a batch, built once in its process, and the settings of its trials."""

    def __init__(self, batch: Batch) -> None:
        self._batch = batch
        scenario = load_scenario(batch.scenario)
        learner = None if batch.model is None else load_learner(batch.model)
        self._routes: list[tuple[str | None, str | None]] = [(route.name, None) for route in scenario.routes]
        if batch.switching:
            self._routes = [(route.name, then.name) for route, then in changes_of_route(scenario)]
        operator: LeafSystem | None = None
        robot, plant = None, None
        if batch.robot is not None:
            robot, plant = make_robot(batch.robot, scenario=scenario)
        self._recording, self._recorded_route = None, None
        if batch.operator is not None:
            operator = make_operator(batch.operator, scenario=scenario, robot=robot)
            self._routes = [(None, None)]
        if batch.recording is not None:
            recorded = read_log(batch.recording)
            # The last row of a log was never applied.
            self._recording = recorded.commands("human")[:-1]
            self._recorded_route = recorded.metadata.get("route")
            operator = RecordedInput(robot=robot or scenario.robot, period=scenario.control_period)
        self._simulation = Simulation(
            scenario, learner=learner, operator=operator, robot=robot, plant=plant, config=batch.config
        )
        self.reason_for_drake = reason_for_drake(self._simulation, batch.engine)
        """Why the trials run in Drake; None if they run in lock-step."""

    def memory(self) -> int:
        """Memory that the trials take in lock-step, in bytes."""
        return Lockstep(self._simulation).memory(self._batch.count)

    def check(self) -> None:
        """Raises the InputError that the first trial would raise."""
        self._simulation.begin(self._settings(0))

    def describe(self, index: int) -> dict[str, Any]:
        """The metadata of a trial, all but its status."""
        return self._simulation.describe(self._settings(index))

    def run(self, indices: list[int]) -> list[dict[str, Any]]:
        """Runs trials, writes required logs, and returns rows."""
        settings = [self._settings(index) for index in indices]
        if self.reason_for_drake is None:
            trials = Lockstep(self._simulation).run(settings)
        else:
            trials = map(self._simulation.run, settings)
        numbered = iter(zip(indices, trials, strict=True))
        out, rows = self._batch.out, []
        # Metrics of many trials at once, where no log of each keeps what is done.
        size = MOST_PER_LOG if out is None else self._batch.trials_per_log
        while part := dict(itertools.islice(numbered, size)):
            log = None if out is None else log_path(out, list(part))
            if log is not None:
                write_log_of_batch(part, log)
            rows += rows_of(part, log)
        return rows

    def _settings(self, index: int) -> TrialSettings:
        batch = self._batch
        route, then = self._routes[index % len(self._routes)]
        return TrialSettings(
            seed=batch.seed + index,
            route=self._recorded_route if self._recording is not None else route,
            then=then,
            behaviour=batch.behaviour,
            recording=self._recording,
        )


@functools.lru_cache(maxsize=1)
def _trials(batch: str) -> _Trials:
    return _Trials(Batch.from_json(json.loads(batch)))
