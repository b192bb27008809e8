"""What a worker does, in whatever process it is: one task at a time, on one thread, to the same bits."""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import os
import platform
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from multiprocessing.connection import Connection

from threadpoolctl import threadpool_limits

from drake_shared.common.errors import InputError
from drake_shared.simulation.runner.identity import identity
from drake_shared.simulation.runner.tasks import Task, as_json

# Taken when the code is loaded: a worker may outlive a change of the files.
_IDENTITY = identity()
# A Dask worker may have threads; a diagram that is kept between trials may not be in two of them.
_ALONE = threading.RLock()
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a task; plain text, so that it can be sent whatever happened.

    Attributes:
        identity: See `drake_shared.simulation.runner.identity.identity`.
        place: The process, for people.
        text: What the function returned, as JSON; None if it failed.
        error: The first line of why it failed.
        bad_input: Whether it failed by an InputError, and would again.
        details: The traceback.
    """

    identity: dict[str, str]
    place: str
    text: str | None = None
    error: str = ""
    bad_input: bool = False
    details: str = ""


def work(task: Task) -> Outcome:
    """Runs a task and says what became of it; only what ends the process is raised."""
    place = f"process {os.getpid()} on {platform.node()}"
    try:
        with _ALONE:
            function = task.find()
            with one_thread():
                text = as_json(function(**task.arguments))
    except Exception as error:
        bad_input = isinstance(error, InputError)
        first = next(iter(str(error).splitlines()), "")
        return Outcome(
            identity=_IDENTITY,
            place=place,
            error=first if bad_input else f"{type(error).__name__}: {first}".removesuffix(": "),
            bad_input=bad_input,
            details=traceback.format_exc(),
        )
    return Outcome(identity=_IDENTITY, place=place, text=text)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Holds BLAS, OpenMP and torch to one thread each: more change the bits, and slow small arrays down."""
    torch = sys.modules.get("torch")
    threads = None if torch is None else torch.get_num_threads()
    before = {name: os.environ.get(name) for name in _THREADS}
    # For the libraries that the task itself loads.
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    if torch is not None:
        torch.set_num_threads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        if torch is not None:
            torch.set_num_threads(threads)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def start_local_worker(lifeline: Connection) -> None:
    """Prepares a process of a local pool, which ends when the other end of ``lifeline`` is closed.

    That happens when the run is given up, and also when its process is killed. Ctrl-C reaches every process
    of a terminal; what it means is for the one that the person started to say.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A replay's Meshcat would announce an address that is not there to be opened.
    logging.getLogger("drake").setLevel(logging.WARNING)
    threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()


def _end_with(lifeline: Connection) -> None:
    with contextlib.suppress(EOFError, OSError):
        lifeline.recv_bytes()
    os._exit(1)
