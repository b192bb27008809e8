"""Notices of another driver: against the formula, and how often they are false."""

import math

import numpy as np
import pytest

from drake_shared.arbitration.driver_change import DriverChange
from drake_shared.arbitration.fusion_model import FusionModel
from drake_shared.common.errors import InputError

PERIOD, MEMORY = 0.05, 0.5
STEADY = np.array([0.7, 0.15, 0.1, 0.05])
NOISY = STEADY[::-1]


def drive(change: DriverChange, draws, steps: int, count: int):
    """Doubt and driver after each step; each observation lasts for the memory."""
    cusum, another, gives = np.zeros(count), np.zeros(count), np.ones(count, bool)
    per = round(MEMORY / PERIOD)
    for step in range(steps):
        if step % per == 0:
            noise = np.eye(4)[draws(count)].T
        cusum, another, factor = change.step(cusum, another, noise, gives)
        yield cusum, another, factor


def drawn(probability, seed=0):
    rng = np.random.default_rng(seed)
    return lambda count: rng.choice(4, count, p=probability)


def test_the_sum_is_that_of_the_likelihood_ratios():
    change = DriverChange(STEADY, period=PERIOD, memory=MEMORY, false_notices=1e9)
    noise = np.array([[0.1, 0.2, 0.3, 0.4]]).T
    ratio = (0.25 / STEADY) @ noise[:, 0]
    cusum, another, factor = change.step(np.array([1.0]), np.zeros(1), noise, np.ones(1, bool))
    assert cusum.item() == pytest.approx(1.0 + PERIOD / MEMORY * math.log(ratio))
    assert another.item() == 0.0
    np.testing.assert_array_equal(factor, 1.0)
    back, _, _ = change.step(np.array([5.0]), np.ones(1), noise, np.ones(1, bool))
    assert back.item() == pytest.approx(5.0 + PERIOD / MEMORY * math.log((STEADY / 0.25) @ noise[:, 0]))
    rest, _, _ = change.step(np.array([1.0]), np.zeros(1), noise, np.zeros(1, bool))
    assert rest.item() == 1.0


@pytest.mark.parametrize("false_notices", [20.0, 60.0])
def test_false_notices_are_no_more_frequent_than_stated(false_notices):
    change = DriverChange(STEADY, period=PERIOD, memory=MEMORY, false_notices=false_notices)
    count, seconds = 400, 5.0 * false_notices
    first = np.full(count, seconds)  # Longer times count as this one, so that the mean is too small.
    for step, (_, another, _) in enumerate(drive(change, drawn(STEADY), round(seconds / PERIOD), count)):
        first = np.where((another > 0.0) & (first == seconds), step * PERIOD, first)
    assert first.mean() > false_notices


def test_another_driver_and_the_return_are_noticed_within_seconds():
    change = DriverChange(STEADY, period=PERIOD, memory=MEMORY, false_notices=1800.0)
    steps = round(10.0 / PERIOD)
    *_, (cusum, another, _) = drive(change, drawn(NOISY), steps, 200)
    assert another.mean() > 0.95
    gives = np.ones(200, bool)
    draws = drawn(STEADY, seed=1)
    another = np.ones(200)
    cusum = np.zeros(200)
    for step in range(2 * steps):
        if step % 10 == 0:
            noise = np.eye(4)[draws(200)].T
        cusum, another, _ = change.step(cusum, another, noise, gives)
    assert another.mean() < 0.1


def test_a_notice_replaces_the_prior_of_the_person_by_that_of_anybody():
    change = DriverChange(STEADY, period=PERIOD, memory=MEMORY, false_notices=1.0)
    likelihood = np.array([0.1, 0.1, 0.2, 0.6])
    noise = (STEADY * likelihood / (STEADY @ likelihood))[:, None]
    *_, factor = change.step(np.array([10.0]), np.zeros(1), noise, np.ones(1, bool))
    after = (noise * factor)[:, 0]
    np.testing.assert_allclose(after / after.sum(), likelihood / likelihood.sum())
    np.testing.assert_array_equal(change.prior(np.array([0.0, 1.0])).T, [STEADY, np.full(4, 0.25)])


def test_a_person_like_anybody_is_never_taken_for_another():
    change = DriverChange(np.full(4, 0.25), period=PERIOD, memory=MEMORY, false_notices=1.0)
    *_, (cusum, another, _) = drive(change, drawn(NOISY), 400, 5)
    assert not another.any()
    assert cusum.max() < 1e-9


def test_a_time_between_false_notices_below_the_memory_is_refused():
    with pytest.raises(InputError) as caught:
        FusionModel(false_notices=0.4)
    assert caught.value.field == "false_notices"
