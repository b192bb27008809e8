"""From the browser's mouse event to MouseInput's state: no displacement is lost on the way.

``pytest --junit-xml FILE`` records the percentiles of the delay, which only an idle machine can judge."""

import time

import numpy as np
import pytest

from drake_shared.systems.mouse_input import StickSettings

pytestmark = pytest.mark.browser

EVENTS = 120
RATE = 60.0  # events/s
GAIN = 0.001  # So small that the stick does not reach its limit.
RECORD_EVENTS = """() => {
  const events = (window.mouseEvents = []);
  let moved = 0;
  addEventListener("pointerrawupdate", (event) => {
    moved += event.movementX;
    events.push([performance.timeOrigin + event.timeStamp, moved]);
  });
}"""


def test_no_displacement_is_lost_between_the_mouse_and_the_stick(
    long_cockpit, browser_context, until, record_property
):
    cockpit = long_cockpit
    page = browser_context.new_page()
    page.goto(cockpit.address)
    page.click("#drive:enabled")
    page.wait_for_selector("body[data-driver-lock=yours]")
    cockpit.driver_lock.set_stick(cockpit.driver_lock.holder, StickSettings(gain=GAIN))
    page.evaluate(RECORD_EVENTS)
    page.mouse.move(0, 240)
    start_count = wait_for_all(cockpit, page, until)
    recorded = page.evaluate("mouseEvents.length")
    start = time.perf_counter()
    for index in range(1, EVENTS + 1):
        time.sleep(max(start + index / RATE - time.perf_counter(), 0.0))
        page.mouse.move(index, 240)
    end_count = wait_for_all(cockpit, page, until)
    events = np.array(page.evaluate("mouseEvents"))[recorded:]
    cockpit.wait_for_time(cockpit.time + 0.1)  # The log has a row every 0.05 s.
    page.keyboard.press("Escape")
    trial = cockpit.next_trial()

    assert len(events) <= EVENTS  # A browser that is late merges events; none of the displacement is lost.
    assert end_count - start_count == EVENTS
    stick = -trial["stick_left"][trial["engaged"] > 0][-1] / GAIN
    assert stick - start_count == pytest.approx(EVENTS, abs=1e-6)

    now = time.time() - time.monotonic()
    times, counts = np.array([(at + now, count) for at, _, _, count in cockpit.mouse.readings]).T
    first = np.searchsorted(counts, events[:, 1])
    delays = times[first] - events[:, 0] / 1000.0
    for percent in (50, 90, 99):
        record_property(f"p{percent}_ms", round(1000 * float(np.percentile(delays, percent)), 2))
    assert np.all(delays > -0.05)


def wait_for_all(cockpit, page, until) -> float:
    """Waits until the whole displacement that the page saw is in the counter x, and returns it."""

    def moved() -> float:
        return page.evaluate("mouseEvents.at(-1)?.[1] ?? 0")

    def counted() -> float:
        return cockpit.mouse.readings[-1][3] if cockpit.mouse.readings else 0.0

    until(lambda: moved() and counted() == moved(), "the mouse's moves")
    return counted()
