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
