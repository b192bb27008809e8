"""Slices are due at whole periods from the start, whatever happened to those before."""

import pytest

from drake_shared.cockpit.pacer import Pacer


class World:
    """A clock that only sleeping, or work, moves."""

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


def test_work_within_a_slice_does_not_add_up(pacer, world):
    for index in range(1, 1001):
        assert pacer.wait(index) == pytest.approx(0.0, abs=1e-9)
        world.now += 0.003
    assert world.now == pytest.approx(10.0 + 5.0 + 0.003)


def test_a_late_slice_is_made_up_for(pacer, world):
    pacer.wait(1)
    world.now += 0.1
    assert pacer.wait(2) == pytest.approx(0.095)
    assert pacer.wait(3) == pytest.approx(0.09)
    assert pacer.wait(40) == pytest.approx(0.0, abs=1e-9)
    assert world.now == pytest.approx(10.2)
    assert pacer.put_off == 0.0


def test_lost_time_is_not_raced_through(pacer, world):
    pacer.wait(1)
    world.now += 60.0
    assert pacer.wait(2) == pytest.approx(59.995)
    assert pacer.wait(3) == pytest.approx(0.0, abs=1e-9)
    assert world.slept[-1] == pytest.approx(0.005)
    assert pacer.put_off == pytest.approx(59.995)
