"""Slices are due at multiples of the period, whatever the lateness of earlier slices."""

import pytest

from drake_shared.cockpit.pacer import Pacer


class World:
    """A clock that only sleeping or work advances."""

    def __init__(self):
        self.now = 10.0
        self.slept = []

    def clock(self):
        return self.now

    def sleep(self, duration):
        self.slept.append(duration)
        self.now += duration


@pytest.fixture
def world():
    return World()


@pytest.fixture
def pacer(world):
    return Pacer(period=0.005, clock=world.clock, sleep=world.sleep)


def test_work_within_a_slice_adds_no_drift(pacer, world):
    for index in range(1, 1001):
        assert pacer.wait(index) == pytest.approx(0.0, abs=1e-9)
        world.now += 0.003
    assert world.now == pytest.approx(10.0 + 5.0 + 0.003)


def test_a_late_slice_is_caught_up(pacer, world):
    pacer.wait(1)
    world.now += 0.1
    assert pacer.wait(2) == pytest.approx(0.095)
    assert pacer.wait(3) == pytest.approx(0.09)
    assert pacer.wait(40) == pytest.approx(0.0, abs=1e-9)
    assert world.now == pytest.approx(10.2)
    assert pacer.postponement == 0.0


def test_a_long_delay_postpones_the_schedule(pacer, world):
    pacer.wait(1)
    world.now += 60.0
    assert pacer.wait(2) == pytest.approx(59.995)
    assert pacer.wait(3) == pytest.approx(0.0, abs=1e-9)
    assert world.slept[-1] == pytest.approx(0.005)
    assert pacer.postponement == pytest.approx(59.995)
