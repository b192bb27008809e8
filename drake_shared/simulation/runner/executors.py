"""Executors: this process, processes of this machine, or a Dask cluster."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import logging
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.common.threads import single_threaded
from drake_shared.simulation.runner.identity import first_difference, identity
from drake_shared.simulation.runner.tasks import Task
from drake_shared.simulation.runner.worker import Outcome, run_task, run_task_on_cluster, start_local_worker

CONNECT_TIMEOUT = 4.0
"""For a cluster to answer, and then to have a worker, in [s]."""
RESTART_TIMEOUT = 45.0
"""For a cluster that lost its last worker to have one again, in [s]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Pool:
    """An executor that is ready for tasks.

    Attributes:
        submit: Starts a task and returns the future of its outcome.
        queue_size: How many tasks to submit before the first is done.
        check: Checks that there are workers and that they run this code.
    """

    submit: Callable[[Task], Future[Outcome]]
    queue_size: int
    check: Callable[[], None] = lambda: None


@contextlib.contextmanager
def executor(*, workers: int, cluster: str | None, preload: Sequence[str] = ()) -> Iterator[Pool]:
    """Yields an executor for tasks. An exception in the body abandons the tasks that are running.

    Args:
        workers: Number of local processes; 1 is this process.
        cluster: Address of a Dask scheduler, "tcp://host:port", whose workers are used instead.
        preload: Modules that new local processes have loaded when they start.

    Raises:
        InputError: ``workers`` is below 1; the cluster cannot be reached, has no workers, or has one with
            other code or several threads; or the extra ``cluster`` is not installed.
    """
    if workers < 1:
        raise InputError("runner", "workers", "must be at least 1", workers)
    if cluster is not None:
        with _cluster(cluster) as pool:
            yield pool
    elif workers == 1:
        with single_threaded():
            yield Pool(submit=_run_here, queue_size=1)
    else:
        with _processes(workers, preload) as pool:
            yield pool


def _run_here(task: Task) -> Future[Outcome]:
    future: Future[Outcome] = Future()
    future.set_result(run_task(task))
    return future


@contextlib.contextmanager
def _processes(workers: int, preload: Sequence[str]) -> Iterator[Pool]:
    # A fork server: a fork of a process in which threads of Drake or BLAS run may deadlock.
    context = multiprocessing.get_context("forkserver")
    # The server imports them once; its only threads are of libraries that stop them for a fork.
    context.set_forkserver_preload([__name__, *preload])
    lifeline, ours = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(
        workers, mp_context=context, initializer=start_local_worker, initargs=(lifeline,)
    )
    try:
        yield Pool(submit=lambda task: pool.submit(run_task, task), queue_size=2 * workers)
    except BaseException:
        # Otherwise the pool would wait for the tasks that are running, which may take minutes.
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
        expected = "needs Dask: in the checkout, pip install '.[distributed]'"
        raise InputError("--cluster", "", expected, address) from None
    # This module reports a lost connection in one line; Dask would add its traceback.
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
            thread.submit(asyncio.run, _handshake(distributed, address)).result()
        client = distributed.Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except Exception as error:  # A server that is no scheduler may cause any exception.
        first_line = next(iter(str(error).splitlines()), "no answer")
        expected = f'must be the "tcp://host:port" of a Dask scheduler that answers ({first_line})'
        raise InputError("--cluster", "", expected, address) from error
    try:
        _check_workers(client, address, CONNECT_TIMEOUT)
        yield client
    finally:
        # The scheduler forgets the tasks of a client that disconnects.
        client.close(timeout=CONNECT_TIMEOUT)


async def _handshake(distributed: Any, address: str) -> None:
    """Exchanges greetings with a scheduler: a Client waits for them forever, whatever its timeout."""
    options = distributed.Security().get_connection_args("client")
    greeting = distributed.core.connect(address, timeout=CONNECT_TIMEOUT, **options)
    comm = await asyncio.wait_for(greeting, 1.5 * CONNECT_TIMEOUT)
    await comm.close()


def _cluster_pool(client: Any, address: str) -> Pool:
    # Not pure: otherwise Dask returns the old failure when a task is retried.
    pool = client.get_executor(pure=False)

    def submit(task: Task) -> Future[Outcome]:
        if client.status != "running":
            raise BrokenExecutor(f"the connection to {address} was lost")
        future: Future[Outcome] = pool.submit(run_task_on_cluster, task)
        return future

    return Pool(
        submit=submit, queue_size=1000, check=lambda: _check_workers(client, address, RESTART_TIMEOUT)
    )


def _check_workers(client: Any, address: str, timeout: float) -> None:
    """Checks that there are workers, with one thread each and with this code.

    Raises:
        InputError: Names the first worker that does not qualify.
        BrokenExecutor: The scheduler is gone.
    """
    import distributed

    try:
        client.wait_for_workers(1, timeout=timeout)
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
            continue  # It is disconnecting; the scheduler gives its tasks to others.
        if differs := first_difference(theirs, identity()):
            raise InputError(
                f"worker {worker}", "", f"must have the same drake_shared as this process: {differs}"
            )
        if threads.get(worker, 1) != 1:
            raise InputError(
                f"worker {worker}", "--nthreads", "must be 1 (use --nworkers for more)", threads[worker]
            )
