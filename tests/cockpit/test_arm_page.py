"""The page with an arm: mouse and wheel bring the tip to a cup, and so do two axes and a click."""

import dataclasses
import math
import re

import numpy as np
import pytest

from drake_shared.scenario import load_scenario
from drake_shared.systems.mouse_input import StickSettings
from drake_shared.systems.tip_input import TipInput

pytestmark = pytest.mark.browser

# With more time than a trial has: on a loaded machine the samples of the mouse are often stale.
CUPS = dataclasses.replace(load_scenario("table_three_cups"), duration=120.0)
HOME = np.array(CUPS.routes[0].waypoints[0])
CUP = next(goal for goal in CUPS.goals if goal.name == "right_cup")
TARGET = np.array([CUP.x, CUP.y, CUP.z])
# A short way of the mouse moves the stick far, so that it stays inside the window.
STICK = StickSettings(gain=0.01)
NOTCH = 0.1
PATIENCE = 60.0


class WatchedTip(TipInput):
    """Adds up the commands as the arm takes them: with nothing in its way, that is where the tip is."""

    tip = HOME

    def _update(self, context, state):
        time, period = context.get_time(), CUPS.control_period
        if time == 0.0:
            self.tip = HOME
        if abs(time / period - round(time / period)) < 1e-6:
            self.tip = self.tip + period * self.get_human_command_output_port().Eval(context)
        super()._update(context, state)


class Driver:
    """A person who sees the tip, and pushes the axes at hand toward the cup: less, the nearer it is."""

    def __init__(self, cockpit, page):
        self.cockpit, self.page, self.notches = cockpit, page, 0

    def engage(self):
        self.page.wait_for_selector("#drive:enabled")
        box = self.page.locator("#drive").bounding_box()
        self.start = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        self.page.mouse.click(*self.start)
        self.place = self.start
        self.page.wait_for_selector("body[data-driver-lock=yours]")
        self.notches = 0

    def error(self) -> np.ndarray:
        return TARGET - self.cockpit.tips[-1].tip

    def push(self, forward: float, left: float):
        """Moves the stick to a share of its range."""
        across, along = (
            math.copysign(min(abs(part), 1.0) * (1.0 - STICK.dead_zone) + STICK.dead_zone, part) / STICK.gain
            for part in (left, forward)
        )
        place = round(self.start[0] - across), round(self.start[1] - along)
        if place != self.place:
            self.page.mouse.move(*place)
            self.place = place

    def click(self, plane: str):
        """Switches to a plane, and waits until the page shows it."""
        self.page.mouse.down()
        self.page.mouse.up()
        self.page.wait_for_function(
            "(plane) => document.getElementById('plane').textContent.includes(plane)", arg=plane
        )

    def turn_wheel(self, up: float):
        wanted = round(min(max(up, -1.0), 1.0) / NOTCH)
        for _ in range(abs(wanted - self.notches)):
            self.page.mouse.wheel(0, math.copysign(100.0, self.notches - wanted))
        self.notches = wanted


@pytest.fixture(scope="module")
def cockpit(start_lasting_cockpit):
    tips = []

    def operator(source):
        tips.append(WatchedTip(robot=CUPS.robot, source=source))
        return tips[-1]

    cockpit = start_lasting_cockpit(CUPS, operator=operator)
    cockpit.tips = tips
    cockpit.driver_lock.set_stick(0, STICK)
    return cockpit


@pytest.fixture(scope="module")
def page(cockpit, lasting_context):
    page = lasting_context.new_page()
    page.goto(cockpit.address)
    page.wait_for_selector("#drive:enabled")
    assert page.get_attribute('[data-view="free"]', "aria-pressed") == "true"
    # Without a graphics card rendering takes most of the time.
    page.evaluate("viewer.animate = () => {}; do_reconnect = false; viewer.connection.close()")
    page.evaluate("document.getElementById('intro').hidden = true")
    return page


@pytest.fixture
def driver(cockpit, page):
    cockpit.trials.clear()
    return Driver(cockpit, page)


def assert_at_the_cup(trial):
    assert trial.status == "reached"
    assert np.linalg.norm(trial.positions[-1] - TARGET) <= CUP.radius
    assert not trial["contact"].any()


def test_mouse_and_wheel_bring_the_tip_to_the_cup(driver, page, cockpit, until):
    driver.engage()
    assert "x-y" in page.inner_text("#plane")

    def arrives() -> bool:
        forward, left, up = 6.0 * driver.error()
        driver.push(forward, left)
        driver.turn_wheel(up)
        return bool(cockpit.trials)

    until(arrives, "the cup", PATIENCE)
    trial = cockpit.next_trial()
    assert_at_the_cup(trial)
    assert not trial["plane_switches"].any()
    effort = page.locator("#metrics > div", has_text="Effort").locator("dd.value")
    effort.wait_for(state="attached")
    # The integral of a speed is a length, where that of the wheels' speeds is an angle.
    assert re.fullmatch(r"\d\.\d\d m", effort.text_content())


def test_two_axes_and_a_click_bring_the_tip_to_the_cup(driver, page, cockpit, until):
    driver.engage()

    def is_before_the_cup() -> bool:
        _, left, up = 6.0 * driver.error()
        driver.push(up, left)
        return bool(np.abs(driver.error()[1:]).max() < 0.01)

    def arrives() -> bool:
        forward, left, _ = 6.0 * driver.error()
        driver.push(forward, left)
        return bool(cockpit.trials)

    driver.click("y-z")
    until(is_before_the_cup, "a tip before the cup", PATIENCE)
    driver.click("x-y")
    until(arrives, "the cup", PATIENCE)
    trial = cockpit.next_trial()
    assert_at_the_cup(trial)
    # A command is that of the plane in its row.
    assert trial["plane_switches"][-1] == 2.0
    assert not trial["human_vz"][trial["plane"] == 0.0].any()
    assert not trial["human_vx"][trial["plane"] == 1.0].any()
