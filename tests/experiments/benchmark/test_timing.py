"""Spreads, ratios, turns and exponents of timings."""

import numpy as np
import pytest

from drake_shared.experiments.benchmark.results import make_curve, make_ratio
from drake_shared.experiments.benchmark.timing import exponent, interleave, spread


def test_spread_is_the_median_and_the_middle_eighty_percent():
    found = spread(np.arange(101.0))
    assert (found.low, found.median, found.high, found.count) == (10.0, 50.0, 90.0, 101)


def test_spread_of_one_value_is_that_value():
    found = spread([3.0])
    assert found.low == found.median == found.high == 3.0


def test_ratio_is_formed_repeat_by_repeat():
    slow = np.array([1.0, 2.0, 8.0])
    found = make_ratio({"this": 3.0 * slow, "that": slow}, "this", "that").spread
    assert found.low == found.median == found.high == pytest.approx(3.0)


@pytest.mark.parametrize("power", [0.0, 0.5, 1.0, 2.0])
def test_exponent_of_a_power_law_is_its_power(power):
    sizes = np.array([2, 10, 50, 1000])
    assert exponent(sizes, 0.3 * sizes**power) == pytest.approx(power)


def test_the_last_exponent_of_a_curve_is_least_affected_by_a_constant_part():
    sizes = [1, 10, 100, 1000]
    curve = make_curve("a step, s", "obstacles", sizes, [np.full(3, 50.0 + size) for size in sizes])
    assert curve.exponent < curve.last_exponent < 1.0


def test_contenders_take_turns_that_rotate():
    turns = []
    contenders = {name: (lambda name=name: turns.append(name)) for name in "abc"}
    seconds = interleave(contenders, repeats=3, block=0.0)
    # A call to warm up and one to find the number of calls, each; then three turns.
    assert turns == list("aabbcc" + "abc" + "bca" + "cab")
    assert {name: values.shape for name, values in seconds.items()} == dict.fromkeys("abc", (3,))


def test_short_calls_are_timed_many_at_once():
    calls = []
    seconds = interleave({"short": lambda: calls.append(sum(range(100)))}, repeats=4, block=0.01)
    assert len(calls) > 100
    assert np.all(seconds["short"] > 0.0)
