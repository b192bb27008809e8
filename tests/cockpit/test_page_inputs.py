"""Keys and gamepads of the page, with emulated devices and a clock of our own; no server is needed."""

import mimetypes
from pathlib import Path

import pytest

import drake_shared.cockpit

pytestmark = pytest.mark.browser

FILES = Path(drake_shared.cockpit.__file__).parent / "page"
SITE = "http://page.test/"
LOAD = """async () => {
  window.pads = [];
  navigator.getGamepads = () => window.pads;
  const { Axes } = await import("/axes.js");
  window.axes = new Axes();
}"""


@pytest.fixture(scope="module")
def window(browser):
    """A page with nothing but the Axes."""
    context = browser.new_context()

    def answer(route):
        name = route.request.url.removeprefix(SITE)
        body = (FILES / name).read_text() if name else "<!doctype html><title>inputs</title>"
        route.fulfill(body=body, content_type=mimetypes.guess_type(name)[0] if name else "text/html")

    context.route(f"{SITE}**", answer)
    page = context.new_page()
    page.clock.install()
    page.goto(SITE)
    page.evaluate(LOAD)
    yield page
    context.close()


class Driver:
    """Events of the devices, and what the Axes make of them."""

    def __init__(self, page):
        self._page = page

    def key(self, kind: str, code: str, key: str = "", **modifiers):
        event = {"code": code, "key": key or code, "cancelable": True, **modifiers}
        self._page.evaluate(
            "([kind, event]) => dispatchEvent(new KeyboardEvent(kind, event))", [f"key{kind}", event]
        )

    def set_pads(self, *pads: dict):
        self._page.evaluate("(pads) => { window.pads = pads; }", list(pads))

    def wait(self, milliseconds: int) -> tuple[float, float]:
        self._page.clock.run_for(milliseconds)
        return self.axes

    @property
    def axes(self) -> tuple[float, float]:
        """Deflections forward and to the left."""
        return tuple(self._page.evaluate("[axes.forward, axes.turn]"))

    def fire(self, script: str):
        self._page.evaluate(script)


@pytest.fixture
def driver(window):
    """The Axes of a driver who has just engaged."""
    window.evaluate(f"({LOAD})().then(() => axes.start())")
    yield Driver(window)
    window.evaluate("axes.stop()")


def pad(x=0.0, y=0.0, *, mapping="standard", index=0, connected=True):
    return {
        "id": f"pad {index}",
        "index": index,
        "mapping": mapping,
        "connected": connected,
        "axes": [x, y],
        "buttons": [],
    }


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        *[(code, (1.0, 0.0)) for code in ("ArrowUp", "KeyW", "Numpad8")],
        *[(code, (-1.0, 0.0)) for code in ("ArrowDown", "KeyS", "Numpad2")],
        *[(code, (0.0, 1.0)) for code in ("ArrowLeft", "KeyA", "Numpad4")],
        *[(code, (0.0, -1.0)) for code in ("ArrowRight", "KeyD", "Numpad6")],
    ],
)
def test_keys_drive_by_their_position_and_let_go_when_released(driver, code, expected):
    driver.key("down", code, key="z")  # The letter on the key differs between keyboards.
    assert driver.wait(300) == expected
    driver.key("up", code)
    assert driver.wait(200) == (0.0, 0.0)


def test_two_keys_of_one_direction_count_once_and_opposite_keys_cancel(driver):
    driver.key("down", "ArrowUp")
    driver.key("down", "KeyW")
    assert driver.wait(300) == (1.0, 0.0)
    driver.key("up", "KeyW")
    assert driver.wait(300) == (1.0, 0.0)
    driver.key("down", "KeyS")
    assert driver.wait(300) == (0.0, 0.0)


# What happens after a key was pressed, so that its release is never seen, or is not seen as one.
LOST_RELEASES = {
    "numeric keypad with NumLock changed": lambda d: d.key("up", "Numpad8", key="8"),
    "Meta is pressed": lambda d: d.key("down", "MetaLeft", key="Meta", metaKey=True),
    "Meta is released": lambda d: d.key("up", "MetaRight", key="Meta"),
    "another key is pressed with Meta": lambda d: d.key("down", "KeyQ", metaKey=True),
    "a release without a position": lambda d: d.key("up", "", key="8"),
    "the window loses the keyboard": lambda d: d.fire("dispatchEvent(new Event('blur'))"),
    "the window is hidden": lambda d: d.fire("document.dispatchEvent(new Event('visibilitychange'))"),
    "the driver disengages": lambda d: d.fire("axes.stop()"),
}


@pytest.mark.parametrize("fault", LOST_RELEASES)
def test_a_key_whose_release_is_not_seen_is_let_go_within_200_ms(driver, fault):
    driver.key("down", "Numpad8", key="ArrowUp")
    assert driver.wait(300) == (1.0, 0.0)
    LOST_RELEASES[fault](driver)
    assert driver.wait(200) == (0.0, 0.0)


@pytest.mark.parametrize("modifier", ["metaKey", "ctrlKey", "altKey"])
def test_shortcuts_do_not_drive(driver, modifier):
    driver.key("down", "KeyW", **{modifier: True})
    assert driver.wait(300) == (0.0, 0.0)


def test_keys_do_not_drive_before_the_driver_engages_or_afterwards(driver):
    driver.fire("axes.stop()")
    driver.key("down", "ArrowUp")
    assert driver.wait(300) == (0.0, 0.0)
    driver.fire("axes.start()")
    assert driver.wait(300) == (0.0, 0.0)


def test_a_gamepad_drives_past_its_dead_zone(driver):
    driver.set_pads(pad())
    driver.wait(300)
    driver.set_pads(pad(0.1, -0.1))
    assert driver.wait(100) == (0.0, 0.0)
    driver.set_pads(pad(0.0, -1.0))
    assert driver.wait(100) == (1.0, 0.0)
    driver.set_pads(pad(-1.0, 0.0))
    assert driver.wait(100) == (0.0, 1.0)
    driver.set_pads(pad(-1.0, 0.0, connected=False))
    assert driver.wait(100) == (0.0, 0.0)


def test_a_flickering_gamepad_changes_nothing(driver):
    driver.fire("window.changes = 0; axes.onChange = () => { window.changes += 1; }; null")
    for step in range(40):
        driver.set_pads(pad(0.04 * (-1) ** step, 0.03))
        driver.wait(20)
    assert driver.axes == (0.0, 0.0)
    assert driver._page.evaluate("changes") == 0


def test_a_device_that_rests_away_from_its_centre_does_not_drive(driver):
    phantom = pad(-0.99, -0.99, mapping="")
    driver.set_pads(phantom)
    assert driver.wait(2000) == (0.0, 0.0)
    # A pedal passes the centre of its axis when it is pressed.
    for position in (-0.5, 0.0, 0.0, 0.5, 1.0):
        driver.set_pads(pad(position, position, mapping=""))
        assert driver.wait(300) == (0.0, 0.0)


def test_a_stick_that_is_held_when_the_driver_engages_waits_for_its_centre(driver):
    driver.set_pads(pad(0.0, -0.8))
    assert driver.wait(3000) == (0.0, 0.0)
    driver.set_pads(pad(0.0, 0.02))
    assert driver.wait(300) == (0.0, 0.0)
    driver.set_pads(pad(0.0, -1.0))
    assert driver.wait(100)[0] == 1.0


def test_the_rest_position_is_learnt_and_the_whole_range_stays(driver):
    driver.set_pads(pad(0.0, 0.18, mapping=""))
    assert driver.wait(500) == (0.0, 0.0)
    driver.set_pads(pad(0.0, -1.0, mapping=""))
    assert driver.wait(100)[0] == 1.0
    driver.set_pads(pad(0.0, 1.0, mapping=""))
    assert driver.wait(100)[0] == -1.0


def test_the_standard_mapping_goes_first_and_the_moved_one_of_several_counts(driver):
    stuck, other = pad(0.9, 0.9, mapping=""), pad(0.0, 0.0, index=2)
    driver.set_pads(None, stuck, pad(index=1), other)
    assert driver.wait(500) == (0.0, 0.0)
    driver.set_pads(None, stuck, pad(0.0, -1.0, index=1), other)
    assert driver.wait(100) == (1.0, 0.0)
    driver.set_pads(None, stuck, pad(index=1), pad(1.0, 0.0, index=2))
    assert driver.wait(100) == (0.0, -1.0)


def test_the_pages_work_where_there_are_no_gamepads(driver):
    driver.fire("navigator.getGamepads = undefined")
    driver.key("down", "ArrowUp")
    assert driver.wait(300) == (1.0, 0.0)
