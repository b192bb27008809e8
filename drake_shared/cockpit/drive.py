"""Serves the page and runs trials on it until interrupted."""

from __future__ import annotations

import contextlib
import functools
import gc
import os
import queue
import signal
import sys
import threading
import webbrowser
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from pydrake.systems.framework import LeafSystem

from drake_shared.cockpit.demonstration_collector import DemonstrationCollector
from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.cockpit.meshcat_proxy import start_meshcat
from drake_shared.cockpit.server import DEFAULT_PORT, CockpitServer
from drake_shared.cockpit.session import Session
from drake_shared.cockpit.stored_key import stored_key
from drake_shared.cockpit.trial_choices import FREE, TrialChoices
from drake_shared.common.console import say
from drake_shared.common.errors import DrakeSharedError, InputError
from drake_shared.common.files import check_writable
from drake_shared.common.suggestions import suggestion
from drake_shared.common.threads import single_threaded
from drake_shared.learners import Learner
from drake_shared.robots import Arm
from drake_shared.scenario import Scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.journal import load_writer, recover_trials
from drake_shared.simulation.scene_drawing import center_scene
from drake_shared.simulation.trial import Simulation, Trial
from drake_shared.systems.operators import make_operator, registered_operators
from drake_shared.systems.tip_input import make_mouse_input

OPERATORS = ("mouse", "surrogate")

# Interval at which Python switches threads, in [s]; the default of 5 ms would add noticeable delay.
_SWITCH_INTERVAL = 0.0005


def drive(
    scenario: Scenario,
    learner: Learner | None = None,
    *,
    operator: str = "mouse",
    assist: bool = True,
    route: str = FREE,
    config: SharedControlConfig | None = None,
    record: str | os.PathLike[str] | None = None,
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    allowed_hosts: Collection[str] = (),
    proxy: str | None = None,
    open_browser: bool = True,
    teaching: DemonstrationCollector | None = None,
    on_trial: Callable[[Trial], bool | None] = lambda _: None,
) -> None:
    """Serves the page and runs trials in real time, one after another, until interrupted.

    The page's address, key included, is printed to standard output, messages to standard error. In the main
    thread SIGINT, SIGTERM and SIGHUP end the session, after the current trial is saved. If the process is
    killed, the next session with the same folder saves what was driven up to a second before.

    Args:
        scenario: The task.
        learner: Predicts intentions; if None, the person drives alone.
        operator: "mouse" for a person at the page, "surrogate" for a simulated operator, or the name of one
            that is registered.
        route: Name of the route that the person is asked to drive, which the page shows; "ask": the person
            names one before each trial; "free": no route is instructed. Logs carry it.
        assist: Whether the agent takes part in the first trial; the page can switch it.
        config: How control is shared; if None, the one that the learner's preset names.
        record: Folder for the logs; if None, nothing is saved.
        host: Address to listen on.
        port: Port to listen on; 0 takes any free port. The key of another port is that of the last session on
            it, if that is at most 12 hours old, so that pages that are still open come back.
        allowed_hosts, proxy: See :class:`CockpitServer`.
        open_browser: Whether to open the page in this computer's browser, if it has a display.
        teaching: Collects the drives as demonstrations; no logs are kept then, and the page can choose
            nothing but the route.
        on_trial: Called with every finished trial; the session ends when it returns True.

    Raises:
        InputError: The operator is unknown, the folder cannot be written to, or the port is in use.
    """
    interrupted = threading.Event()
    session = open_session(
        scenario,
        learner,
        operator=operator,
        assist=assist,
        route=route,
        config=config,
        record=record,
        host=host,
        port=port,
        allowed_hosts=allowed_hosts,
        proxy=proxy,
        token=stored_key(port),
        interrupted=interrupted,
        teaching=teaching,
        on_trial=on_trial,
    )
    with _set_on_signals(interrupted), session as opened:
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
    operator: str | Callable[[DriverLock], LeafSystem] = "mouse",
    assist: bool = True,
    route: str = FREE,
    config: SharedControlConfig | None = None,
    record: str | os.PathLike[str] | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
    allowed_hosts: Collection[str] = (),
    proxy: str | None = None,
    token: str | None = None,
    interrupted: threading.Event | None = None,
    teaching: DemonstrationCollector | None = None,
    report: Callable[[str], None] = say,
    choices: TrialChoices | None = None,
    on_trial: Callable[[Trial], bool | None] = lambda _: None,
) -> Iterator[Session]:
    """Starts the server, builds the simulation, and yields the session, ready to run.

    Use it in place of :func:`drive` for an operator of your own, or to run a session in another thread. The
    context manager and the session's ``run`` must be used in the same thread, as Meshcat requires.

    Args:
        scenario, learner, assist, route, config, record, host, port, allowed_hosts, proxy, teaching,
            on_trial: See :func:`drive`.
        operator: As for :func:`drive`, or a function that returns the operator: a LeafSystem with a vector
            output port ``human_command``, in wheel speeds [rad/s], that has no direct feedthrough. The
            function is called once with the :class:`DriverLock`, whose ``latest()`` is the newest sample
            of the page. A subclass of MouseInput is driven from the page, trial by trial; with any other
            operator trials follow one another, and the pages watch.
        token: The key in the page's address; random if None.
        interrupted: Ends the session when set, from any thread.
        report: Called with messages for the user.
        choices: Says what each trial is, in place of the first arguments; nothing can then be chosen on the
            page, and a single one connects.

    Yields:
        The session; its ``run`` returns when the session ends.

    Raises:
        InputError: See :func:`drive`.
    """
    if isinstance(operator, str) and operator not in OPERATORS:
        names = (*OPERATORS, *registered_operators())
        if operator not in names:
            expected = f"must be one of {', '.join(names)}{suggestion(operator, names)}"
            raise InputError("operator", "", expected, repr(operator))
        operator = functools.partial(_make_registered, operator, scenario)
    if record is not None:
        check_writable(record)
        load_writer()
        _recover(Path(record), report)
    assisted = assist and learner is not None and (config is None or config.driver != "human")
    fixed = choices is not None
    choices = choices or TrialChoices(scenario, learner, config, route=route)
    driver_lock = DriverLock(enabled=operator != "surrogate", assist=assisted)
    meshcat = start_meshcat()
    server = CockpitServer(
        meshcat_url=meshcat.web_url(),
        driver_lock=driver_lock,
        host=host,
        port=port,
        allowed_hosts=allowed_hosts,
        proxy=proxy,
        token=token,
        fixed=fixed,
    )
    with server, _low_latency():

        def build(chosen: TrialChoices) -> Simulation:
            meshcat.Delete()
            if operator == "mouse":
                system: LeafSystem | None = make_mouse_input(chosen.scenario.robot, driver_lock)
            else:
                system = operator(driver_lock) if callable(operator) else None
            simulation = Simulation(
                chosen.scenario,
                learner=chosen.learner,
                config=chosen.config,
                operator=system,
                meshcat=meshcat,
                # The page draws the routes of robots on the floor itself.
                show_intention=isinstance(chosen.scenario.robot, Arm),
            )
            center_scene(meshcat, chosen.scenario)
            return simulation

        yield Session(
            simulation=build(choices),
            choices=choices,
            rebuild=None if fixed or teaching is not None or operator == "surrogate" else build,
            server=server,
            interrupted=interrupted or threading.Event(),
            record=None if record is None else Path(record),
            teaching=teaching,
            report=report,
            on_trial=on_trial,
        )


@contextlib.contextmanager
def _set_on_signals(interrupted: threading.Event) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    # One that is ignored stays so: nohup ignores SIGHUP.
    before = {n: handler for n in numbers if (handler := signal.getsignal(n)) is not signal.SIG_IGN}
    # A handler that set the event itself would wait for ever if it ran while this thread had its lock.
    received: queue.SimpleQueue[bool] = queue.SimpleQueue()

    def relay() -> None:
        while received.get():
            interrupted.set()

    relaying = threading.Thread(target=relay, name="signals", daemon=True)
    relaying.start()
    for number in before:
        signal.signal(number, lambda *_: received.put(True))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        received.put(False)
        relaying.join()


def _make_registered(name: str, scenario: Scenario, source: DriverLock) -> LeafSystem:
    return make_operator(name, scenario=scenario, source=source)


def _recover(folder: Path, report: Callable[[str], None]) -> None:
    """Saves the trials that were under way when earlier sessions with this folder were killed."""
    try:
        for path in recover_trials(folder):
            report(f"Recovered a trial that was under way when its session was killed: {path}")
    except DrakeSharedError as error:
        report(f"A trial of an earlier session cannot be recovered now: {error}")


@contextlib.contextmanager
def _low_latency() -> Iterator[None]:
    """Avoids delays by thread switching, BLAS threads and garbage collection."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    gc.collect()
    gc.freeze()
    try:
        with single_threaded():
            yield
    finally:
        gc.unfreeze()
        sys.setswitchinterval(before)


def _has_display() -> bool:
    """Returns whether a browser can open a window; a text browser would take over the terminal."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
