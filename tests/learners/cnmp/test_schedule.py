"""The course of a training, without training anything."""

import dataclasses
import math

import pytest

from drake_shared.learners import PRESETS
from drake_shared.learners.cnmp.schedule import CHECKS, MIN_IMPROVEMENT, WARM_UP, Schedule

ONE_CYCLE = dataclasses.replace(PRESETS["default"], schedule="one-cycle", learning_rate=1e-3, patience=0.1)
IN_CYCLES = dataclasses.replace(ONE_CYCLE, cycle=1_500)


def schedule(parameters=ONE_CYCLE, planned: int = 10_500) -> Schedule:
    return Schedule(parameters, planned=planned, deadline=None)


def test_each_cycle_is_twice_as_long_as_the_one_before():
    course = schedule(IN_CYCLES)
    assert [index for index in range(10_500) if course.cycle(index)[0]] == [1_500, 4_500]
    assert [course.cycle(index)[1] for index in (0, 750, 1_500, 3_000, 4_500, 7_500)] == [0, 0.5] * 3


def test_the_last_cycle_ends_with_the_plan():
    assert schedule(IN_CYCLES, planned=6_000).cycle(5_250)[1] == 0.5


def test_the_learning_rate_rises_to_its_peak_and_falls_along_a_cosine():
    course = schedule()
    assert course.learning_rate(0.0) == pytest.approx(0.05e-3)
    assert course.learning_rate(0.5 * WARM_UP) == pytest.approx(0.525e-3)
    assert course.learning_rate(WARM_UP) == pytest.approx(1e-3, rel=1e-3)
    assert course.learning_rate(0.5 * (1.0 + WARM_UP)) == pytest.approx(0.5e-3, rel=1e-3)
    assert 0.0 < course.learning_rate(1.0) < 1e-6


def test_a_constant_learning_rate_is_constant():
    course = schedule(dataclasses.replace(ONE_CYCLE, schedule="constant"))
    assert {course.learning_rate(done) for done in (0.0, 0.05, 0.5, 1.0)} == {1e-3}


def test_the_last_share_of_a_cycle_uses_the_plain_loss():
    course = schedule(dataclasses.replace(ONE_CYCLE, beta=0.7, plain_share=0.25))
    assert [course.beta(done) for done in (0.0, 0.5, 0.74, 0.75, 0.99)] == [0.7, 0.7, 0.7, 0.0, 0.0]


def test_the_floor_falls_in_the_first_share_of_a_cycle():
    course = schedule(dataclasses.replace(ONE_CYCLE, first_floor=3.0, floor_share=0.5))
    assert [course.floor_fallen(done) for done in (0.0, 0.25, 0.5, 0.9)] == [0.0, 0.5, 1.0, 1.0]
    assert schedule(dataclasses.replace(ONE_CYCLE, first_floor=0.0)).floor_fallen(0.0) == 1.0


def test_without_patience_there_are_no_checks():
    impatient = schedule(dataclasses.replace(ONE_CYCLE, patience=0.0))
    assert not any(impatient.is_check(done) for done in range(1, 1_000))
    assert all(schedule(planned=30).is_check(done) for done in range(1, 30))


def test_a_training_that_improves_is_not_cut():
    course = schedule()
    for done in range(210, 10_500, 210):
        course.check(done, -1.01 * MIN_IMPROVEMENT * done / 210)
    assert course.total == course.planned == 10_500


@pytest.mark.parametrize(("seconds", "total"), [(10.0, 600), (9.9, 600), (5.0, 300), (1.5, 100), (0.5, 100)])
def test_the_plan_is_cut_to_the_time_that_is_left(monkeypatch, seconds, total):
    """After 100 iterations in 1.5 s or more, of 600 planned; a lack of up to 2% is accepted."""
    monkeypatch.setattr("time.perf_counter", lambda: 1_000.0)
    course = Schedule(ONE_CYCLE, planned=600, deadline=1_000.0 + seconds)
    monkeypatch.setattr("time.perf_counter", lambda: 1_000.0 + 100 / 60)
    course.keep_time(100)
    assert course.total == pytest.approx(total, abs=0.02 * 600)
    assert course.planned == 600
    endless = schedule(planned=600)
    endless.keep_time(100)
    assert endless.total == 600


def test_a_training_without_improvement_is_cut_after_the_patience():
    course = schedule()
    step = 10_500 // CHECKS
    checked = [done for done in range(step, 10_500, step) if course.is_check(done)]
    assert len(checked) == CHECKS - 1
    for done in checked:
        # Improves until a third of the plan, and then too little to count.
        course.check(done, -math.floor(min(done, 3_500) / step) - 0.5 * MIN_IMPROVEMENT * (done > 3_500))
    last = max(done for done in checked if done <= 3_500)
    noticed = min(done for done in checked if done - last > 0.1 * 10_500)
    assert course.total == noticed + 2_100
