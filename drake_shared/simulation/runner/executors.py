"""Where tasks run: in this process, in processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import logging
import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.simulation.runner.identity import difference, identity
from drake_shared.simulation.runner.tasks import Task
from drake_shared.simulation.runner.worker import Outcome, start_local_worker, work

PATIENCE = 4.0
"""For a cluster to answer, and then to have a worker, in [s]."""
RESTART = 45.0
"""For a cluster that lost its last worker to have one again, in [s]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Pool:
    """An executor that is ready for tasks.

    Attributes:
        submit: Starts a task; the outcome is a future.
        ahead: How many tasks to submit before the first is done.
        check: Makes sure that there are workers and that their code is ours.
    """

    submit: Callable[[Task], Future[Outcome]]
    ahead: int
    check: Callable[[], None]


@contextlib.contextmanager
def executor(*, workers: int = 1, cluster: str | None = None) -> Iterator[Pool]:
    """Yields where to run tasks. When it is left by an exception, tasks under way are given up at once.

    Args:
        workers: Processes of this machine; 1 is this process.
        cluster: Address of a Dask scheduler, "tcp://host:port", whose workers are used instead.

    Raises:
        InputError: ``workers`` is below 1; the cluster cannot be reached, has no workers, or has one with
            other code or several threads; or the extra ``cluster`` is not installed.
    """
    if workers < 1:
        raise InputError("engine", "workers", "must be at least 1", workers)
    if cluster is not None:
        with _cluster(cluster) as pool:
            yield pool
    elif workers == 1:
        yield Pool(submit=_run_here, ahead=1, check=_nothing)
    else:
        with _processes(workers) as pool:
            yield pool


def _nothing() -> None:
    pass


def _run_here(task: Task) -> Future[Outcome]:
    future: Future[Outcome] = Future()
    future.set_result(work(task))
    return future


@contextlib.contextmanager
def _processes(workers: int) -> Iterator[Pool]:
    # A fork server: a fork of a process that has Drake and BLAS threads running may hang.
    context = multiprocessing.get_context("forkserver")
    lifeline, ours = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(
        workers, mp_context=context, initializer=start_local_worker, initargs=(lifeline,)
    )
    try:
        yield Pool(submit=lambda task: pool.submit(work, task), ahead=2 * workers, check=_nothing)
    except BaseException:
        # A task may take minutes; without this the pool would wait for those that run.
        ours.close()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        ours.close()
        lifeline.close()


@contextlib.contextmanager
def _cluster(address: str) -> Iterator[Pool]:
    try:
        import distributed
    except ImportError:
        raise InputError(
            "--cluster", "", "needs Dask: install the extra with pip install 'drake_shared[cluster]'", address
        ) from None
    # What matters of a lost connection is said by us, in one line; Dask would add its traceback.
    logger = logging.getLogger("distributed.client")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        with _client(distributed, address) as client:
            yield _cluster_pool(client, address)
    finally:
        logger.setLevel(level)


@contextlib.contextmanager
def _client(distributed: Any, address: str) -> Iterator[Any]:
    try:
        # In a thread of its own: the caller's may have an event loop, as in a notebook.
        with ThreadPoolExecutor(1) as thread:
            thread.submit(asyncio.run, _knock(distributed, address)).result()
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # What answers there may be no scheduler, and say anything.
        first = next(iter(str(error).splitlines()), "it is silent")
        expected = f'must be the "tcp://host:port" of a Dask scheduler that answers ({first})'
        raise InputError("--cluster", "", expected, address) from error
    try:
        _check_workers(client, address, PATIENCE)
        yield client
    finally:
        # The scheduler forgets the tasks of a client that leaves.
        client.close(timeout=PATIENCE)


async def _knock(distributed: Any, address: str) -> None:
    """Exchanges greetings with a scheduler: a Client waits for them for ever, whatever its timeout."""
    options = distributed.Security().get_connection_args("client")
    greeting = distributed.core.connect(address, timeout=PATIENCE, **options)
    comm = await asyncio.wait_for(greeting, 1.5 * PATIENCE)
    await comm.close()


def _cluster_pool(client: Any, address: str) -> Pool:
    # Not pure: Dask would otherwise take a task that failed for the same when it is tried again.
    pool = client.get_executor(pure=False)

    def submit(task: Task) -> Future[Outcome]:
        if client.status != "running":
            raise BrokenExecutor(f"the connection to {address} was lost")
        return pool.submit(work, task)

    return Pool(submit=submit, ahead=1000, check=lambda: _check_workers(client, address, RESTART))


def _check_workers(client: Any, address: str, patience: float) -> None:
    """Makes sure that there are workers, of one thread each and with our code.

    Raises:
        InputError: Names the first worker that is not as it must be.
        BrokenExecutor: The scheduler is gone.
    """
    import distributed

    try:
        client.wait_for_workers(1, timeout=patience)
        threads = client.nthreads()
        found = client.run(identity, on_error="return")
    except (TimeoutError, distributed.TimeoutError):
        raise InputError(
            "--cluster", "", "must have a worker (dask worker ADDRESS --nthreads 1)", address
        ) from None
    except OSError as error:
        raise BrokenExecutor(f"the connection to {address} was lost ({error})") from error
    for worker, theirs in sorted(found.items()):
        if isinstance(theirs, OSError):
            continue  # It is about to go; the scheduler gives its tasks to others.
        if isinstance(theirs, Exception):
            theirs = f"{type(theirs).__name__}: {theirs}".splitlines()[0]
        if differs := difference(theirs, identity()):
            raise InputError(
                f"worker {worker}", "", f"must have the same drake_shared as this process: {differs}"
            )
        if threads.get(worker, 1) != 1:
            raise InputError(
                f"worker {worker}", "--nthreads", "must be 1 (use --nworkers for more)", threads[worker]
            )
