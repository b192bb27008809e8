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
def test_an_interval_covers_the_truth_as_often_as_it_says(level, least, most):
    rng = np.random.default_rng(0)
    found = [interval(rng.normal(3.0, 2.0, 30), level=level, seed=k) for k in range(150)]
    assert least <= np.mean([one.low <= 3.0 <= one.high for one in found]) <= most


def test_an_interval_is_that_of_the_normal_theory_where_samples_are_large():
    values = np.random.default_rng(1).normal(0.0, 1.0, 400)
    found = interval(values)
    half = 1.96 * values.std(ddof=1) / 20.0
    assert found.mean == pytest.approx(values.mean())
    assert found.high - found.low == pytest.approx(2 * half, rel=0.05)


def test_an_interval_is_the_same_again_and_wider_at_a_higher_level():
    values = np.random.default_rng(2).exponential(size=15)
    assert interval(values) == interval(values)
    wide, narrow = interval(values, level=0.99), interval(values)
    assert wide.low < narrow.low < narrow.high < wide.high


def test_what_is_not_a_number_does_not_count():
    assert interval([1.0, math.nan, 3.0, math.inf]) == interval([1.0, 3.0])
    none = interval([math.nan])
    assert none.count == 0
    assert math.isnan(none.mean)
    one, other = [1.0, math.nan, 2.0, 4.0], [0.0, 5.0, math.nan, 1.0]
    assert paired(one, other) == paired([1.0, 4.0], [0.0, 1.0])


def test_samples_that_are_all_one_number_have_no_width():
    assert interval([0.5] * 4) == Estimate(mean=0.5, low=0.5, high=0.5, count=4)
    assert interval([7.0]) == Estimate(mean=7.0, low=7.0, high=7.0, count=1)


def test_pairs_without_any_difference_differ_by_nothing():
    found = paired([0.1, 0.2, 0.7], [0.1, 0.2, 0.7])
    assert (found.estimate.mean, found.effect, found.p) == (0.0, 0.0, 1.0)


# Of which 0.1, 0.2 - 0.1 and 0.3 - 0.2 are not the same to a computer.
@pytest.mark.parametrize(("one", "other"), [([0.1] * 3, [0.0] * 3), ([0.1, 0.2, 0.3], [0.0, 0.1, 0.2])])
def test_pairs_that_always_differ_by_as_much_have_an_infinite_effect(one, other):
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
def test_too_few_pairs_say_nothing(pairs):
    found = paired([2.0] * pairs, [1.0] * pairs)
    assert found.p == 1.0
    assert math.isnan(found.effect)
    assert verdict(found.estimate, 0.1) == "open"


def test_shares_with_many_equal_pairs_can_be_tested():
    assert paired([1.0] * 9 + [0.9], [1.0] * 10).p == 1.0
    assert paired([1.0] * 60, [0.9] * 30 + [1.0] * 30).p < 1e-6


def test_pairs_need_partners():
    with pytest.raises(ValueError, match="paired"):
        paired([1.0, 2.0], [1.0])


def test_holm_by_hand():
    # Sorted: 0.01 x 4, 0.02 x 3, 0.03 x 2 (no less than the one before), 0.5 x 1.
    assert holm([0.03, 0.01, 0.5, 0.02]) == pytest.approx([0.06, 0.04, 0.5, 0.06])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([0.04]) == [0.04]
    assert holm([]) == holm_levels([]) == []


def test_levels_follow_holm_as_far_as_it_gets():
    # All are decided: 0.05 over 3, 2, 1.
    assert holm_levels([0.04, 0.001, 0.02]) == pytest.approx([1 - 0.05, 1 - 0.05 / 3, 1 - 0.05 / 2])
    # The second is not, and so neither is the third, though 0.04 is below 0.05.
    assert holm_levels([0.04, 0.001, 0.03]) == pytest.approx([1 - 0.05 / 2, 1 - 0.05 / 3, 1 - 0.05 / 2])


def test_a_level_goes_with_its_adjusted_p():
    rng = np.random.default_rng(3)
    for _ in range(200):
        p = rng.beta(0.3, 2.0, size=rng.integers(1, 9)).tolist()
        for raw, adjusted, level in zip(p, holm(p), holm_levels(p), strict=True):
            assert (adjusted <= 0.05) == (raw <= 1 - level)


@pytest.mark.parametrize(
    ("low", "high", "said"),
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
def test_the_verdicts(low, high, said):
    assert verdict(estimate(low, high), 1.0) == said


def test_one_alone_is_never_enough():
    assert verdict(estimate(5.0, 5.0, count=1), 1.0) == "open"
    assert claim("more", [5.0], smallest=1.0, unit="m").verdict == "open"
    assert not_worse("no worse", [5.0], margin=1.0, unit="m").verdict == "open"
    assert at_least("so much", [5.0], least=1.0, unit="m").verdict == "open"


@pytest.mark.parametrize(("shift", "said"), [(0.0, "holds"), (-0.5, "open"), (-2.0, "reversed")])
def test_not_worse_needs_the_whole_interval_above_its_margin(shift, said):
    values = np.linspace(-1.0, 1.0, 20) + shift
    assert not_worse("no worse", values, margin=0.5, unit="m").verdict == said


def test_at_least_needs_its_mean_alone_beyond_the_least():
    values = np.linspace(-1.0, 1.0, 20) + 0.6
    assert claim("more", values, smallest=0.5, unit="m").verdict == "open"
    assert at_least("so much", values, least=0.5, unit="m").verdict == "holds"
    assert at_least("so much", values, least=0.7, unit="m").verdict == "open"


@pytest.mark.parametrize(("learners", "said"), [(20, "holds"), (5, "open")])
def test_what_nobody_saw_is_said_never_to_happen_only_where_many_had_the_chance(learners, said):
    unseen = never("no contact", np.zeros(learners))
    assert unseen.verdict == said
    assert f"with {3 / learners:.0%} of learners" in unseen.text
    seen = never("no contact", np.arange(learners) < 1)
    assert seen.verdict == "reversed"
    assert seen.estimate.mean == pytest.approx(-100.0 / learners)
    assert "rule of three" not in seen.text


def test_the_same_difference_is_harder_to_claim_beside_many_that_are_none():
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


def test_paired_claims_say_which_way():
    base, more = np.linspace(0.0, 1.0, 12), np.linspace(0.5, 1.6, 12)
    up, down, same = paired_claims([question(more, base), question(base, more), question(base, base)])
    assert [up.verdict, down.verdict, same.verdict] == ["holds", "reversed", "equivalent"]
    assert up.effect == pytest.approx(-down.effect)
    assert (up.smallest, up.unit) == (0.1, "m")
