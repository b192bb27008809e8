"""Runs single tasks in a worker process, on one thread."""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import os
import platform
import signal
import threading
import traceback
from multiprocessing.connection import Connection

from drake_shared.common.errors import InputError, RunError
from drake_shared.common.threads import limit_threads, single_threaded
from drake_shared.simulation.runner.identity import identity
from drake_shared.simulation.runner.tasks import Task, as_json

# Computed when the code is loaded: a worker may outlive a change of the files.
_IDENTITY = identity()
# A Dask worker may have several threads; a cached diagram must not be used by two of them.
_ONE_AT_A_TIME = threading.RLock()
_FAILURES = {InputError: "input", RunError: "run"}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Outcome:
    """The result of a task, or why it failed, as text that can always be sent to another process.

    Attributes:
        identity: See `drake_shared.simulation.runner.identity.identity`.
        place: The process, for messages.
        text: The value of the function as JSON; None if it failed.
        error: The first line of the reason for the failure.
        failure: "input" or "run" for an InputError or RunError, which would occur again; "other" for other
            exceptions; empty if the task succeeded.
        details: The traceback.
    """

    identity: dict[str, str]
    place: str
    text: str | None = None
    error: str = ""
    failure: str = ""
    details: str = ""


def run_task(task: Task) -> Outcome:
    """Runs a task in a process whose threads are limited; no exception of the task is raised."""
    place = f"process {os.getpid()} on {platform.node()}"
    try:
        text = as_json(task.find()(**task.arguments))
    except Exception as error:
        first_line = next(iter(str(error).splitlines()), "")
        failure = next((kind for known, kind in _FAILURES.items() if isinstance(error, known)), "other")
        if failure == "other":
            first_line = f"{type(error).__name__}: {first_line}".removesuffix(": ")
        return Outcome(
            identity=_IDENTITY, place=place, error=first_line, failure=failure, details=traceback.format_exc()
        )
    return Outcome(identity=_IDENTITY, place=place, text=text)


def run_task_on_cluster(task: Task) -> Outcome:
    """Runs a task in a process of Dask, whose threads are limited for the time of the task."""
    with _ONE_AT_A_TIME, single_threaded():
        return run_task(task)


def start_local_worker(lifeline: Connection) -> None:
    """Prepares a process of a local pool, which exits when the other end of ``lifeline`` is closed.

    The other end is closed when the run is abandoned, and when its process is killed. Ctrl-C reaches every
    process of a terminal; only the process that the user started handles it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A replay's Meshcat would print an address that nobody can open.
    logging.getLogger("drake").setLevel(logging.WARNING)
    limit_threads()
    threading.Thread(target=_exit_with, args=(lifeline,), daemon=True).start()


def _exit_with(lifeline: Connection) -> None:
    with contextlib.suppress(EOFError, OSError):
        lifeline.recv_bytes()
    os._exit(1)
