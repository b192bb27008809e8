"""Verdicts and intervals: by hand, and by simulation of how often they are wrong."""

import math

import numpy as np
import pytest
from scipy import stats

from drake_shared.analysis.mean_tests import mean_limits, tail_probabilities, verdict_probabilities
from drake_shared.analysis.statistics import (
    ALPHA,
    PERCENT,
    POINTS,
    Question,
    at_least,
    differences,
    holm,
    holm_levels,
    interval,
    judge,
    larger,
    not_worse,
    seldom,
)

DISTRIBUTIONS = {
    "normal": lambda rng, shape: rng.normal(size=shape),
    "exponential": lambda rng, shape: rng.exponential(size=shape) - 1.0,
    "mirrored": lambda rng, shape: 1.0 - rng.exponential(size=shape),
}
"""All with mean 0 and standard deviation 1."""


def question(values, *, above=1.0, below=-1.0, **others):
    return Question(text="more", values=values, unit="m", above=above, below=below, **others)


def errors_at_most(errors, limit):
    """Whether a rate of errors, given as booleans, has a 95% interval with its upper end below ``limit``."""
    return stats.binomtest(int(np.sum(errors)), len(errors)).proportion_ci(0.95, "exact").high <= limit


@pytest.mark.parametrize("n", [6, 10, 20])
@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_intervals_cover_the_mean_as_often_as_they_say(name, n):
    values = DISTRIBUTIONS[name](np.random.default_rng(n), (10_000, n))
    low, high = mean_limits(values, 0.95)
    assert np.mean((low <= 0.0) & (high >= 0.0)) == pytest.approx(0.95, abs=0.03)


@pytest.mark.parametrize("n", [6, 10, 20])
@pytest.mark.parametrize("size", [2, 22])
@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_any_verdict_of_a_family_is_false_in_5_percent(name, size, n):
    # All true effects are at the smallest one of interest, where each of the three verdicts is false.
    for effect in (-1.0, 0.2):
        values = effect + DISTRIBUTIONS[name](np.random.default_rng(1), (2_000, size, n))
        p = verdict_probabilities(values, above=abs(effect), below=-abs(effect))
        smallest = 2.0 * np.min(list(p.values()), axis=(0, 2))
        assert errors_at_most(size * smallest <= ALPHA, 0.08)


@pytest.mark.parametrize("n", [6, 20])
def test_p_values_are_not_below_those_of_exponential_values(n):
    # Few exponential values miss their tail: then they are close to each other, far below the mean.
    values = DISTRIBUTIONS["exponential"](np.random.default_rng(8), (100_000, n))
    _, below = tail_probabilities(values, 0.0)
    for share in (0.025, 0.001):
        assert np.mean(2.0 * below <= share) <= share * 1.2


@pytest.mark.parametrize("real", [5, 11])
def test_true_verdicts_beside_them_do_not_make_false_ones_more_frequent(real):
    # Those that are true are found, and Holm's method spends their share on the others.
    shift = np.where(np.arange(22) < real, 9.0, 0.5)
    values = np.random.default_rng(2).normal(size=(2_000, 22, 20)) + shift[:, None]
    p = verdict_probabilities(values, above=0.5, below=-0.5)
    p = 2.0 * np.min(list(p.values()), axis=0)
    # Holm's method: the smallest p times 22, the next times 21, and so on, until one is above 5%.
    reached = np.cumprod(np.sort(p, axis=1) * np.arange(22, 0, -1) <= ALPHA, axis=1).sum(axis=1)
    decided = p.argsort(axis=1).argsort(axis=1) < reached[:, None]
    assert decided[:, :real].all()
    assert errors_at_most(decided[:, real:].any(axis=1), 0.08)


@pytest.mark.parametrize("n", [6, 10, 20, 50])
def test_a_rare_large_loss_is_seldom_taken_for_none(n):
    # 10% of learners lose 40 points: the mean is -4, and a margin of 2 does not hold. The sum over the
    # number of learners that lose is exact.
    most = 10
    wrong = stats.binom.sf(most, n, 0.1)
    for losing in range(min(n, most) + 1):
        values = np.where(np.arange(n) < losing, -40.0, 0.0)
        (claim,) = judge("f", [not_worse("f", values, 0.0 * values, margin=2.0, unit="", bounds=POINTS)])
        wrong += stats.binom.pmf(losing, n, 0.1) * (claim.verdict == "holds")
    assert wrong <= 0.05


def test_at_least_is_seldom_concluded_from_slightly_less():
    values = 9.9 + np.random.default_rng(3).normal(size=(4_000, 20))
    p = verdict_probabilities(values, above=10.0, below=10.0)
    assert errors_at_most(2.0 * p["holds"] <= ALPHA, 0.05)


def test_exact_intervals_of_shares_are_those_of_clopper_and_pearson():
    for count in range(13):
        found = interval(np.arange(12) < count, bounds=(0.0, 1.0), exact=True)
        expected = stats.binomtest(count, 12).proportion_ci(0.95, "exact")
        assert (found.low, found.high) == pytest.approx(tuple(expected), abs=0.005)


def test_the_interval_of_symmetric_values_is_student_s():
    values = np.linspace(-3.0, 5.0, 9)
    half = stats.t.ppf(0.975, 8) * values.std(ddof=1) / 3.0
    found = interval(values)
    assert (found.low, found.mean, found.high) == pytest.approx((1.0 - half, 1.0, 1.0 + half))


def test_the_long_tail_of_skewed_values_lengthens_their_interval():
    values = np.random.default_rng(4).exponential(size=20)
    found, student = interval(values), stats.t.interval(0.95, 19, values.mean(), stats.sem(values))
    assert found.high > student[1]
    assert found.low == pytest.approx(student[0])


@pytest.mark.parametrize("exact", [False, True])
def test_limits_are_where_the_p_value_is_the_tail(exact):
    values = np.random.default_rng(5).uniform(30.0, 70.0, 12)
    for level in (0.5, 0.95, 0.999):
        low, high = mean_limits(values, level, bounds=PERCENT, exact=exact)
        above, _ = tail_probabilities(values, float(low), bounds=PERCENT, exact=exact)
        _, below = tail_probabilities(values, float(high), bounds=PERCENT, exact=exact)
        assert (above, below) == pytest.approx((0.5 - level / 2,) * 2, abs=1e-4)


def test_identical_values_never_have_an_interval_without_width():
    certain = interval([100.0] * 20, bounds=PERCENT)
    assert (certain.mean, certain.high) == (100.0, 100.0)
    assert certain.low == pytest.approx(100.0 * 0.025 ** (1 / 20), abs=0.3)
    unbounded = interval([0.5] * 20)
    assert (unbounded.low, unbounded.mean, unbounded.high) == (-math.inf, 0.5, math.inf)
    assert interval([0.5]).high == math.inf


def test_a_difference_that_was_not_seen_is_bounded_not_excluded():
    same = np.full(20, 0.3)
    (claim,) = judge("f", [larger("more", same, same, smallest=2.0, unit="points", bounds=POINTS)])
    assert (claim.verdict, claim.effect) == ("open", 0.0)
    assert claim.estimate.low == pytest.approx(-claim.estimate.high)
    assert "14%" in claim.note
    (wide,) = judge("f", [larger("more", same, same, smallest=20.0, unit="points", bounds=POINTS)])
    assert wide.verdict == "equivalent"
    # Differences by rounding only are none, and without bounds of the quantity nothing is known.
    one, other = np.array([0.1, 0.2, 0.7] * 4), np.array([0.3, 0.6, 0.7] * 4) - np.array([0.2, 0.4, 0.0] * 4)
    assert not differences(one, other).any()
    (unbounded,) = judge("f", [larger("more", one, other, smallest=0.1, unit="m")])
    assert unbounded.verdict == "open"


def test_nan_and_infinite_values_are_left_out():
    assert interval([1.0, math.nan, 3.0, math.inf]) == interval([1.0, 3.0])
    assert interval([math.nan]).count == 0
    assert math.isnan(interval([]).mean)


def test_paired_samples_need_one_shape():
    with pytest.raises(ValueError, match="paired"):
        differences([1.0, 2.0], [1.0])


def test_a_question_needs_its_thresholds_in_order():
    with pytest.raises(ValueError, match="below"):
        question([1.0], above=0.0, below=1.0)


def test_holm_by_hand():
    # Sorted: 0.01 x 4, 0.02 x 3, 0.03 x 2 (no less than the one before), 0.5 x 1.
    assert holm([0.03, 0.01, 0.5, 0.02]) == pytest.approx([0.06, 0.04, 0.5, 0.06])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == holm_levels([]) == []


def test_levels_follow_holm_until_it_stops():
    # All are decided: 0.05 over 3, 2, 1.
    assert holm_levels([0.04, 0.001, 0.02]) == pytest.approx([1 - 0.05, 1 - 0.05 / 3, 1 - 0.05 / 2])
    # The second is not, and so neither is the third, though 0.04 is below 0.05.
    assert holm_levels([0.04, 0.001, 0.03]) == pytest.approx([1 - 0.05 / 2, 1 - 0.05 / 3, 1 - 0.05 / 2])


def test_interval_p_and_verdict_of_every_claim_agree():
    rng = np.random.default_rng(6)
    seen = set()
    for _ in range(6):
        n = int(rng.integers(6, 25))
        family = [question(rng.normal(size=n) + shift) for shift in rng.uniform(-3.0, 3.0, 5)]
        family.append(question(rng.exponential(size=n) ** 2, above=0.2, below=0.2))
        family.append(question(1.0 * (rng.random(n) < 0.1), above=0.4, below=0.0, bounds=(0.0, 1.0)))
        for asked, claim in zip(family, judge("f", family), strict=True):
            low, high = claim.estimate.low, claim.estimate.high
            within = "open"
            if low > asked.above:
                within = "holds"
            elif high < asked.below:
                within = "reversed"
            elif low > asked.below and high < asked.above:
                within = "equivalent"
            assert claim.verdict == within
            assert (claim.p <= ALPHA) == (within != "open")
            seen.add(within)
    assert seen == {"holds", "reversed", "equivalent", "open"}


def test_five_values_leave_every_claim_open():
    values = np.array([5.0, 5.1, 5.2, 5.3, 5.4])
    for asked in (
        larger("more", values, 0.0 * values, smallest=1.0, unit="m"),
        at_least("so much", values, least=1.0, unit="m"),
        seldom("never", 0.0 * values, most=90.0),
    ):
        (claim,) = judge("f", [asked])
        assert (claim.verdict, claim.p) == ("open", 1.0)


@pytest.mark.parametrize(("shift", "expected"), [(0.0, "holds"), (-0.5, "open"), (-2.0, "reversed")])
def test_not_worse_needs_the_whole_interval_above_its_margin(shift, expected):
    values = np.linspace(-1.0, 1.0, 20) + shift
    (claim,) = judge("f", [not_worse("no worse", values, 0.0 * values, margin=0.5, unit="m")])
    assert claim.verdict == expected
    assert claim.smallest == -0.5


@pytest.mark.parametrize(("learners", "expected"), [(20, "holds"), (10, "open")])
def test_a_rare_event_needs_enough_learners_without_it(learners, expected):
    # None in 20 leaves up to 17% of learners, none in 10 up to 31%.
    (claim,) = judge("f", [seldom("contact", np.zeros(learners), most=20.0)])
    assert claim.verdict == expected
    (often,) = judge("f", [seldom("contact", np.arange(learners) % 2, most=20.0)])
    assert often.verdict in ("reversed", "open")
    assert often.estimate.mean == -50.0


def test_a_difference_is_harder_to_claim_among_many():
    rng = np.random.default_rng(7)
    noise = rng.normal(size=(30, 25))
    noise -= noise.mean(axis=1, keepdims=True)
    clear = question(noise[0] + 0.5, above=0.0, below=0.0, paired=True)
    (alone,) = judge("f", [clear])
    beside = judge("f", [clear, *(question(one, above=0.0, below=0.0) for one in noise[1:])])
    assert (alone.verdict, beside[0].verdict) == ("holds", "open")
    assert beside[0].p == pytest.approx(min(1.0, 30 * alone.p))
    assert beside[0].estimate.low < alone.estimate.low
    assert alone.effect == pytest.approx(0.5 / noise[0].std(ddof=1))


def test_claims_have_a_direction():
    base, more = np.linspace(0.0, 1.0, 12), np.linspace(0.5, 1.6, 12)
    up, down = judge(
        "f", [larger("f", *pair, smallest=0.1, unit="m") for pair in ((more, base), (base, more))]
    )
    assert (up.verdict, down.verdict) == ("holds", "reversed")
    assert up.effect == pytest.approx(-down.effect)
