"""Many trials without a page, in one process or several, with the same bits whatever their number."""

from __future__ import annotations

import dataclasses
import functools
import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from drake_shared.analysis.log_folder import log_path, open_log_folder, read_kept, write_kept
from drake_shared.analysis.metrics import metrics
from drake_shared.common.errors import InputError, RunError
from drake_shared.learners import load_learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.named import changes_of_route
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.runner.worker import start_local_worker
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings, read_log
from drake_shared.systems.recorded_input import RecordedInput


@dataclasses.dataclass(frozen=True, kw_only=True)
class Batch:
    """Trials to run; small enough to be sent to another process.

    Attributes:
        scenario: File or name; see :func:`drake_shared.scenario.load_scenario`.
        model: File of the learner; the human drives alone without one.
        count: How many trials. The routes of the scenario take turns.
        seed: Of the first trial; each following one has the next.
        config: How control is shared; if None, the one that the learner's preset names.
        behaviour: Of the simulated operator.
        switching: Whether the operator changes to another route at ``behaviour.switch_time``; then the routes
            that can be left take turns. See :func:`drake_shared.operators.named.changes_of_route`.
        recording: A log whose human commands are played back in place of a simulated operator.
        out: Folder for the logs; none are written if None.
    """

    scenario: str | None = None
    model: str | None = None
    count: int = 1
    seed: int = 0
    config: SharedControlConfig | None = None
    behaviour: Behaviour = dataclasses.field(default_factory=Behaviour)
    switching: bool = False
    recording: str | None = None
    out: str | None = None

    def __post_init__(self) -> None:
        if self.count < 1:
            raise InputError("simulate", "trials", "must be at least 1", self.count)


def run_batch(
    batch: Batch, *, workers: int = 1, resume: bool = False, force: bool = False
) -> Iterator[dict[str, Any]]:
    """Runs the trials and yields the metrics of each, in order, with its seed, route and log.

    Args:
        batch: What to run.
        workers: Number of processes; 1 runs in this one.
        resume: Take the trials whose logs are in ``batch.out`` from there, and run the others.
        force: Begin anew where there are logs: they are removed.

    Raises:
        InputError: A file cannot be read, or the folder for logs cannot be written to, holds logs of trials
            and neither was asked for, or holds some of another configuration.
        RunError: A log cannot be written, or a process of several died; the logs before it are kept.
    """
    if workers < 1:
        raise InputError("simulate", "workers", "must be at least 1", workers)
    done = {} if batch.out is None else _begin(batch, batch.out, resume=resume, force=force)
    if batch.out is None and (resume or force):
        raise InputError(
            "simulate", "resume" if resume else "force", "must be left out where no logs are kept (--out)"
        )
    return _run(batch, done, workers)


def _begin(batch: Batch, out: str, *, resume: bool, force: bool) -> dict[int, dict[str, Any]]:
    """The rows of the trials that are done, by number; all of them are checked before any other is run."""
    if force:
        # What is wrong with the batch is found before anything is removed for it.
        if batch.recording is not None and Path(batch.recording).resolve().parent == Path(out).resolve():
            raise InputError(batch.recording, "", f"must not be in {out}, which is begun anew")
        _Runner(batch).check()
    there = open_log_folder(out, count=batch.count, resume=resume, force=force)
    if not there:
        return {}
    runner = _Runner(batch)
    rows = {index: runner.kept(index) for index in there}
    return {index: row for index, row in rows.items() if row is not None}


def _run(batch: Batch, done: dict[int, dict[str, Any]], workers: int) -> Iterator[dict[str, Any]]:
    left = [index for index in range(batch.count) if index not in done]
    rows = _run_alone(batch, left) if workers == 1 else _run_in_pool(batch, left, workers)
    for index in range(batch.count):
        yield done[index] if index in done else next(rows)


def _run_alone(batch: Batch, indices: list[int]) -> Iterator[dict[str, Any]]:
    runner = _Runner(batch)
    yield from (runner.run(index) for index in indices)


def _run_in_pool(batch: Batch, indices: list[int], workers: int) -> Iterator[dict[str, Any]]:
    # A fork server: a fork of a process that has Drake and BLAS threads running may hang.
    context = multiprocessing.get_context("forkserver")
    # What the workers need is imported once, in the server; its only threads are of libraries that stop them
    # for a fork.
    context.set_forkserver_preload([__name__])
    lifeline, ours = context.Pipe(duplex=False)
    with (
        lifeline,
        ours,
        ProcessPoolExecutor(
            min(workers, len(indices)),
            mp_context=context,
            initializer=_start_worker,
            initargs=(batch, lifeline),
        ) as pool,
    ):
        chunk = max(1, min(16, len(indices) // (4 * workers)))
        try:
            yield from pool.map(_run_in_worker, indices, chunksize=chunk)
        except (KeyboardInterrupt, SystemExit):
            # Without this the pool would wait for the trials that it was given.
            ours.close()
            raise
        except BrokenExecutor as error:
            raise RunError(f"a worker was lost ({str(error).rstrip('.')}); earlier logs are kept") from error


class _Runner:
    """The diagram of a batch, built once in its process."""

    def __init__(self, batch: Batch) -> None:
        self._batch = batch
        scenario = load_scenario(batch.scenario)
        learner = None if batch.model is None else load_learner(batch.model)
        self._routes: list[tuple[str, str | None]] = [(route.name, None) for route in scenario.routes]
        if batch.switching:
            self._routes = [(route.name, then.name) for route, then in changes_of_route(scenario)]
        operator, self._recording, self._recorded_route = None, None, None
        if batch.recording is not None:
            recorded = read_log(batch.recording)
            # The last row of a log was never applied.
            self._recording = recorded.commands("human")[:-1]
            self._recorded_route = recorded.metadata.get("route")
            operator = RecordedInput(period=scenario.control_period)
        self._simulation = Simulation(
            scenario,
            learner=learner,
            config=batch.config,
            operator=operator,
        )

    def check(self) -> None:
        """Raises the InputError that the first trial would."""
        self._simulation.begin(self._settings(0))

    def run(self, index: int) -> dict[str, Any]:
        """Runs a trial, keeps its log where one is asked for, and returns its row."""
        trial = self._simulation.run(self._settings(index))
        log = None if self._batch.out is None else log_path(self._batch.out, index)
        if log is not None:
            write_kept(trial, log)
        return _row(trial, log)

    def kept(self, index: int) -> dict[str, Any] | None:
        """The row of a trial whose log is there; None if it must be run again."""
        assert self._batch.out is not None
        log = log_path(self._batch.out, index)
        trial = read_kept(log, self._simulation.describe(self._settings(index)))
        return None if trial is None else _row(trial, log)

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


def _row(trial: Trial, log: Path | None) -> dict[str, Any]:
    told = {"seed": trial.metadata["seed"], "route": trial.metadata["route"], **metrics(trial)}
    return told | {"log": None if log is None else os.fspath(log)}


_batch: Batch | None = None


def _start_worker(batch: Batch, lifeline: Connection) -> None:
    global _batch
    _batch = batch
    # A pool whose process is killed would go on with what it was given, and then wait for more for ever.
    start_local_worker(lifeline)


@functools.cache
def _worker_runner() -> _Runner:
    # Made by the first trial: what fails while a worker starts breaks the pool and does not say why.
    assert _batch is not None
    return _Runner(_batch)


def _run_in_worker(index: int) -> dict[str, Any]:
    return _worker_runner().run(index)
