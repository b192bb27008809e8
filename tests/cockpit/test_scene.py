"""The scene on the page, in a real browser: one page for all tests, since it takes seconds to load."""

import itertools
import json

import numpy as np
import pytest

from drake_shared import load_learner
from drake_shared.scenario.obstacles import ObstacleDistance

pytestmark = pytest.mark.browser

LABELS = """() => {
  const pane = document.querySelector("#meshcat-pane").getBoundingClientRect();
  return [...document.querySelectorAll(".scene-labels span:not([hidden])")].map((span) => {
    const { left, right, top, bottom } = span.getBoundingClientRect();
    const inside = left >= pane.left && right <= pane.right && top >= pane.top && bottom <= pane.bottom;
    return { kind: span.dataset.kind, text: span.innerText, left, right, top, bottom, inside };
  });
}"""


# Pixels of the visible canvases for one of the screen, without repetition.
SHARPNESS = """() => [...new Set([...document.querySelectorAll("#meshcat-pane canvas")]
  .filter((canvas) => canvas.checkVisibility())
  .map((canvas) => canvas.width / (canvas.clientWidth * devicePixelRatio)))]"""
# What is drawn: changes with every frame in WebGL, and with every change of the layer above it.
DRAWN = """() => [viewer.renderer.info.render.frame,
  document.querySelector("#meshcat-pane .moving")?.toDataURL()].join()"""
# Share of the pixels in which both layers, on top of each other, differ from a frame that holds everything.
DIFFERENCE = """() => {
  const [still, moving] = ["readback", "moving"].map((name) => document.querySelector(`canvas.${name}`));
  const { width, height } = still;
  const both = new OffscreenCanvas(width, height).getContext("2d");
  both.setTransform(1, 0, 0, -1, 0, height);
  both.drawImage(still, 0, 0);
  both.setTransform(1, 0, 0, 1, 0, 0);
  both.drawImage(moving, 0, 0);
  const gl = viewer.renderer.getContext();
  viewer.render();
  const whole = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, whole);
  const layers = both.getImageData(0, 0, width, height).data;
  let different = 0;
  for (let y = 0; y < height; y++) {
    for (let i = 0; i < 4 * width; i++) {
      different += Math.abs(layers[4 * y * width + i] - whole[4 * (height - 1 - y) * width + i]) > 50;
    }
  }
  return different / layers.length;
}"""


class Window:
    """A page, and the last message of each type that the server sent to it."""

    def __init__(self, context, address: str):
        self.received, self.errors = {}, []
        self.page = context.new_page()
        self.page.on("websocket", lambda socket: socket.on("framereceived", self._keep))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.goto(address)
        self.page.click("#intro-skip")
        self.page.wait_for_selector('.scene-labels [data-kind="route"]:not([hidden])')

    def _keep(self, text):
        if isinstance(text, str):
            message = json.loads(text)
            self.received[message["type"]] = message

    def labels(self, kind: str | None = None) -> list[dict]:
        return [label for label in self.page.evaluate(LABELS) if kind in (None, label["kind"])]

    def wait_for_labels(self, *texts: str):
        """Waits until labels with these texts are shown."""
        self.page.wait_for_function(
            f"(texts) => {{ const shown = ({LABELS})().map(({{ text }}) => text);"
            " return texts.every((text) => shown.includes(text)); }",
            arg=list(texts),
        )

    def choose(self, view: str):
        """Switches to a view, and waits until it is drawn."""
        self.page.click(f"[data-view={view}]")
        self.page.evaluate("() => { window.drawn = 0; viewer.render_callback = () => window.drawn++; }")
        self.page.evaluate("() => viewer.set_dirty()")
        self.page.wait_for_function("() => window.drawn > 0")


@pytest.fixture(scope="module")
def window(browser, _two_obstacles, start_lasting_cockpit):
    """A page of the task with two obstacles, before the first trial."""
    cockpit = start_lasting_cockpit(_two_obstacles, load_learner("two_obstacles_default"))
    context = browser.new_context(viewport={"width": 1280, "height": 800}, color_scheme="light")
    context.set_default_timeout(60_000)
    yield Window(context, cockpit.address)
    context.close()


def assert_apart_and_in_view(labels):
    assert all(label["inside"] for label in labels), labels
    for a, b in itertools.combinations(labels, 2):
        across = min(a["right"], b["right"]) - max(a["left"], b["left"])
        down = min(a["bottom"], b["bottom"]) - max(a["top"], b["top"])
        assert across <= 0 or down <= 0, (a, b)


def test_at_the_start_there_are_several_routes_and_none_leads_through_an_obstacle(window, scenario):
    routes = window.received["routes"]["routes"]
    assert len(routes) >= 2
    assert sum(route["probability"] for route in routes) == pytest.approx(1.0, abs=0.1)
    distance = ObstacleDistance(scenario.obstacles)
    for route in routes:
        assert np.all(distance(np.array(route["center"])) > np.array(route["half_width"]))
    shares = sorted(f"{100 * route['probability']:.0f} %" for route in routes)
    window.wait_for_labels(*shares)
    assert sorted(label["text"] for label in window.labels("route")) == shares


def test_start_goal_scale_and_routes_are_labelled(window):
    window.wait_for_labels("Start", "Goal", "1 m")
    assert_apart_and_in_view(window.labels())


@pytest.mark.parametrize("view", ["follow", "free", "above"])
def test_in_every_view_the_goal_is_labelled_and_no_label_is_cut_off(window, view):
    window.choose(view)
    assert window.page.get_attribute(f"[data-view={view}]", "aria-pressed") == "true"
    window.wait_for_labels("Goal")
    assert_apart_and_in_view(window.labels())


@pytest.mark.parametrize("size", [(390, 844), (800, 600), (1280, 800)])
def test_in_a_window_of_any_size_start_and_goal_are_in_view(window, size):
    window.page.set_viewport_size({"width": size[0], "height": size[1]})
    window.page.wait_for_function(f"() => innerWidth === {size[0]}")
    window.choose("above")
    window.wait_for_labels("Start", "Goal")
    assert_apart_and_in_view(window.labels())
    bar = window.page.locator(".scene-bar").bounding_box()
    assert bar["x"] >= 0
    assert bar["x"] + bar["width"] <= size[0]
    assert not window.page.is_visible(".scene-legend") or size[0] > 820


def test_the_legend_opens_in_a_narrow_window(window):
    window.page.set_viewport_size({"width": 390, "height": 844})
    window.page.click(".scene-legend-button")
    assert window.page.get_attribute(".scene-legend-button", "aria-expanded") == "true"
    box = window.page.locator(".scene-legend").bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= 390
    window.page.click(".scene-legend-button")
    window.page.set_viewport_size({"width": 1280, "height": 800})
    window.page.wait_for_function("() => innerWidth === 1280")


def test_light_and_dark_follow_the_system_until_one_is_chosen(window):
    def ground() -> str:
        return window.page.evaluate("viewer.scene.background.getHexString()")

    light = ground()
    window.page.emulate_media(color_scheme="dark")
    window.page.wait_for_selector("html[data-theme=dark]")
    dark = ground()
    assert light > dark
    window.page.click(".scene-theme")
    assert ground() == light
    window.page.emulate_media(color_scheme="light")
    assert ground() == light


def test_without_a_graphics_card_the_layers_show_what_one_frame_would(window):
    """What moves is drawn apart then, since a whole frame takes long."""
    if not window.page.evaluate("document.querySelector('#meshcat-pane .readback') !== null"):
        pytest.skip("this browser draws with a graphics card")
    window.choose("above")
    window.page.wait_for_selector("#meshcat-pane .moving")
    # The robot's picture is the last to come.
    window.page.wait_for_function(f"() => ({DIFFERENCE})() < 0.003", polling=300)


def test_it_is_as_sharp_while_driving_as_at_rest(window):
    assert window.page.evaluate(SHARPNESS) == [1.0]
    window.page.click("#drive:enabled")
    window.page.wait_for_selector("body[data-driver-lock=yours]")
    window.page.keyboard.down("ArrowUp")
    window.page.wait_for_selector("#deck[data-phase=driving]")
    for _ in range(3):
        window.page.wait_for_function(f"(before) => ({DRAWN})() !== before", arg=window.page.evaluate(DRAWN))
    window.page.wait_for_function("() => +document.querySelector('#time-left').innerText < 14.5")
    assert window.page.evaluate(SHARPNESS) == [1.0]
    window.page.keyboard.press("Escape")
    window.page.wait_for_selector("#deck[data-phase=finished]")


def test_the_trail_is_sent_whole_to_a_page_that_comes_later(window, until):
    def rows_sent() -> list:
        window.page.evaluate("0")  # Playwright hands out what was received while it waits for the page.
        return window.received["trail"]["rows"]

    until(lambda: len(rows_sent()) > 2, "the trail")
    rows = rows_sent()
    times = [row[0] for row in rows]
    assert times == sorted(times)
    assert np.all(np.diff([row[1] for row in rows]) >= 0)
    assert window.errors == []
