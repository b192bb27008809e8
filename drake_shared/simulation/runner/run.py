"""Runs what is not done yet, keeps each result the moment it is there, and outlives what goes wrong."""

from __future__ import annotations

import collections
import logging
import queue
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future
from typing import Any

from tqdm import tqdm

from drake_shared.common.errors import InputError, RunError
from drake_shared.simulation.runner.executors import Pool, executor
from drake_shared.simulation.runner.identity import difference, identity
from drake_shared.simulation.runner.store import KEPT, Store
from drake_shared.simulation.runner.tasks import Task
from drake_shared.simulation.runner.worker import Outcome

Progress = Callable[[int, int], None]
"""Called with the number of tasks that are done and that of all."""

PULSE = 15.0
"""How long nothing may be heard from a pool before it is asked whether it is still there, in [s]."""

_log = logging.getLogger(__name__)


def run_tasks(
    tasks: Iterable[Task],
    store: Store,
    *,
    workers: int = 1,
    cluster: str | None = None,
    retries: int = 2,
    progress: Progress | None = None,
) -> list[Any]:
    """Runs the tasks that the store does not have, and returns the values of all, in the order of ``tasks``.

    The values are the same bits whatever the workers and whatever went wrong on the way. Ctrl-C, as any
    exception, gives up what is under way and leaves what is done in the store.

    Args:
        tasks: Two that are equal are run once.
        store: Where results are looked up and kept.
        workers: Processes of this machine; 1 is this process.
        cluster: Address of a Dask scheduler to use instead. Its workers have file systems and working folders
            of their own, so that a path in the arguments must mean the same there.
        retries: How often a task that failed is tried again, and how often in a row a pool is made anew whose
            processes died without finishing a task.
        progress: Default: a bar on standard error, if that is a terminal.

    Raises:
        InputError: A task found bad input (it is not tried again), or the cluster is not as it must be.
        RunError: A task failed for good, processes kept dying, or a result could not be kept.
    """
    if retries < 0:
        raise InputError("engine", "retries", "must be 0 or more", retries)
    tasks = list(tasks)
    values: dict[str, Any] = {}
    missing: dict[str, Task] = {}
    for task in tasks:
        try:
            values[task.key] = store.read(task)
        except KeyError:
            missing[task.key] = task
    total = len(values) + len(missing)
    with tqdm(
        total=total, initial=len(values), unit="task", disable=True if progress is not None else None
    ) as bar:

        def report() -> None:
            bar.update(len(values) - bar.n)
            if progress is not None:
                progress(len(values), total)

        report()
        attempts = _Attempts(retries)
        barren = 0
        while missing:
            left = len(missing)
            try:
                with executor(workers=workers, cluster=cluster) as pool:
                    for task, text in _finished(pool, list(missing.values()), attempts):
                        values[task.key] = store.write(task, text)
                        del missing[task.key]
                        report()
            except BrokenExecutor as error:
                barren = barren + 1 if len(missing) == left else 0
                if barren > retries:
                    raise RunError(
                        f"workers were lost {barren} times without finishing a task ({error}); {KEPT}"
                    ) from error
                _log.warning("%s; what is not done is run again", str(error).rstrip("."))
    return [values[task.key] for task in tasks]


class _Attempts:
    """Counts the failures of each task, over all pools.

    Args:
        retries: How often each may fail and be tried again.
    """

    def __init__(self, retries: int) -> None:
        self._retries = retries
        self._failures: collections.Counter[str] = collections.Counter()

    def failed(self, task: Task, reason: str, details: str = "") -> None:
        """Counts one.

        Raises:
            RunError: It was the last.
        """
        self._failures[task.key] += 1
        count = self._failures[task.key]
        if count > self._retries:
            error = RunError(f"{task.function} failed {count} times ({reason}); {KEPT}")
            if details:
                error.add_note(details)
            raise error
        _log.warning("%s failed (%s); it is tried again", task.function, reason)


def _finished(pool: Pool, tasks: list[Task], attempts: _Attempts) -> Iterator[tuple[Task, str]]:
    """Yields each task and the JSON of its value, as they come.

    Raises:
        BrokenExecutor: Processes of the pool died, and what is not done must be run in another.
        InputError: See `run_tasks`.
        RunError: A task failed for good.
    """
    waiting = collections.deque(tasks)
    running: dict[Future[Outcome], Task] = {}
    done: queue.SimpleQueue[Future[Outcome]] = queue.SimpleQueue()
    while waiting or running:
        while waiting and len(running) < pool.ahead:
            task = waiting.popleft()
            future = pool.submit(task)
            running[future] = task
            future.add_done_callback(done.put)
        try:
            future = done.get(timeout=PULSE)
        except queue.Empty:
            pool.check()
            continue
        task = running.pop(future)
        try:
            outcome = future.result()
        except BrokenExecutor:
            raise
        except CancelledError as error:
            # Nobody here cancels one and still waits for it: the scheduler has lost it, or we the scheduler.
            raise BrokenExecutor("the cluster lost a task") from error
        except Exception as error:
            # It was not the task that raised this, but what should have run it.
            reason = f"{type(error).__name__}: {error}".splitlines()[0]
            attempts.failed(task, reason)
            waiting.append(task)
            continue
        if differs := difference(outcome.identity, identity()):
            # If it is a worker of a cluster that came later, this names it.
            pool.check()
            raise InputError(
                outcome.place, "", f"must have the same drake_shared as this process: {differs}; {KEPT}"
            )
        if outcome.bad_input:
            raise InputError(outcome.error, "", "")
        if outcome.text is None:
            attempts.failed(task, outcome.error, outcome.details)
            waiting.append(task)
            continue
        yield task, outcome.text
