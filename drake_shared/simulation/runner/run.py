"""Runs tasks, stores each result as soon as it is available, and recovers from lost workers."""

from __future__ import annotations

import collections
import contextlib
import json
import logging
import queue
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future
from typing import Any

from tqdm import tqdm

from drake_shared.common.errors import InputError, RunError
from drake_shared.simulation.runner.executors import Pool, executor
from drake_shared.simulation.runner.identity import first_difference, identity
from drake_shared.simulation.runner.store import KEPT, ResultStore
from drake_shared.simulation.runner.tasks import Task
from drake_shared.simulation.runner.worker import Outcome

Progress = Callable[[int, int], None]
"""Called with the number of completed tasks and the number of all tasks."""

HEARTBEAT = 15.0
"""After this time without a result the pool is checked, in [s]."""

_log = logging.getLogger(__name__)


def run_tasks(
    tasks: Iterable[Task],
    store: ResultStore,
    *,
    workers: int = 1,
    cluster: str | None = None,
    retries: int = 2,
    progress: Progress | None = None,
) -> list[Any]:
    """Runs the tasks that the store does not hold, and returns the values of all, in the order of ``tasks``.

    The values are the same bits whatever the workers and whatever failed meanwhile. Any exception, such as
    KeyboardInterrupt, abandons the running tasks and leaves the completed ones in the store.

    Args:
        tasks: Equal tasks are run once.
        store, workers, cluster, retries: See `run_as_completed`.
        progress: Default: a bar on standard error, if that is a terminal.

    Raises:
        InputError, RunError: See `run_as_completed`.
    """
    tasks = list(tasks)
    values = read_results(tasks, store)
    missing = {task.key: task for task in tasks if task.key not in values}
    total = len(values) + len(missing)
    hidden = True if progress is not None else None
    with tqdm(total=total, initial=len(values), unit="task", disable=hidden) as bar:
        if progress is not None:
            progress(len(values), total)
        for task, value in run_as_completed(
            missing.values(), store, workers=workers, cluster=cluster, retries=retries
        ):
            values[task.key] = value
            bar.update()
            if progress is not None:
                progress(len(values), total)
    return [values[task.key] for task in tasks]


def read_results(tasks: Iterable[Task], store: ResultStore) -> dict[str, Any]:
    """The values that a store holds, by the key of their task."""
    values = {}
    for task in tasks:
        with contextlib.suppress(KeyError):
            values[task.key] = store.read(task)
    return values


def run_as_completed(
    tasks: Iterable[Task],
    store: ResultStore | None,
    *,
    workers: int,
    cluster: str | None = None,
    retries: int,
) -> Iterator[tuple[Task, Any]]:
    """Runs tasks and yields each with its value once that is stored.

    Args:
        tasks: With different keys.
        store: Keeps the results, unless it is None.
        workers: Number of local processes; 1 is this process, in which tasks run in order, one for each step
            of the iterator.
        cluster: Address of a Dask scheduler to use instead. Its workers have file systems and working folders
            of their own: a path in the arguments must mean the same there.
        retries: How often a failed task is retried, and how often in a row lost workers are replaced without
            a task completed in between.

    Raises:
        InputError: A task raised one (it is not retried), or the cluster cannot be used.
        RunError: A task raised one (it is not retried) or failed too often, workers were lost too often, or a
            result could not be stored.
    """
    if retries < 0:
        raise InputError("runner", "retries", "must be 0 or more", retries)
    missing = {task.key: task for task in tasks}
    preload = sorted({task.module for task in missing.values()})
    attempts = _Attempts(retries, "" if store is None else f"; {KEPT}")
    losses = 0
    while missing:
        remaining = len(missing)
        try:
            with executor(workers=workers, cluster=cluster, preload=preload) as pool:
                for task, text in _outcomes(pool, list(missing.values()), attempts):
                    value = json.loads(text) if store is None else store.write(task, text)
                    del missing[task.key]
                    yield task, value
        except BrokenExecutor as error:
            losses = losses + 1 if len(missing) == remaining else 1
            if losses > retries:
                times = "once" if losses == 1 else f"{losses} times without completing a task"
                reason = str(error).rstrip(".")
                raise RunError(f"workers were lost {times} ({reason}){attempts.note}") from error
            _log.warning("%s; the remaining tasks are run again", str(error).rstrip("."))


class _Attempts:
    """Counts the failures of each task, over all pools.

    Args:
        retries: How often each may fail and be retried.
        note: Appended to the messages of errors that end the run.
    """

    def __init__(self, retries: int, note: str) -> None:
        self.note = note
        self._retries = retries
        self._failures: collections.Counter[str] = collections.Counter()

    def count_failure(self, task: Task, reason: str, details: str = "") -> None:
        """Counts a failure.

        Raises:
            RunError: It was the last that is allowed.
        """
        self._failures[task.key] += 1
        count = self._failures[task.key]
        if count > self._retries:
            error = RunError(f"{task.function} failed {count} times ({reason}){self.note}")
            if details:
                error.add_note(details)
            raise error
        _log.warning("%s failed (%s); it is retried", task.function, reason)


def _outcomes(pool: Pool, tasks: list[Task], attempts: _Attempts) -> Iterator[tuple[Task, str]]:
    """Yields each task and the JSON of its value, as they complete.

    Raises:
        BrokenExecutor: Workers were lost, and the remaining tasks must be run in another pool.
        InputError, RunError: See `run_as_completed`.
    """
    waiting = collections.deque(tasks)
    running: dict[Future[Outcome], Task] = {}
    done: queue.SimpleQueue[Future[Outcome]] = queue.SimpleQueue()
    while waiting or running:
        while waiting and len(running) < pool.queue_size:
            task = waiting.popleft()
            future = pool.submit(task)
            running[future] = task
            future.add_done_callback(done.put)
        try:
            future = done.get(timeout=HEARTBEAT)
        except queue.Empty:
            pool.check()
            continue
        task = running.pop(future)
        try:
            outcome = future.result()
        except BrokenExecutor:
            raise
        except CancelledError as error:
            # No code here cancels a future that it waits for: the connection to the scheduler was lost.
            raise BrokenExecutor("the cluster lost a task") from error
        except Exception as error:
            # Not raised by the task, but by the code that should have run it.
            attempts.count_failure(task, f"{type(error).__name__}: {error}".splitlines()[0])
            waiting.append(task)
            continue
        if differs := first_difference(outcome.identity, identity()):
            # If it is a worker that joined the cluster later, this names it.
            pool.check()
            expected = f"must have the same drake_shared as this process: {differs}{attempts.note}"
            raise InputError(outcome.place, "", expected)
        if outcome.failure == "input":
            raise InputError(outcome.error, "", "")
        if outcome.failure == "run":
            raise RunError(f"{outcome.error}{attempts.note}")
        if outcome.text is not None:
            yield task, outcome.text
        else:
            attempts.count_failure(task, outcome.error, outcome.details)
            waiting.append(task)
