"""Every state of the page at every size: nothing is cut off or overlaps, and axe-core finds no fault."""

import re
from pathlib import Path
from typing import get_args

import pytest

from drake_shared.cockpit import CockpitServer, DriverLock, describe_now, describe_scene, start_meshcat
from drake_shared.cockpit.drive_history import DriveHistory
from drake_shared.cockpit.messages import Discard, Setup, Train
from drake_shared.cockpit.page_state import describe_result
from drake_shared.cockpit.reasons import Reason, Surroundings
from drake_shared.cockpit.trial_choices import TrialChoices
from drake_shared.learners import load_learner
from drake_shared.scenario import load_scenario
from drake_shared.systems.mouse_input import MouseInput

pytestmark = pytest.mark.browser

# The last three are 1280x800, 1920x1080 and 800x600 magnified by two.
SIZES = [
    (1280, 800),
    (1920, 1080),
    (960, 600),
    (800, 600),
    (390, 844),
    (360, 740),
    (640, 400),
    (400, 300),
]

FAULTS = (Path(__file__).parent / "layout_faults.js").read_text(encoding="utf-8")
# What a driver must see without scrolling, which is not possible while the mouse is captured.
ESSENTIAL = ("#status", "#why", "#share-bar", "#drive", "#time-left", "#stage")
IN_VIEW = """(selectors) => {
  scrollTo(0, 0);
  return selectors.filter((selector) => {
    const box = document.querySelector(selector).getBoundingClientRect();
    return box.bottom > innerHeight + 1 || box.top < -1 || box.width < 1;
  });
}"""


class Inspector:
    """A page that is looked at in every size, in one state after the other."""

    def __init__(self, page, violations):
        self._page = page
        self._violations = violations
        self.faults: list[str] = []

    def inspect(self, state: str, *, driving: bool = False, brief: bool = False):
        """Inspects a state; a brief inspection has the sizes and the theme in which most goes wrong."""
        for width, height in SIZES[-4:] if brief else SIZES:
            self._resize(width, height)
            where = f"{state} at {width}x{height}: "
            self.faults += [where + fault for fault in self._page.evaluate(f"({FAULTS})()")]
            if driving and height >= 400:
                wanted = [*ESSENTIAL, "#legend"] if width > 900 else [*ESSENTIAL]
                missing = self._page.evaluate(IN_VIEW, wanted)
                self.faults += [f"{where}{selector} is not in view" for selector in missing]
        themes = [("light", (1280, 800)), ("dark", (390, 844))]
        for theme, size in themes[1:] if brief else themes:
            self._page.evaluate("(theme) => { document.documentElement.dataset.theme = theme; }", theme)
            self._resize(*size)
            self.faults += [f"{state}, {theme}, {size}: {fault}" for fault in self._violations(self._page)]

    def _resize(self, width: int, height: int):
        self._page.set_viewport_size({"width": width, "height": height})
        self._page.wait_for_function(f"() => innerWidth === {width} && innerHeight === {height}")


NOW = {
    "human_weight": 0.4,
    "confidence": 0.6,
    "human_left": 3.0,
    "human_right": 2.0,
    "autonomous_left": 2.0,
    "autonomous_right": 3.0,
    "shared_left": 2.5,
    "shared_right": 2.5,
    "x": 0.5,
    "y": 0.1,
    "yaw": 0.2,
    "clearance": 0.4,
    "stick_forward": 0.5,
    "stick_left": -0.2,
}


class Stage:
    """A server without a simulation, on which the test sets what the page shows."""

    def __init__(self, server: CockpitServer, scenario, trial, until):
        result = describe_result(trial, "two_obstacles_20260101-120000_001.parquet", None) | {"number": 2}
        self._server = server
        self.driver_lock = server.driver_lock
        self.until = until
        self._result = result
        self.address = server.address
        mouse = MouseInput(robot=scenario.robot, source=server.driver_lock)
        server.publish("scene", describe_scene(scenario, mouse, load_learner("two_obstacles")))
        choices = TrialChoices(scenario, load_learner("two_obstacles"))
        server.publish("setup", choices.describe(usable_drives=3) | {"fixed": False})
        self._history = DriveHistory(None)
        server.rows = self._history.rows
        for number, mode in ((1, "human"), (2, "shared")):
            self._history.add(number, result | {"number": number, "mode": mode}, trial)
        server.publish("history", self._history.describe())
        self.set_phase("ready")

    def publish(self, topic: str, content: dict):
        self._server.publish(topic, content)

    def set_phase(self, phase: str):
        result = self._result if phase == "finished" else None
        self._server.publish("trial", {"phase": phase, "number": 0, "mode": "shared", "result": result})

    def set_now(self, reason: str, **changes):
        look = Surroundings(open_routes=2, distance=0.1)
        self._server.publish("now", describe_now(NOW | changes, 3.0, reason=reason, surroundings=look))


@pytest.fixture(scope="module")
def stage(human_trial, until):
    meshcat = start_meshcat()
    # axe-core blocks the page for seconds, in which it sends no heartbeat.
    lock = DriverLock(lost_after=1e3)
    with CockpitServer(meshcat_url=meshcat.web_url(), driver_lock=lock, port=0) as server:
        yield Stage(server, load_scenario("two_obstacles"), human_trial, until)


def open_page(context, stage):
    stage.set_phase("ready")
    page = context.new_page()
    page.goto(stage.address)
    page.wait_for_selector("#deck[data-phase=ready]")
    page.evaluate("viewer.animate = () => {}; do_reconnect = false; viewer.connection.close()")
    return page


@pytest.fixture
def page(browser_context, stage):
    # The page of the last test may still be closing.
    stage.until(lambda: stage.driver_lock.holder is None, "a free driver lock")
    page = open_page(browser_context, stage)
    yield page
    page.close()


@pytest.fixture(scope="module")
def _lasting_page(lasting_context, stage):
    page = open_page(lasting_context, stage)
    page.click("#intro-skip")
    return page


@pytest.fixture
def lasting_page(_lasting_page, stage):
    """A page without its introduction that is used by several tests."""
    yield _lasting_page
    _lasting_page.keyboard.press("Escape")
    stage.until(lambda: stage.driver_lock.holder is None, "a free driver lock")
    stage.set_phase("ready")
    _lasting_page.wait_for_selector("#deck[data-phase=ready]")


def inspect_tabs(page, inspector: Inspector, state: str):
    for tab in page.query_selector_all("[role=tab]"):
        if tab.is_visible():
            tab.click()
            inspector.inspect(f"{state}, {tab.get_attribute('id')}")


def test_every_state_is_whole_at_every_size_and_accessible(page, stage, violations):
    inspector = Inspector(page, violations)
    inspector.inspect("introduction")
    page.click("#intro-skip")
    inspect_tabs(page, inspector, "ready")
    stage.set_phase("finished")
    page.wait_for_selector("#deck[data-phase=finished]")
    inspect_tabs(page, inspector, "finished")
    page.click("#drive")
    page.wait_for_selector("body[data-driver-lock=yours]")
    stage.set_phase("armed")
    page.wait_for_selector("#deck[data-phase=armed]")
    inspector.inspect("armed", driving=True, brief=True)
    stage.set_phase("driving")
    stage.set_now("contact", contact=1.0)
    page.wait_for_selector("#deck[data-phase=driving]")
    page.wait_for_selector("#why[data-reason=contact]")
    inspector.inspect("driving", driving=True)
    page.keyboard.press("Escape")
    page.wait_for_selector("body[data-driver-lock=free]")
    assert stage.driver_lock.engage(0)
    page.wait_for_selector("body[data-driver-lock=taken]")
    inspector.inspect("watching", brief=True)
    stage.driver_lock.release(0)
    assert inspector.faults == [], "\n".join(inspector.faults)


@pytest.mark.parametrize("watching", [False, True])
def test_every_reason_has_a_sentence_for_driver_and_watcher(lasting_page, stage, watching):
    page = lasting_page
    if not watching:
        page.click("#drive")
        page.wait_for_selector("body[data-driver-lock=yours]")
    said = set()
    for reason in get_args(Reason):
        # A new drive begins without the reason of the last one.
        stage.set_phase("armed")
        page.wait_for_selector("#deck[data-phase=armed]")
        stage.set_phase("driving")
        stage.set_now(reason)
        page.wait_for_selector(f"#why[data-reason={reason}]")
        text = page.inner_text("#why")
        assert len(text) > 10
        if watching:
            assert not re.search(r"\b[Yy]ou", text)
        said.add(text)
    assert len(said) == len(get_args(Reason))


def test_the_noise_found_stands_in_place_of_a_confidence_that_nobody_uses(lasting_page, stage):
    page = lasting_page
    stage.set_phase("driving")
    for now, label, value in (
        ({"driver_noise": 0.9}, "The commands waver by", "0.9 rad/s"),
        ({}, "The agent is sure of the route", "60 %"),
    ):
        stage.set_now("steady", **now)
        page.wait_for_function(
            "(value) => document.querySelector('#confidence').textContent === value", arg=value
        )
        assert page.inner_text("#confidence-label") == label


def test_the_page_asks_for_other_trials_a_learner_and_the_end_of_a_drive(lasting_page, stage):
    page = lasting_page

    def requests():
        found = []
        while (request := stage.driver_lock.take_request()) is not None:
            found.append(request)
        return found

    page.click("#tab-setup")
    page.select_option("#choice-route", "left_right")
    page.select_option("#choice-arbitration", "halves")
    page.fill("#choice-confidence_gain", "12.5")
    page.check("#choice-tone")
    page.select_option("#choice-resistance", "0.5")
    page.click("#train")
    page.click("#tab-history")
    page.click("button[aria-label='Delete drive 1']")
    asked = []
    stage.until(lambda: asked.extend(requests()) or Discard(1) in asked, "the requests")
    assert Train() in asked
    last = [request for request in asked if isinstance(request, Setup)][-1]
    assert (last.scenario, last.learner, last.route) == (
        "two_obstacles",
        "two_obstacles_default",
        "left_right",
    )
    assert (last.arbitration, last.confidence_gain) == ("halves", 12.5)
    assert (last.rumble, last.tone, last.resistance) == (False, True, 0.5)


def test_two_drives_are_replayed_beside_each_other(lasting_page):
    page = lasting_page
    page.click("#tab-history")
    page.wait_for_selector("#replay-time")
    page.wait_for_function("() => document.querySelectorAll('.replay figure').length === 2")
    robots = page.locator(".replay .robot")
    end = robots.first.get_attribute("transform")
    page.fill("#replay-time", "0")
    assert robots.first.get_attribute("transform") != end
    page.click("#replay-play")
    page.wait_for_function("() => Number(document.querySelector('#replay-time').value) > 0.2")
    page.uncheck("#compare-1")
    page.wait_for_function("() => document.querySelectorAll('.replay figure').length === 1")


def test_a_touch_stick_drives_and_springs_back(browser, stage):
    lock = stage.driver_lock
    stage.set_phase("ready")
    with browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True) as context:
        page = context.new_page()
        page.goto(stage.address)
        page.wait_for_selector("#deck[data-phase=ready]")
        page.tap("#drive")
        page.wait_for_selector("body[data-driver-lock=yours]")
        stage.set_phase("driving")
        page.wait_for_selector("#deck[data-phase=driving]")
        box = page.locator("#touch-stick").bounding_box()
        middle = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
        touch = context.new_cdp_session(page)

        def send(kind: str, *points: dict):
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": list(points)})

        send("touchStart", middle)
        send("touchMove", middle | {"y": middle["y"] - box["height"]})
        stage.until(lambda: lock.latest().forward == 1.0, "the touch stick")
        assert not lock.latest().braking
        send("touchEnd")
        stage.until(lambda: lock.latest().forward == 0.0 and lock.latest().braking, "the stick in its middle")
        send("touchStart", middle)
        stage.until(lambda: not lock.latest().braking, "the end of the stop")
        # Text that needs another line moves the stick away under the finger.
        page.evaluate("document.querySelector('#touch-stick').style.top = '-40px'")
        send("touchMove", middle | {"x": middle["x"] - box["width"]})
        stage.until(lambda: lock.latest().turn == 1.0, "the touch stick")
        assert lock.latest().forward == 0.0
        send("touchEnd")


def test_the_keyboard_alone_suffices(browser_context, cockpit):
    page = browser_context.new_page()
    page.goto(cockpit.address)
    page.wait_for_selector("#drive:enabled")
    page.wait_for_selector("#tab-setup")
    page.wait_for_selector("#choice-route")
    reached = set()
    page.evaluate("document.body.tabIndex = -1; document.body.focus()")
    for _ in range(30):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id"))
    controls = page.evaluate(
        "[...document.querySelectorAll('button, input, select')]"
        ".filter((control) => control.checkVisibility() && !control.disabled && control.tabIndex >= 0)"
        ".map((control) => control.id)"
    )
    assert set(controls) - reached == set()
    page.focus("#drive")
    page.keyboard.press("Enter")
    page.wait_for_selector("#deck[data-phase=armed]")
    page.keyboard.down("ArrowUp")
    trial = cockpit.next_trial()
    assert trial.status == "reached"
    assert trial["stick_forward"].max() == 1.0


# A browser without WebGL and without pointer lock.
PLAIN_BROWSER = """
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...options) {
  return kind.startsWith("webgl") ? null : getContext.call(this, kind, ...options);
};
delete Element.prototype.requestPointerLock;
"""


def test_without_webgl_and_pointer_lock_one_drives_on_a_flat_drawing(browser_context, stage, violations):
    stage.set_phase("ready")
    page = browser_context.new_page()
    page.add_init_script(PLAIN_BROWSER)
    page.goto(stage.address)
    page.wait_for_selector("#deck[data-phase=ready]")
    page.click("#intro-skip")
    inspector = Inspector(page, violations)
    inspector.inspect("without WebGL")
    assert inspector.faults == [], "\n".join(inspector.faults)
    page.set_viewport_size({"width": 800, "height": 600})
    page.click("#drive")
    page.wait_for_selector("body[data-driver-lock=yours]")
    stage.set_phase("driving")
    # The drawing is centred on the middle of the workspace, at x = 2.5 m.
    for reason, x in (("sure", 0.2), ("contact", 0.7)):
        stage.set_now(reason, x=x)
        page.wait_for_selector(f"#why[data-reason={reason}]")
        at = f"[transform^='translate({x - 2.5:g} ']"
        page.wait_for_selector(f"#flat-scene .robot{at}", state="attached")
    page.mouse.move(400, 300)
    page.mouse.move(400, 250, steps=5)
    stage.until(lambda: stage.driver_lock.latest().y < 0, "the mouse")
    page.close()


def test_a_page_comes_back_by_itself_when_the_server_does(
    browser_context, stage, start_cockpit, short_floor, violations
):
    cockpit = start_cockpit(short_floor, token="a key that stays the same")
    port = cockpit.session.server.port
    page = browser_context.new_page()
    page.goto(cockpit.address)
    page.wait_for_selector("#deck[data-phase=ready]")
    cockpit.stop()
    page.wait_for_selector("body.offline")
    assert page.is_disabled("#drive")
    page.click("#intro-skip")
    inspector = Inspector(page, violations)
    inspector.inspect("offline", brief=True)
    assert inspector.faults == [], "\n".join(inspector.faults)
    start_cockpit(short_floor, token="a key that stays the same", port=port)
    page.wait_for_selector("body.cockpit:not(.offline) #deck[data-phase=ready]")
    page.wait_for_selector("#drive:enabled")


def test_a_page_without_the_key_says_what_to_do(browser_context, stage, violations):
    page = browser_context.new_page()
    page.goto(stage.address.partition("?")[0])
    assert "drake-shared printed" in page.inner_text("main")
    assert violations(page) == []


def test_teaching_says_which_demonstration_and_whether_it_is_kept(page, stage, violations):
    # The last test of its stage: pages that come later receive these messages too.
    page.click("#intro-skip")
    told = {"wanted": 3, "kept": 1, "routes": {"left_right": 1}, "last": 2, "void": None}
    stage.publish("teaching", told)
    stage.set_phase("finished")
    page.wait_for_selector("#deck[data-phase=finished]")
    page.wait_for_selector("#lesson:not([hidden])")
    assert "2 of 3" in page.inner_text("#task")
    assert "1 of 3" in page.inner_text("#assistance-used")
    inspector = Inspector(page, violations)
    inspector.inspect("teaching")
    page.click("#discard")
    stage.until(lambda: stage.driver_lock.take_request() == Discard(2), "the request")
    stage.publish("teaching", told | {"void": "contact"})
    page.wait_for_selector("#discard", state="hidden")
    assert "contact" in page.inner_text("#assistance-used")
    inspector.inspect("teaching, not kept", brief=True)
    assert inspector.faults == [], "\n".join(inspector.faults)
