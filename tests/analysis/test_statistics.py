"""What samples say, against answers worked out by hand or known by how the samples were drawn."""

import math

import numpy as np
import pytest

from drake_shared.analysis.statistics import (
    Estimate,
    at_least,
    claim,
    holm,
    holm_levels,
    interval,
    never,
    not_worse,
    paired,
    paired_claims,
    verdict,
)


def estimate(low, high, count=20):
    return Estimate(mean=(low + high) / 2, low=low, high=high, count=count)


def question(one, other, smallest=0.1):
    return {"text": "more", "one": one, "other": other, "smallest": smallest, "unit": "m"}


@pytest.mark.parametrize(("level", "least", "most"), [(0.5, 0.4, 0.6), (0.95, 0.9, 0.98)])
def test_coverage_of_an_interval_is_its_level(level, least, most):
    rng = np.random.default_rng(0)
    found = [interval(rng.normal(3.0, 2.0, 30), level=level, seed=k) for k in range(150)]
    assert least <= np.mean([one.low <= 3.0 <= one.high for one in found]) <= most


def test_an_interval_of_a_large_sample_is_that_of_normal_theory():
    values = np.random.default_rng(1).normal(0.0, 1.0, 400)
    found = interval(values)
    half = 1.96 * values.std(ddof=1) / 20.0
    assert found.mean == pytest.approx(values.mean())
    assert found.high - found.low == pytest.approx(2 * half, rel=0.05)


def test_an_interval_is_reproducible_and_wider_at_a_higher_level():
    values = np.random.default_rng(2).exponential(size=15)
    assert interval(values) == interval(values)
    wide, narrow = interval(values, level=0.99), interval(values)
    assert wide.low < narrow.low < narrow.high < wide.high


def test_nan_and_infinite_values_are_left_out():
    assert interval([1.0, math.nan, 3.0, math.inf]) == interval([1.0, 3.0])
    none = interval([math.nan])
    assert none.count == 0
    assert math.isnan(none.mean)
    one, other = [1.0, math.nan, 2.0, 4.0], [0.0, 5.0, math.nan, 1.0]
    assert paired(one, other) == paired([1.0, 4.0], [0.0, 1.0])


def test_the_interval_of_a_constant_sample_has_no_width():
    assert interval([0.5] * 4) == Estimate(mean=0.5, low=0.5, high=0.5, count=4)
    assert interval([7.0]) == Estimate(mean=7.0, low=7.0, high=7.0, count=1)


def test_equal_pairs_have_no_difference():
    found = paired([0.1, 0.2, 0.7], [0.1, 0.2, 0.7])
    assert (found.estimate.mean, found.effect, found.p) == (0.0, 0.0, 1.0)


# Of which 0.1, 0.2 - 0.1 and 0.3 - 0.2 are not the same to a computer.
@pytest.mark.parametrize(("one", "other"), [([0.1] * 3, [0.0] * 3), ([0.1, 0.2, 0.3], [0.0, 0.1, 0.2])])
def test_constant_differences_have_an_infinite_effect(one, other):
    assert paired(one, other).effect == math.inf
    assert paired(other, one).effect == -math.inf
    found = paired(one, other).estimate
    assert found.low == found.high == pytest.approx(0.1)


def test_a_paired_difference_by_hand():
    # Differences 1, 2, 3, 4: mean 2.5, standard deviation sqrt(5/3), and of 16 signs none more extreme.
    found = paired([2.0, 4.0, 6.0, 8.0], [1.0, 2.0, 3.0, 4.0])
    assert found.estimate.mean == 2.5
    assert found.effect == pytest.approx(2.5 / math.sqrt(5 / 3))
    assert found.p == pytest.approx(2 / 16)
    back = paired([1.0, 2.0, 3.0, 4.0], [2.0, 4.0, 6.0, 8.0])
    assert (back.estimate.mean, back.effect, back.p) == (-2.5, -found.effect, found.p)


@pytest.mark.parametrize("pairs", [0, 1])
def test_the_effect_of_fewer_than_two_pairs_is_nan(pairs):
    found = paired([2.0] * pairs, [1.0] * pairs)
    assert found.p == 1.0
    assert math.isnan(found.effect)
    assert verdict(found.estimate, 0.1) == "open"


def test_shares_with_many_ties_can_be_tested():
    assert paired([1.0] * 9 + [0.9], [1.0] * 10).p == 1.0
    assert paired([1.0] * 60, [0.9] * 30 + [1.0] * 30).p < 1e-6


def test_paired_samples_need_one_shape():
    with pytest.raises(ValueError, match="paired"):
        paired([1.0, 2.0], [1.0])


def test_holm_by_hand():
    # Sorted: 0.01 x 4, 0.02 x 3, 0.03 x 2 (no less than the one before), 0.5 x 1.
    assert holm([0.03, 0.01, 0.5, 0.02]) == pytest.approx([0.06, 0.04, 0.5, 0.06])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([0.04]) == [0.04]
    assert holm([]) == holm_levels([]) == []


def test_levels_follow_holm_until_it_stops():
    # All are decided: 0.05 over 3, 2, 1.
    assert holm_levels([0.04, 0.001, 0.02]) == pytest.approx([1 - 0.05, 1 - 0.05 / 3, 1 - 0.05 / 2])
    # The second is not, and so neither is the third, though 0.04 is below 0.05.
    assert holm_levels([0.04, 0.001, 0.03]) == pytest.approx([1 - 0.05 / 2, 1 - 0.05 / 3, 1 - 0.05 / 2])


def test_p_below_its_own_alpha_is_the_same_as_adjusted_p_below_alpha():
    rng = np.random.default_rng(3)
    for _ in range(200):
        p = rng.beta(0.3, 2.0, size=rng.integers(1, 9)).tolist()
        for raw, adjusted, level in zip(p, holm(p), holm_levels(p), strict=True):
            assert (adjusted <= 0.05) == (raw <= 1 - level)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (1.1, 3.0, "holds"),
        (0.5, 3.0, "open"),
        (-0.5, 0.9, "equivalent"),
        (0.1, 0.9, "equivalent"),
        (-3.0, -1.1, "reversed"),
        (-3.0, -0.5, "open"),
        (-2.0, 2.0, "open"),
        (1.0, 3.0, "open"),
        (math.nan, math.nan, "open"),
    ],
)
def test_the_verdicts(low, high, expected):
    assert verdict(estimate(low, high), 1.0) == expected


def test_a_single_value_leaves_every_claim_open():
    assert verdict(estimate(5.0, 5.0, count=1), 1.0) == "open"
    assert claim("more", [5.0], smallest=1.0, unit="m").verdict == "open"
    assert not_worse("no worse", [5.0], margin=1.0, unit="m").verdict == "open"
    assert at_least("so much", [5.0], least=1.0, unit="m").verdict == "open"


@pytest.mark.parametrize(("shift", "expected"), [(0.0, "holds"), (-0.5, "open"), (-2.0, "reversed")])
def test_not_worse_needs_the_whole_interval_above_its_margin(shift, expected):
    values = np.linspace(-1.0, 1.0, 20) + shift
    assert not_worse("no worse", values, margin=0.5, unit="m").verdict == expected


def test_at_least_needs_only_the_mean_beyond_the_least():
    values = np.linspace(-1.0, 1.0, 20) + 0.6
    assert claim("more", values, smallest=0.5, unit="m").verdict == "open"
    assert at_least("so much", values, least=0.5, unit="m").verdict == "holds"
    assert at_least("so much", values, least=0.7, unit="m").verdict == "open"


@pytest.mark.parametrize(("learners", "expected"), [(20, "holds"), (5, "open")])
def test_never_holds_only_with_enough_learners(learners, expected):
    unseen = never("no contact", np.zeros(learners))
    assert unseen.verdict == expected
    assert f"with {3 / learners:.0%} of learners" in unseen.text
    seen = never("no contact", np.arange(learners) < 1)
    assert seen.verdict == "reversed"
    assert seen.estimate.mean == pytest.approx(-100.0 / learners)
    assert "rule of three" not in seen.text


def test_a_difference_is_harder_to_claim_among_many_comparisons():
    rng = np.random.default_rng(4)
    noise = rng.normal(0.0, 1.0, (31, 25))
    clear = question(noise[0] - noise[0].mean() + 0.5 * noise[0].std(), np.zeros(25), smallest=0.0)
    none = [question(one - one.mean(), np.zeros(25), smallest=0.0) for one in noise[1:]]
    (alone,), beside = paired_claims([clear]), paired_claims([clear, *none])
    assert alone.verdict == "holds"
    assert beside[0].verdict == "open"
    assert beside[0].p == pytest.approx(min(1.0, 31 * alone.p))
    assert beside[0].estimate.low < alone.estimate.low
    assert all(one.verdict == "open" and one.p == 1.0 for one in beside[1:])


def test_paired_claims_have_a_direction():
    base, more = np.linspace(0.0, 1.0, 12), np.linspace(0.5, 1.6, 12)
    up, down, same = paired_claims([question(more, base), question(base, more), question(base, base)])
    assert [up.verdict, down.verdict, same.verdict] == ["holds", "reversed", "equivalent"]
    assert up.effect == pytest.approx(-down.effect)
    assert (up.smallest, up.unit) == (0.1, "m")
