"""How long it takes from a mouse event in a real browser until MouseInput's state answers it."""

from __future__ import annotations

import copy
import dataclasses
import math
import os
import queue
import shutil
import threading
import time
from typing import Any

import numpy as np

from drake_shared.cockpit.drive import open_session
from drake_shared.cockpit.session import Session
from drake_shared.common.errors import RunError
from drake_shared.learners import Learner
from drake_shared.scenario import Scenario, load_scenario
from drake_shared.systems.mouse_input import MouseInput, StickSettings

CHROMIUM_ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
"""For a Chromium without screen and graphics card, that calls nobody, and runs as root too."""

# So small that the stick does not come to its stop: its way is compared with the sum of all moves.
_GAIN = 0.001
_PATIENCE = 30.0

_LISTEN = """() => {
  const events = (window.mouseEvents = []);
  let moved = 0;
  addEventListener("pointerrawupdate", (event) => {
    moved += event.movementX;
    events.push([performance.timeOrigin + event.timeStamp, moved]);
  });
}"""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Latency:
    """From the browser's event to MouseInput's state, which is sampled every 5 ms.

    Attributes:
        events: How many mouse events the page saw.
        sent: Displacement that was made, in counts.
        counted: Displacement that MouseInput's counter shows, in counts.
        stick: Displacement that the stick made, in counts.
        p50, p90, p99: Percentiles over the events, in [s].
        late_steps: Control steps of the trial around it that came late by more than a period.
    """

    events: int
    sent: float
    counted: float
    stick: float
    p50: float
    p90: float
    p99: float
    late_steps: int


class ObservedMouse(MouseInput):
    """A MouseInput that notes when each change of its counter was in its state: (time of day, counter)."""

    def __init__(self, **options: Any) -> None:
        self.seen: list[tuple[float, float]] = []
        super().__init__(**options)

    def _update(self, context, state) -> None:
        super()._update(context, state)
        counter = state.get_vector(self._mouse).GetAtIndex(0)
        if not self.seen or counter != self.seen[-1][1]:
            self.seen.append((time.time(), counter))


def find_chromium() -> str | None:
    """A Chromium: the one that $DRAKE_SHARED_CHROMIUM names, which may be none, or one on the path."""
    given = os.environ.get("DRAKE_SHARED_CHROMIUM")
    if given is not None:
        return given or None
    names = ("chromium", "chromium-browser", "google-chrome")
    return next(filter(None, map(shutil.which, names)), None)


def measure_latency(
    *,
    scenario: Scenario | None = None,
    learner: Learner | None = None,
    events: int = 600,
    rate: float = 60.0,
    viewport: tuple[int, int] = (640, 480),
    chromium: str | None = None,
) -> Latency:
    """Drives a trial by real mouse events in a headless Chromium, through the whole page.

    Args:
        scenario: The task, given time enough; the one that ships if None.
        learner: Predicts intentions meanwhile, if given.
        events: How many moves to make, of one count each.
        rate: How many a second.
        viewport: Size of the window.
        chromium: Path of the browser.

    Raises:
        RunError: There is no browser or no Playwright, or the drive does not come about.
    """
    path = chromium or find_chromium()
    if path is None:
        raise RunError("no Chromium found; name one in DRAKE_SHARED_CHROMIUM")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise RunError("measuring latency needs Playwright: pip install 'drake_shared[test]'") from error
    scenario = copy.deepcopy(scenario or load_scenario())
    # A machine that is busy must not come to the end of the trial before the end of the moves.
    enough = math.ceil((3.0 * events / rate + 30.0) / scenario.control_period)
    scenario.duration = enough * scenario.control_period
    with _Drive(scenario, learner) as drive, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(CHROMIUM_ARGUMENTS))
        page = browser.new_page(viewport={"width": viewport[0], "height": viewport[1]})
        page.goto(drive.session.server.address)
        page.click("#drive:enabled")
        page.wait_for_selector("body[data-seat=yours]")
        drive.session.server.seat.set_stick(drive.session.server.seat.holder or 0, StickSettings(gain=_GAIN))
        page.mouse.move(0, 240)
        drive.wait_until_still()
        base = drive.mouse.seen[-1][1]
        page.evaluate(_LISTEN)
        _move_evenly(page, events, rate)
        drive.wait_until_still()
        log = np.array(page.evaluate("window.mouseEvents"))
        page.keyboard.press("Escape")
        trial = drive.trials.get(timeout=_PATIENCE)
        browser.close()
    seen = np.array(drive.mouse.seen)
    first = np.searchsorted(seen[:, 1], base + log[:, 1])
    delays = seen[np.minimum(first, len(seen) - 1), 0] - log[:, 0] / 1000.0
    held = trial["stick_left"][trial["engaged"] > 0][-1]
    return Latency(
        events=len(log),
        sent=float(events),
        counted=float(seen[-1, 1] - base),
        stick=float(-held / _GAIN - base),
        p50=float(np.percentile(delays, 50)),
        p90=float(np.percentile(delays, 90)),
        p99=float(np.percentile(delays, 99)),
        late_steps=trial.metadata["real_time"]["late_steps"],
    )


def _move_evenly(page: Any, events: int, rate: float) -> None:
    start = time.perf_counter()
    for index in range(1, events + 1):
        time.sleep(max(start + index / rate - time.perf_counter(), 0.0))
        page.mouse.move(index, 240)


class _Drive:
    """A session in a thread of its own."""

    def __init__(self, scenario: Scenario, learner: Learner | None) -> None:
        self.trials: queue.Queue = queue.Queue()
        self.session: Session
        self.mouse: ObservedMouse
        self._scenario = scenario
        self._learner = learner
        self._opened: queue.Queue[BaseException | None] = queue.Queue()
        self._interrupted = threading.Event()
        self._thread = threading.Thread(target=self._run, name="simulation")

    def __enter__(self) -> _Drive:
        self._thread.start()
        failure = self._opened.get()
        if failure is not None:
            raise failure
        return self

    def __exit__(self, *_: object) -> None:
        self._interrupted.set()
        self._thread.join()

    def wait_until_still(self) -> None:
        """Waits until the counter has not changed for a while."""
        deadline = time.time() + _PATIENCE
        while not self.mouse.seen or time.time() - self.mouse.seen[-1][0] < 0.3:
            if time.time() > deadline:
                raise RunError("the mouse's moves do not reach the simulation")
            time.sleep(0.02)

    def _run(self) -> None:
        try:
            with open_session(
                self._scenario,
                self._learner,
                operator=self._make_mouse,
                assist=False,
                interrupted=self._interrupted,
                say=lambda _: None,
                on_trial=self.trials.put,
            ) as self.session:
                self._opened.put(None)
                self.session.run()
        except BaseException as failure:
            self._opened.put(failure)

    def _make_mouse(self, seat) -> ObservedMouse:
        self.mouse = ObservedMouse(robot=self._scenario.robot, source=seat)
        return self.mouse
