"""One driver at a time, known by the newest that was heard."""

import pytest

from drake_shared.cockpit.driver_lock import LET_GO, LOST, DriverLock
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
def seat(clock):
    return DriverLock(clock=clock, silent_after=1.0)


def move(x=0.0, y=0.0, forward=0.0, turn=0.0):
    return Move(x=x, y=y, forward=forward, turn=turn)


def test_nobody_drives_at_first(seat):
    assert not seat.latest().engaged
    assert seat.holder is None
    assert seat.age() > 1e9


def test_the_first_who_asks_has_it_and_the_second_has_not(seat):
    assert seat.engage(1)
    assert not seat.engage(2)
    seat.move(2, move(x=99))
    seat.move(1, move(x=5, y=-3, forward=0.5, turn=-0.5))
    sample = seat.latest()
    assert (sample.x, sample.y, sample.forward, sample.turn) == (5, -3, 0.5, -0.5)
    assert sample.engaged


def test_who_asks_again_has_it_still(seat):
    seat.engage(1)
    seat.move(1, move(forward=0.5))
    before = seat.latest()
    assert seat.engage(1)
    assert seat.latest() == before


def test_a_sample_bears_the_time_at_which_it_came(seat, clock):
    seat.engage(1)
    clock.now += 0.25
    assert seat.age() == 0.25
    seat.move(1, move())
    assert seat.latest().arrival == clock.now


def test_a_seat_that_is_freed_needs_a_fresh_claim_and_is_another_engagement(seat):
    seat.engage(1)
    seat.move(1, move(x=40, forward=1.0))
    first = seat.latest().engagement
    seat.leave(1, LET_GO)
    assert seat.departure(first) == LET_GO
    sample = seat.latest()
    assert (sample.engaged, sample.forward) == (False, 0)
    assert sample.x == 40
    seat.move(1, move(x=50))
    assert seat.latest() == sample
    assert seat.engage(2)
    sample = seat.latest()
    assert sample.engagement == first + 1
    assert (sample.x, sample.y) == (0, 0)
    assert seat.departure(first + 1) is None


def test_only_its_holder_can_leave_it(seat):
    seat.engage(1)
    seat.leave(2, LOST)
    assert seat.holder == 1


def test_silence_loses_the_seat(seat, clock):
    seat.engage(1)
    clock.now += 0.9
    assert seat.expire() is None
    seat.move(1, move())
    clock.now += 0.9
    assert seat.expire() is None
    clock.now += 0.2
    assert seat.expire() == 1
    assert seat.departure(seat.latest().engagement) == LOST
    assert seat.expire() is None
    assert seat.engage(2)


def test_a_closed_seat_is_nobodys():
    seat = DriverLock(open=False)
    assert not seat.engage(1)
    assert not seat.latest().engaged


def test_settings_are_the_drivers_or_anybodys_while_nobody_drives(seat):
    wide = StickSettings(gain=0.01, dead_zone=0.2, return_time=2.0)
    assert seat.set_stick(7, wide)
    assert seat.set_assist(7, False)
    seat.engage(1)
    assert seat.latest().stick == wide
    assert not seat.set_stick(7, StickSettings())
    assert not seat.set_assist(7, True)
    assert (seat.latest().stick, seat.assist) == (wide, False)
    assert seat.set_stick(1, StickSettings())
    assert seat.latest().stick == StickSettings()


def test_listeners_hear_of_every_change(seat):
    heard = []
    seat.listen(lambda: heard.append(seat.holder))
    seat.engage(1)
    seat.engage(2)
    seat.move(1, move())
    seat.vacate("over")
    seat.vacate("over")
    assert heard == [1, None]
