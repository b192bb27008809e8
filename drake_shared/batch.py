"""Many trials without a page, in one process or several, with the same bits whatever their number."""

from __future__ import annotations

import dataclasses
import functools
import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from drake_shared.arbitration import DEFAULT
from drake_shared.authority import Authority
from drake_shared.behaviour import Behaviour
from drake_shared.errors import InputError
from drake_shared.faults import Faults
from drake_shared.learners import load_learner
from drake_shared.metrics import metrics
from drake_shared.operators import changes_of_route
from drake_shared.scenario import load_scenario
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.trial import Simulation, TrialSettings, read_log, write_log


@dataclasses.dataclass(frozen=True, kw_only=True)
class Batch:
    """Trials to run; small enough to be sent to another process.

    Attributes:
        scenario: File or name; see :func:`drake_shared.scenario.load_scenario`.
        model: File of the learner; the human drives alone without one.
        count: How many trials. The routes of the scenario take turns.
        seed: Of the first trial; each following one has the next.
        mode: "shared", "human" or "agent".
        arbitration: Name of the arbiter, see `drake_shared.arbitration`.
        authority: What "blend" leaves to the human: True is the default, False nothing, None by preset.
        behaviour: Of the simulated operator.
        switching: Whether the operator changes to another route at ``behaviour.switch_time``; then the routes
            that can be left take turns. See :func:`drake_shared.operators.changes_of_route`.
        recording: A log whose human commands are played back in place of a simulated operator.
        confidence_gain: K of eq. (1), in [1/m^2]; the learner's own if None.
        end: "reached" or "duration".
        safety_clearance: Kept by a safety filter, in [m]; without one if None.
        faults: What goes wrong on purpose.
        out: Folder for the logs; none are written if None.
    """

    scenario: str | None = None
    model: str | None = None
    count: int = 1
    seed: int = 0
    mode: str = "shared"
    arbitration: str = DEFAULT
    authority: Authority | bool | None = None
    behaviour: Behaviour = dataclasses.field(default_factory=Behaviour)
    switching: bool = False
    recording: str | None = None
    confidence_gain: float | None = None
    end: str = "reached"
    safety_clearance: float | None = None
    faults: Faults | None = None
    out: str | None = None

    def __post_init__(self) -> None:
        if self.count < 1:
            raise InputError("simulate", "trials", "must be at least 1", self.count)
        if self.authority and self.mode != "shared":
            # The default is simply not looked at there; one that is asked for contradicts it.
            raise InputError("authority", "", f"must be left out where the {self.mode} drives alone")


def run_batch(batch: Batch, *, workers: int = 1) -> Iterator[dict[str, Any]]:
    """Runs the trials and yields the metrics of each, in order, with its seed, route and log.

    Args:
        batch: What to run.
        workers: Number of processes; 1 runs in this one.

    Raises:
        InputError: A file cannot be read, or the folder for logs cannot be written to.
    """
    if workers < 1:
        raise InputError("simulate", "workers", "must be at least 1", workers)
    if workers == 1:
        runner = _Runner(batch)
        yield from (runner.run(index) for index in range(batch.count))
        return
    # A fork server: a fork of a process that has Drake and BLAS threads running may hang.
    context = multiprocessing.get_context("forkserver")
    # What the workers need is imported once, in the server; its only threads are of libraries that stop them
    # for a fork.
    context.set_forkserver_preload([__name__])
    with ProcessPoolExecutor(
        min(workers, batch.count), mp_context=context, initializer=_start_worker, initargs=(batch,)
    ) as pool:
        chunk = max(1, min(16, batch.count // (4 * workers)))
        yield from pool.map(_run_in_worker, range(batch.count), chunksize=chunk)


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
            operator=operator,
            arbiter=batch.arbitration,
            authority=batch.authority,
            safety_clearance=batch.safety_clearance,
            faults=batch.faults,
        )

    def run(self, index: int) -> dict[str, Any]:
        batch = self._batch
        route, then = self._routes[index % len(self._routes)]
        settings = TrialSettings(
            mode=batch.mode,
            seed=batch.seed + index,
            route=self._recorded_route if self._recording is not None else route,
            then=then,
            behaviour=batch.behaviour,
            recording=self._recording,
            confidence_gain=batch.confidence_gain,
            end=batch.end,
        )
        trial = self._simulation.run(settings)
        log = None
        if batch.out is not None:
            log = os.fspath(Path(batch.out) / f"trial_{index:05d}.parquet")
            write_log(trial, log)
        return {"seed": settings.seed, "route": settings.route, **metrics(trial), "log": log}


_batch: Batch | None = None


def _start_worker(batch: Batch) -> None:
    global _batch
    _batch = batch


@functools.cache
def _worker_runner() -> _Runner:
    # Made by the first trial: what fails while a worker starts breaks the pool and does not say why.
    assert _batch is not None
    return _Runner(_batch)


def _run_in_worker(index: int) -> dict[str, Any]:
    return _worker_runner().run(index)
