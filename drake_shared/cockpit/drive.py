"""The main job: serves the page and runs trials on it until told to stop."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path

from pydrake.systems.framework import LeafSystem
from threadpoolctl import threadpool_limits

from drake_shared.arbitration.authority import Authority
from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.cockpit.meshcat_proxy import start_meshcat
from drake_shared.cockpit.server import DEFAULT_PORT, CockpitServer
from drake_shared.cockpit.session import Session
from drake_shared.common.errors import InputError
from drake_shared.common.files import check_writable
from drake_shared.learners import Learner
from drake_shared.scenario import Scenario
from drake_shared.simulation.scene_drawing import draw_scene, look_from_above
from drake_shared.simulation.trial import Simulation, Trial
from drake_shared.systems.mouse_input import MouseInput, MouseSource

OPERATORS = ("mouse", "surrogate")

# Python hands control from thread to thread at this interval, in [s]; the usual 5 ms would be felt.
_SWITCH_INTERVAL = 0.0005


def drive(
    scenario: Scenario,
    learner: Learner | None = None,
    *,
    operator: str = "mouse",
    assist: bool = True,
    authority: Authority | bool | None = None,
    safety_clearance: float | None = None,
    record: str | os.PathLike[str] | None = None,
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    open_browser: bool = True,
    on_trial: Callable[[Trial], bool | None] = lambda _: None,
) -> None:
    """Serves the page and runs trials in real time, one after another, until interrupted.

    The page's address goes to standard output, key included, and messages to standard error. SIGINT and
    SIGTERM end it where it runs in the main thread: the trial under way is kept first.

    Args:
        scenario: The task.
        learner: Predicts intentions; the person drives alone without one.
        operator: "mouse" for a person at the page, "surrogate" for a simulated operator to look at.
        assist: Whether the agent takes part at first; the page can switch it.
        authority: What is left to the human; as for :class:`drake_shared.simulation.trial.Simulation`.
        safety_clearance: Kept by a safety filter, in [m]; without one if None.
        record: Folder for the logs; nothing is kept if None.
        host: Address to listen on; loopback unless said otherwise.
        port: Port to listen on; 0 for any that is free.
        open_browser: Whether to open the page in this computer's browser, if it has a display.
        on_trial: Given every trial that is over; returns True to end.

    Raises:
        InputError: The operator is unknown, the folder cannot be written to, or the port is in use.
    """
    interrupted = threading.Event()
    session = open_session(
        scenario,
        learner,
        operator=operator,
        assist=assist,
        authority=authority,
        safety_clearance=safety_clearance,
        record=record,
        host=host,
        port=port,
        interrupted=interrupted,
        on_trial=on_trial,
    )
    with _ends_on_signals(interrupted), session as opened:
        address = opened.server.address
        print(address, flush=True)
        if open_browser and _has_display():
            webbrowser.open(address)
        opened.run()


@contextlib.contextmanager
def open_session(
    scenario: Scenario,
    learner: Learner | None = None,
    *,
    operator: str | Callable[[MouseSource], LeafSystem] = "mouse",
    assist: bool = True,
    authority: Authority | bool | None = None,
    safety_clearance: float | None = None,
    record: str | os.PathLike[str] | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
    interrupted: threading.Event | None = None,
    say: Callable[[str], None] = lambda message: print(message, file=sys.stderr, flush=True),
    on_trial: Callable[[Trial], bool | None] = lambda _: None,
) -> Iterator[Session]:
    """Starts the server, builds the simulation, and yields the session, ready to run.

    All of it, and the session's ``run``, must happen in one thread: Meshcat refuses any other.

    Args:
        operator: As for :func:`drive`, or what makes an operator that reads the driver's seat.
        interrupted: Ends the session when set, from any thread.
        say: Takes messages for the person at the keyboard.

    The others, and what is raised, are those of :func:`drive`.
    """
    if isinstance(operator, str) and operator not in OPERATORS:
        raise InputError("operator", "", f"must be one of {', '.join(OPERATORS)}", repr(operator))
    if record is not None:
        check_writable(record)
    seat = DriverLock(open=operator != "surrogate", assist=assist and learner is not None)
    meshcat = start_meshcat()
    server = CockpitServer(meshcat_url=meshcat.web_url(), seat=seat, host=host, port=port)
    with server, _quick_threads():
        if operator == "mouse":
            driver: LeafSystem | None = MouseInput(robot=scenario.robot, source=seat)
        else:
            driver = operator(seat) if callable(operator) else None
        simulation = Simulation(
            scenario,
            learner=learner,
            operator=driver,
            authority=authority,
            safety_clearance=safety_clearance,
            meshcat=meshcat,
        )
        draw_scene(meshcat, scenario)
        look_from_above(meshcat, scenario)
        yield Session(
            simulation=simulation,
            meshcat=meshcat,
            server=server,
            interrupted=interrupted or threading.Event(),
            record=None if record is None else Path(record),
            say=say,
            on_trial=on_trial,
        )


@contextlib.contextmanager
def _ends_on_signals(interrupted: threading.Event) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda *_: interrupted.set())
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def _quick_threads() -> Iterator[None]:
    """Keeps the simulation and the server from waiting for each other, for BLAS or for the collector."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    gc.collect()
    gc.freeze()
    try:
        with threadpool_limits(limits=1):
            yield
    finally:
        gc.unfreeze()
        sys.setswitchinterval(before)


def _has_display() -> bool:
    """Whether a browser that opens would be seen; text browsers would take over the terminal."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
