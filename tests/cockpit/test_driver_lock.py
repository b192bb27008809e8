"""One page at a time holds the driver lock, and its newest sample is kept."""

import pytest

from drake_shared.cockpit.driver_lock import LOST, RELEASED, DriverLock
from drake_shared.cockpit.messages import Move
from drake_shared.systems.mouse_input import StickSettings


class Clock:
    now = 50.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def lock(clock):
    return DriverLock(clock=clock, lost_after=1.0)


def move(x=0.0, y=0.0, forward=0.0, turn=0.0):
    return Move(x=x, y=y, forward=forward, turn=turn)


def test_nobody_drives_at_first(lock):
    assert not lock.latest().engaged
    assert lock.holder is None
    assert lock.age() > 1e9


def test_the_first_page_acquires_the_lock_and_the_second_does_not(lock):
    assert lock.engage(1)
    assert not lock.engage(2)
    lock.move(2, move(x=99))
    lock.move(1, move(x=5, y=-3, forward=0.5, turn=-0.5))
    sample = lock.latest()
    assert (sample.x, sample.y, sample.forward, sample.turn) == (5, -3, 0.5, -0.5)
    assert sample.engaged


def test_engaging_twice_keeps_the_lock_and_the_sample(lock):
    lock.engage(1)
    lock.move(1, move(forward=0.5))
    before = lock.latest()
    assert lock.engage(1)
    assert lock.latest() == before


def test_a_sample_is_stamped_with_its_arrival(lock, clock):
    lock.engage(1)
    clock.now += 0.25
    assert lock.age() == 0.25
    lock.move(1, move())
    assert lock.latest().arrival == clock.now


def test_a_released_lock_must_be_acquired_again_which_is_a_new_engagement(lock):
    lock.engage(1)
    lock.move(1, move(x=40, forward=1.0))
    first = lock.latest().engagement
    lock.release(1)
    assert lock.end_reason(first) == RELEASED
    sample = lock.latest()
    assert (sample.engaged, sample.forward) == (False, 0)
    assert sample.x == 40
    lock.move(1, move(x=50))
    assert lock.latest() == sample
    assert lock.engage(2)
    sample = lock.latest()
    assert sample.engagement == first + 1
    assert (sample.x, sample.y) == (0, 0)
    assert lock.end_reason(first + 1) is None


def test_only_the_holder_can_release_the_lock(lock):
    lock.engage(1)
    lock.release(2, LOST)
    assert lock.holder == 1


def test_the_lock_expires_without_samples(lock, clock):
    lock.engage(1)
    clock.now += 0.9
    assert lock.expire() is None
    lock.move(1, move())
    clock.now += 0.9
    assert lock.expire() is None
    clock.now += 0.2
    assert lock.expire() == 1
    assert lock.end_reason(lock.latest().engagement) == LOST
    assert lock.expire() is None
    assert lock.engage(2)


def test_a_disabled_lock_cannot_be_acquired():
    lock = DriverLock(enabled=False)
    assert not lock.engage(1)
    assert not lock.latest().engaged


def test_only_the_driver_changes_settings_and_any_page_while_nobody_drives(lock):
    wide = StickSettings(gain=0.01, dead_zone=0.2, return_time=2.0)
    assert lock.set_stick(7, wide)
    assert lock.set_assist(7, False)
    lock.engage(1)
    assert lock.latest().stick == wide
    assert not lock.set_stick(7, StickSettings())
    assert not lock.set_assist(7, True)
    assert (lock.latest().stick, lock.assist) == (wide, False)
    assert lock.set_stick(1, StickSettings())
    assert lock.latest().stick == StickSettings()


def test_listeners_are_called_at_every_change_of_the_holder(lock):
    holders = []
    lock.add_listener(lambda: holders.append(lock.holder))
    lock.engage(1)
    lock.engage(2)
    lock.move(1, move())
    lock.revoke("over")
    lock.revoke("over")
    assert holders == [1, None]
