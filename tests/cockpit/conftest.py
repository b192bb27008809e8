"""A session in a thread of its own, and a real browser for its page."""

from __future__ import annotations

import collections
import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from drake_shared.cockpit import Session, open_session
from drake_shared.cockpit.chromium import CHROMIUM_ARGUMENTS, find_chromium
from drake_shared.scenario import Circle, Goal, Route, Scenario, Workspace
from drake_shared.simulation.trial import Trial
from drake_shared.systems.mouse_input import MouseInput, StickSettings

PATIENCE = 30.0


def wait_for(condition: Callable[[], object], what: str, patience: float = PATIENCE):
    """Waits until ``condition`` returns a true value, and returns it."""
    deadline = time.monotonic() + patience
    while True:
        value = condition()
        if value:
            return value
        assert time.monotonic() < deadline, f"waited {patience} s for {what}"
        time.sleep(0.005)


@pytest.fixture(scope="session")
def until():
    return wait_for


class ProbedMouse(MouseInput):
    """A MouseInput that records (time, arrival of the sample, command, counter x) of every update."""

    def __init__(self, **options):
        self.readings: collections.deque = collections.deque(maxlen=20_000)
        super().__init__(**options)

    def _update(self, context, state):
        super()._update(context, state)
        now = time.monotonic()
        command = state.get_vector(self._command).value().copy()
        count = state.get_vector(self._mouse).GetAtIndex(0)
        self.readings.append((now, self._source.latest().arrival, command, count))


class RunningCockpit:
    """A session that runs in a thread."""

    def __init__(
        self,
        scenario: Scenario,
        learner,
        record: Path,
        *,
        assist: bool = True,
        operator: str | None = None,
        **options,
    ):
        self.scenario = scenario
        self.record = record
        self.trials: list[Trial] = []
        self.messages: list[str] = []
        self.mouse: ProbedMouse
        self.session: Session
        self._learner = learner
        self._assist = assist
        self._options = options
        self._operator = operator or self._make_mouse
        self._interrupted = threading.Event()
        self._opened = threading.Event()
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="simulation")
        self._thread.start()
        self._opened.wait(4.0 * PATIENCE)  # A loaded machine imports and builds the diagram slowly.
        if self._failure is not None:
            self.stop()

    def _run(self):
        try:
            with open_session(
                self.scenario,
                self._learner,
                operator=self._operator,
                assist=self._assist,
                record=self.record,
                interrupted=self._interrupted,
                report=self.messages.append,
                on_trial=self.trials.append,
                **self._options,
            ) as self.session:
                self._opened.set()
                self.session.run()
        except BaseException as failure:
            self._failure = failure
        finally:
            self._opened.set()

    def _make_mouse(self, source):
        self.mouse = ProbedMouse(robot=self.scenario.robot, source=source)
        return self.mouse

    @property
    def address(self) -> str:
        return self.session.server.address

    @property
    def origin(self) -> str:
        return self.address.partition("/?")[0]

    @property
    def driver_lock(self):
        return self.session.server.driver_lock

    @property
    def command(self) -> np.ndarray:
        return self.mouse.readings[-1][2] if self.mouse.readings else np.zeros(2)

    def next_trial(self, number: int = 1, patience: float = PATIENCE) -> Trial:
        """Waits for the end of trial ``number`` since the last `reset`, and returns it."""
        wait_for(lambda: len(self.trials) >= number, f"the end of trial {number}", patience)
        return self.trials[number - 1]

    def reset(self):
        """Puts the session into its initial state for the next test."""
        wait_for(lambda: self.driver_lock.holder is None, "a free driver lock")
        wait_for(lambda: self.session.phase in ("ready", "finished"), "the end of the trial")
        self.driver_lock.set_stick(0, StickSettings())
        self.driver_lock.set_assist(0, self._assist)
        self.trials.clear()
        self.mouse.readings.clear()
        for path in self.record.iterdir():
            path.unlink()

    @property
    def time(self) -> float:
        """Simulated time of the trial, in [s]: the mouse's system updates every 5 ms."""
        return 0.005 * len(self.mouse.readings)

    def wait_for_time(self, seconds: float):
        """Waits until the trial has run for ``seconds`` of simulated time."""
        wait_for(lambda: self.time >= seconds, f"{seconds} s of driving")

    def interrupt(self):
        self._interrupted.set()

    def stop(self):
        self._interrupted.set()
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive(), "the session does not end"
        if self._failure is not None:
            raise self._failure


def make_short_floor() -> Scenario:
    """A goal 0.5 m straight ahead, with a pillar beside the path: a drive takes a second."""
    return Scenario(
        name="short_floor",
        goal=Goal(x=0.5, y=0.0),
        workspace=Workspace(x_min=-0.5, x_max=1.5, y_min=-0.8, y_max=0.8),
        obstacles=[Circle(name="pillar", x=0.3, y=0.6, radius=0.1)],
        routes=[
            Route(name="straight", waypoints=[[0.0, 0.0], [0.5, 0.0]], sides={"pillar": "right"}),
            Route(name="bent", waypoints=[[0.0, 0.0], [0.25, -0.2], [0.5, 0.0]], sides={"pillar": "right"}),
        ],
        travel_time=1.0,
    )


def make_long_floor() -> Scenario:
    """A goal that no test reaches."""
    return Scenario(
        name="long_floor",
        goal=Goal(x=40.0, y=0.0),
        workspace=Workspace(x_min=-1.0, x_max=41.0, y_min=-10.0, y_max=10.0),
        routes=[Route(name="straight", waypoints=[[0.0, 0.0], [40.0, 0.0]])],
        duration=60.0,
        travel_time=50.0,
    )


@pytest.fixture
def short_floor() -> Scenario:
    return make_short_floor()


@pytest.fixture
def long_floor() -> Scenario:
    return make_long_floor()


@pytest.fixture
def start_cockpit(tmp_path) -> Iterator[Callable[..., RunningCockpit]]:
    with contextlib.ExitStack() as stack:

        def start(scenario: Scenario, learner=None, **options) -> RunningCockpit:
            cockpit = RunningCockpit(scenario, learner, tmp_path / "logs", **options)
            stack.callback(cockpit.stop)
            return cockpit

        yield start


@pytest.fixture(scope="module")
def start_lasting_cockpit(tmp_path_factory) -> Iterator[Callable[..., RunningCockpit]]:
    """For a session that is used by several tests."""
    with contextlib.ExitStack() as stack:

        def start(scenario: Scenario, learner=None, **options) -> RunningCockpit:
            cockpit = RunningCockpit(scenario, learner, tmp_path_factory.mktemp("logs"), **options)
            stack.callback(cockpit.stop)
            return cockpit

        yield start


@pytest.fixture(scope="module")
def _short_cockpit(tmp_path_factory, route_learner) -> Iterator[RunningCockpit]:
    scenario = make_short_floor()
    cockpit = RunningCockpit(scenario, route_learner(scenario), tmp_path_factory.mktemp("logs"))
    yield cockpit
    cockpit.stop()


@pytest.fixture(scope="module")
def _long_cockpit(tmp_path_factory, route_learner) -> Iterator[RunningCockpit]:
    scenario = make_long_floor()
    cockpit = RunningCockpit(scenario, route_learner(scenario), tmp_path_factory.mktemp("logs"))
    yield cockpit
    cockpit.stop()


@pytest.fixture
def cockpit(_short_cockpit) -> RunningCockpit:
    """A session with a goal nearby."""
    _short_cockpit.reset()
    return _short_cockpit


@pytest.fixture
def long_cockpit(_long_cockpit) -> RunningCockpit:
    """A session with a goal far away."""
    _long_cockpit.reset()
    return _long_cockpit


@pytest.fixture(scope="session")
def browser_path() -> str:
    path = find_chromium()
    if path is None:
        reason = "no Chromium: install it or set DRAKE_SHARED_CHROMIUM"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return path


@pytest.fixture(scope="module")
def browser(browser_path):
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=list(CHROMIUM_ARGUMENTS))
        yield browser
        browser.close()


@pytest.fixture
def browser_context(browser):
    # A small window: without a graphics card a large one takes long to draw.
    context = browser.new_context(viewport={"width": 800, "height": 600})
    context.set_default_timeout(1000 * PATIENCE)
    yield context
    context.close()


@pytest.fixture(scope="module")
def lasting_context(browser):
    """For a window that is used by several tests, since a page takes two seconds to load."""
    context = browser.new_context(viewport={"width": 800, "height": 600})
    context.set_default_timeout(1000 * PATIENCE)
    yield context
    context.close()


@pytest.fixture
def other_context(browser):
    """A separate browser context: a second tab would take the focus of the first one and stop it."""
    context = browser.new_context(viewport={"width": 800, "height": 600})
    context.set_default_timeout(1000 * PATIENCE)
    yield context
    context.close()


@pytest.fixture
def client():
    """Runs a coroutine with an aiohttp session in a thread, as Playwright uses this thread's event loop."""
    import asyncio

    import aiohttp

    def run(talk):
        async def main():
            async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as http:
                return await asyncio.wait_for(talk(http), PATIENCE)

        result: list = []

        def work():
            try:
                result.append((asyncio.run(main()), None))
            except BaseException as error:
                result.append((None, error))

        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
        value, error = result[0]
        if error is not None:
            raise error
        return value

    return run
