"""The page in a real browser, driven by real mouse and keyboard events."""

import http.server
import itertools
import re
import threading

import numpy as np
import pytest

pytestmark = pytest.mark.browser


class Page:
    """A browser window with the page, and the errors of its console."""

    def __init__(self, context, cockpit):
        self.cockpit = cockpit
        self.console_errors: list[str] = []
        self.page = context.new_page()
        self.page.on("pageerror", lambda error: self.console_errors.append(str(error)))
        self.page.on("console", self._listen)

    def _listen(self, message):
        if message.type == "error":
            self.console_errors.append(message.text)

    def open(self, *, drawn: bool = False) -> "Page":
        self.page.goto(self.cockpit.address)
        self.page.wait_for_selector("#deck[data-phase]:not([data-phase=connecting])")
        if not drawn:
            # Without a graphics card rendering takes most of the time, and most tests do not need it.
            self.page.evaluate("viewer.animate = () => {}; do_reconnect = false; viewer.connection.close()")
        return self

    def engage(self) -> "Page":
        self.page.click("#drive:enabled")
        self.page.wait_for_selector("body[data-driver-lock=yours]")
        return self

    def push_forward(self, counts: int = 250, steps: int = 25):
        """Moves the mouse away from the driver in small steps, starting at the button."""
        box = self.page.locator("#drive").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        for step in range(1, steps + 1):
            self.page.mouse.move(x, y - counts * step / steps)

    def wait_until_drawn(self):
        """Waits until the scene shows several colours. With a graphics card its pixels cannot be read."""
        self.page.wait_for_function(f"({COLORS})() > 5")

    def wait_for_phase(self, phase: str):
        self.page.wait_for_selector(f"#deck[data-phase={phase}]")

    def wait_for_reason(self, reason: str):
        self.page.wait_for_selector(f"#why[data-reason={reason}]")

    def text(self, selector: str) -> str:
        return self.page.inner_text(selector)

    def wait_for_text(self, selector: str, pattern: str):
        self.page.wait_for_function(
            "([selector, pattern]) => new RegExp(pattern).test(document.querySelector(selector).innerText)",
            arg=[selector, pattern],
        )


def middle_of(page: Page, selector: str) -> tuple[float, float]:
    box = page.page.locator(selector).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@pytest.fixture
def window(browser_context, cockpit):
    return lambda **options: Page(browser_context, cockpit).open(**options)


@pytest.fixture(scope="module")
def lasting_pages(lasting_context):
    """Windows that tests leave open for the next test."""
    return []


@pytest.fixture
def lasting_page(lasting_pages, lasting_context, long_cockpit):
    if not lasting_pages or lasting_pages[-1].page.is_closed():
        lasting_pages.append(Page(lasting_context, long_cockpit).open())
    return lasting_pages[-1]


@pytest.fixture
def driving(lasting_page, long_cockpit, until):
    """A window whose driver pushes forward, with the robot moving and the goal far away."""
    page = lasting_page.engage()
    page.push_forward()
    until(lambda: np.all(long_cockpit.command > 0), "the robot to be driven")
    yield page
    if not page.page.is_closed():
        page.page.keyboard.press("Escape")


def assert_stopped_within(cockpit, since: float, limit: float = 0.2):
    """Asserts that the command was zero ``limit`` after ``since``, plus the longest stall of this machine."""
    readings = list(cockpit.mouse.readings)
    stopped = next(now for now, _, command, _ in readings if now > since and not command.any())
    stall = max(b[0] - a[0] for a, b in itertools.pairwise(readings))
    assert stopped - since <= limit + stall


def assert_saved_and_at_rest(cockpit, trial, status):
    assert trial.status == status
    assert abs(trial["wheel_left"][-1]) + abs(trial["wheel_right"][-1]) <= 1e-6
    wheels = np.stack([trial["wheel_left"], trial["wheel_right"]])
    robot = cockpit.scenario.robot
    fastest = np.abs(np.diff(wheels) / np.diff(trial["t"])).max()
    assert fastest <= robot.max_acceleration / robot.wheel_radius + 1e-6
    assert len(list(cockpit.record.iterdir())) == 1
    assert cockpit.driver_lock.holder is None


# Number of colours in the rendered scene.
COLORS = """() => {
  const canvas = document.querySelector("#meshcat-pane canvas.readback");
  if (!canvas) return Infinity;
  const { width, height } = canvas;
  const pixels = new Uint32Array(canvas.getContext("2d").getImageData(0, 0, width, height).data.buffer);
  return new Set(pixels).size;
}"""


def test_the_mouse_drives_to_the_goal_and_the_page_shows_the_result(window, cockpit):
    page = window(drawn=True)
    assert page.page.url == cockpit.origin + "/"
    page.page.wait_for_selector("#drive:enabled")
    page.page.wait_for_function("document.title === 'drake_shared: short_floor'")
    page.engage()
    assert page.page.evaluate("document.pointerLockElement?.id") == "mouse-area"
    assert page.page.is_visible("#mouse-area")
    page.wait_for_phase("armed")
    page.wait_until_drawn()
    page.push_forward()
    page.wait_for_phase("finished")
    page.wait_until_drawn()
    trial = cockpit.next_trial()
    assert trial.status == "reached"
    assert trial["mouse_y"][-1] < 0
    page.wait_for_text("#outcome", "Goal reached")
    assert page.text("#assistance-used") == "with assistance"
    assert re.search(r"Effort\s+\d+ rad", page.text("#metrics"))
    assert page.page.is_visible("#result-chart svg")
    assert page.page.locator("#result-map svg .driven").count() == 1
    assert f"Saved as {next(cockpit.record.iterdir()).name}" in page.text("#saved")
    page.page.wait_for_function("document.pointerLockElement === null")
    assert not page.page.is_visible("#mouse-area")
    assert page.console_errors == []


def test_the_assistance_switch_takes_effect_in_the_next_trial(window, cockpit):
    page = window()
    page.page.click("#assist-row")
    for number in (1, 2):
        page.engage()
        page.push_forward()
        trial = cockpit.next_trial(number)
        assert trial.metadata["mode"] == ("human" if number == 1 else "shared")
        page.wait_for_text("#assistance-used", "^without" if number == 1 else "^with assistance")
        page.wait_for_text("#outcome", "Goal reached")
        page.page.wait_for_selector("#drive:enabled")
        page.page.click("#assist-row")
    assert cockpit.trials[1]["x"][0] == 0.0


def test_the_page_shows_the_running_trial(driving):
    driving.wait_for_text("#human-share", r"\d+ %")
    driving.wait_for_text("#confidence", r"\d+ %")
    driving.wait_for_text("#speed", r"0\.[1-9]\d m/s")
    driving.page.wait_for_function("+document.querySelector('#time-left').innerText < 59.9")
    # The knob of the stick plot is at the upper end.
    driving.page.wait_for_selector("#stick-plot .knob[transform*='-0.']", state="attached")


def test_hands_off_stops_the_robot_and_is_shown(long_cockpit, lasting_page, until):
    page = lasting_page.engage()
    page.page.keyboard.down("ArrowUp")
    until(lambda: np.all(long_cockpit.command > 0), "the robot to be driven")
    page.page.keyboard.up("ArrowUp")
    page.wait_for_reason("hands_off")
    page.wait_for_text("#speed", r"0\.00 m/s")
    page.page.keyboard.down("ArrowUp")
    page.wait_for_reason("sure")
    page.page.keyboard.press("Escape")
    assert long_cockpit.next_trial().status == "stopped"


def test_escape_stops(driving, long_cockpit):
    cockpit = long_cockpit
    driving.page.keyboard.press("Escape")
    trial = cockpit.next_trial()
    assert_saved_and_at_rest(cockpit, trial, "stopped")
    driving.wait_for_text("#outcome", "Stopped")


def test_leaving_the_pointer_lock_stops(driving, long_cockpit):
    driving.page.evaluate("document.exitPointerLock()")
    assert_saved_and_at_rest(long_cockpit, long_cockpit.next_trial(), "stopped")


def test_closing_the_tab_stops_the_robot_and_frees_the_lock(
    driving, long_cockpit, lasting_pages, lasting_context
):
    cockpit = long_cockpit
    driving.page.close()
    trial = cockpit.next_trial()
    last_arrival = cockpit.mouse.readings[-1][1]
    assert_stopped_within(cockpit, last_arrival)
    assert_saved_and_at_rest(cockpit, trial, "page_closed")
    lasting_pages.append(Page(lasting_context, cockpit).open().engage())
    lasting_pages[-1].page.keyboard.press("Escape")


def test_reloading_stops_the_robot_and_needs_a_fresh_click(driving, long_cockpit):
    cockpit = long_cockpit
    driving.page.reload()
    trial = cockpit.next_trial()
    assert_stopped_within(cockpit, cockpit.mouse.readings[-1][1])
    assert_saved_and_at_rest(cockpit, trial, "page_closed")
    driving.wait_for_phase("finished")
    driving.push_forward()
    driving.page.wait_for_selector("body[data-driver-lock=free]")
    assert cockpit.driver_lock.holder is None


def test_a_frozen_page_stops_the_robot_and_loses_the_lock(driving, long_cockpit):
    cockpit = long_cockpit
    driving.page.evaluate(
        "setTimeout(() => { const end = performance.now() + 4000; while (performance.now() < end); }, 0)"
    )
    trial = cockpit.next_trial()
    assert_stopped_within(cockpit, cockpit.mouse.readings[-1][1])
    assert_saved_and_at_rest(cockpit, trial, "page_closed")
    # Once it runs again it does not hold the lock, and may engage.
    driving.page.wait_for_selector("body[data-driver-lock=free]")
    driving.page.wait_for_selector("#drive:enabled")
    assert not driving.page.is_visible("#mouse-area")
    assert cockpit.driver_lock.holder is None


def test_a_second_window_watches_and_must_click_to_drive(lasting_page, other_context, long_cockpit, until):
    first = lasting_page
    second = Page(other_context, long_cockpit).open()
    first.engage()
    second.page.wait_for_selector("body[data-driver-lock=taken]")
    assert second.page.is_disabled("#drive")
    first.page.keyboard.down("ArrowUp")
    until(lambda: np.all(long_cockpit.command > 0), "the first to drive")
    second.wait_for_text("#time-left", r"^[1-5]?\d\.\d$")
    # A watcher reads about the driver, not about "you".
    assert not re.search(r"\b[Yy]ou\b", second.text("#legend") + second.text("#arbitration"))
    second.page.keyboard.press("ArrowDown")
    second.push_forward(steps=2)
    until(lambda: np.all(long_cockpit.command > 0), "the first to drive on")
    first.page.keyboard.press("Escape")
    assert long_cockpit.next_trial().status == "stopped"
    second.wait_for_text("#outcome", "Stopped")
    second.page.wait_for_selector("#drive:enabled")
    assert long_cockpit.driver_lock.holder is None
    second.engage()
    first.page.wait_for_selector("body[data-driver-lock=taken]")


def test_settings_take_effect_and_show_on_every_window(window, cockpit, until):
    first, second = window(), window()
    for page in (first, second):
        page.page.click("#tab-stick")
    first.page.fill("#gain", "1")
    first.page.fill("#dead-zone", "0.2")
    first.page.fill("#return-time", "1.5")
    until(lambda: cockpit.driver_lock.latest().stick.return_time == 1.5, "the settings")
    stick = cockpit.driver_lock.latest().stick
    assert (stick.gain, stick.dead_zone) == (0.01, 0.2)
    second.page.wait_for_function("() => document.querySelector('#gain').value == 1")
    second.page.wait_for_function("() => document.querySelector('#return-time').value == 1.5")
    # The words and the pad for trying follow.
    assert second.text("#gain-value") == first.text("#gain-value")
    second.page.hover("#stick-test-plot", position={"x": 65, "y": 110})
    before = second.page.get_attribute("#stick-test-plot .knob", "transform")
    second.page.mouse.move(*middle_of(second, "#stick-test-plot"), steps=20)
    second.page.wait_for_function(
        "(before) => document.querySelector('#stick-test-plot .knob').getAttribute('transform') !== before",
        arg=before,
    )


def test_a_window_that_sends_bad_messages_is_disconnected_and_the_drive_goes_on(driving, long_cockpit, until):
    closed = driving.page.evaluate(
        """async () => {
          const closed = [];
          for (const bad of ["nonsense", '{"type": "move", "x": NaN}', "x".repeat(5000)]) {
            const socket = new WebSocket(`ws://${location.host}/drive`);
            await new Promise((resolve) => (socket.onopen = resolve));
            const end = new Promise((resolve) => (socket.onclose = resolve));
            socket.send(bad);
            const event = await end;
            closed.push([event.code, event.reason]);
          }
          return closed;
        }"""
    )
    assert [code for code, _ in closed] == [1008, 1008, 1009]
    assert all(reason for _, reason in closed)
    before = long_cockpit.mouse.readings[-1][1]
    until(lambda: long_cockpit.mouse.readings[-1][1] > before, "the next message of the driver")
    assert driving.page.get_attribute("body", "data-driver-lock") == "yours"


def test_nothing_is_shown_for_a_wrong_key(browser_context, cockpit):
    page = browser_context.new_page()
    for address in (cockpit.origin + "/", cockpit.origin + "/?k=wrong"):
        assert page.goto(address).status == 403
        assert "drake-shared printed" in page.inner_text("body")


FOREIGN = b"""<!doctype html><title>elsewhere</title><iframe src="ORIGIN/"></iframe><script>
const tried = {};
const note = (name) => [() => { tried[name] = "done"; }, () => { tried[name] ??= "refused"; }];
for (const path of ["drive", ""]) {
  const [done, refused] = note("socket /" + path);
  const socket = new WebSocket("WS/" + path);
  socket.onopen = () => { done(); socket.send('{"type": "engage"}'); };
  socket.onclose = refused;
}
for (const path of ["", "cockpit/main.js", "drive", "favicon.ico"]) {
  for (const method of ["GET", "POST", "DELETE"]) {
    fetch("ORIGIN/" + path, { method, credentials: "include" }).then(...note(`${method} /${path}`));
  }
  // The response is not readable here; the request must be refused nevertheless.
  fetch("ORIGIN/" + path, { mode: "no-cors", credentials: "include" }).then(...note(`blind /${path}`));
  for (const [tag, attribute] of [["script", "src"], ["img", "src"], ["link", "href"]]) {
    const part = document.createElement(tag);
    const [done, refused] = note(`${tag} /${path}`);
    if (tag === "link") part.rel = "stylesheet";
    part.onload = done;
    part.onerror = refused;
    part[attribute] = "ORIGIN/" + path;
    document.documentElement.append(part);
  }
}
const form = document.createElement("form");
form.method = "POST";
form.action = "ORIGIN/drive";
form.target = "hidden";
document.documentElement.append(Object.assign(document.createElement("iframe"), { name: "hidden" }), form);
form.submit();
</script>"""
TRIED = 2 + 4 * (3 + 1 + 3)


@pytest.fixture
def foreign_page():
    """Serves a page that attacks a cockpit from another port of this computer: same site, other origin."""
    body = []

    class Elsewhere(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(body[-1])

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Elsewhere) as server:

        def attack(cockpit):
            page = FOREIGN.replace(b"ORIGIN", cockpit.origin.encode())
            body.append(page.replace(b"WS", cockpit.origin.replace("http", "ws").encode()))
            return f"http://localhost:{server.server_address[1]}/"

        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield attack
        server.shutdown()
        thread.join()


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1"])
def test_a_foreign_page_neither_drives_nor_reads_nor_stops(
    driving, lasting_context, long_cockpit, foreign_page, other_context, until, host
):
    """From another port with the cookie, and from another site, while someone drives."""
    cockpit = long_cockpit
    # The driver's window must keep the focus, so another context gets the driver's cookies.
    other_context.add_cookies(lasting_context.cookies())
    page = other_context.new_page()
    page.goto(foreign_page(cockpit).replace("localhost", host))
    page.wait_for_function(f"Object.keys(tried).length === {TRIED}")
    tried = page.evaluate("tried")
    assert {what for what, how in tried.items() if how != "refused"} == set()
    assert all(frame.query_selector("#drive, canvas") is None for frame in page.frames[1:])
    before = cockpit.mouse.readings[-1][1]
    until(lambda: cockpit.mouse.readings[-1][1] > before, "a new message")
    assert driving.page.get_attribute("body", "data-driver-lock") == "yours"
    until(lambda: np.all(cockpit.command > 0), "the robot to be driven")


def test_the_end_of_the_program_is_shown(browser_context, start_cockpit, short_floor):
    cockpit = start_cockpit(short_floor)
    page = Page(browser_context, cockpit).open()
    cockpit.stop()
    page.page.wait_for_selector("body.offline")
    assert page.page.is_disabled("#drive")


def test_a_simulated_operator_is_watched(browser_context, start_cockpit, scenario, route_learner):
    learner = route_learner(scenario)
    cockpit = start_cockpit(scenario, learner, operator="surrogate")
    learner.variance = np.nan
    page = Page(browser_context, cockpit).open()
    page.wait_for_reason("no_prediction")
    assert not page.page.is_visible("#drive")
    assert not page.page.is_visible("#tab-stick")
    page.wait_for_text("#human-share", "100 %")
    page.wait_for_text("#confidence", "–")
    assert page.console_errors == []
