"""Adaptive conformal intervals: coverage on streams with a known shift, and round a learner."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from drake_shared.common.errors import InputError
from drake_shared.learners import check_learner, load_learner
from drake_shared.learners.conformal import AdaptiveConformal, ConformalLearner, score_of


def coverage(conformal, scores):
    return float(np.mean([conformal.observe(score) for score in scores]))


@pytest.mark.parametrize("level", [0.8, 0.9, 0.95])
def test_coverage_stays_nominal_where_the_errors_grow_threefold(level):
    scores = np.abs(np.random.default_rng(4).standard_normal(6_000))
    scores[3_000:] *= 3.0
    conformal = AdaptiveConformal(coverage=level)
    assert coverage(conformal, scores[:3_000]) == pytest.approx(level, abs=0.02)
    assert coverage(conformal, scores[3_000:]) == pytest.approx(level, abs=0.02)
    # A factor that does not adapt loses it.
    fixed = np.quantile(scores[:3_000], level)
    assert (scores[3_000:] <= fixed).mean() < level - 0.15


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=300), st.sampled_from([0.5, 0.9]))
def test_the_share_of_misses_is_bounded_whatever_the_errors_are(scores, level):
    # Proposition 4.1 of Gibbs and Candes 2021.
    rate = 0.05
    found = coverage(AdaptiveConformal(coverage=level, rate=rate), scores)
    bound = (max(level, 1.0 - level) + rate) / (rate * len(scores))
    assert abs(found - level) <= bound + 1e-9


def test_the_factor_is_the_quantile_of_the_scores_kept():
    conformal = AdaptiveConformal(coverage=0.9, rate=1e-14, memory=99)
    for score in [1e6, *range(1, 100)]:
        conformal.observe(float(score))
    assert conformal.largest == 99.0  # The first one is forgotten.
    assert conformal.factor == 90.0  # ceil(0.9 (99 + 1))


def test_a_score_is_the_factor_at_which_the_interval_just_covers():
    sigma, level = np.array([0.1, 0.2]), 0.9
    width = 1.6448536269514722 * sigma
    assert score_of(width, sigma**2, level) == pytest.approx(1.0)
    assert score_of(np.array([0.0, -2.0]) * width, sigma**2, level) == pytest.approx(2.0)


@pytest.mark.parametrize("offset", [0.0, 0.4])
def test_coverage_round_a_learner_in_and_out_of_distribution(offset):
    learner = load_learner("two_obstacles")
    conformal = AdaptiveConformal(rate=0.05)
    rng = np.random.default_rng(0)
    covered, plain = [], []
    for trial in range(18):
        # Offsets are far from all demonstrations.
        path = learner.demonstrations[trial % 3] + offset * np.sin(0.8 * learner.grid)[:, None] * [0.0, 1.0]
        path = path + 0.01 * rng.standard_normal(path.shape)
        wrapped = ConformalLearner(learner, conformal=conformal)
        for time, position in zip(learner.grid, path, strict=True):
            known = wrapped.observe(time, position)
            if known is not None:
                covered.append(known)
                mean, variance = learner.predict(
                    np.array([time - 1.0]), path[None, round((time - 1.0) * 10)], np.array([time])
                )
                plain.append(score_of(position - mean[0], variance[0], 0.9) <= 1.0)
    assert np.mean(covered) == pytest.approx(0.9, abs=0.02)
    assert abs(np.mean(plain) - 0.9) > 0.03


def test_the_wrapper_is_a_learner_whose_variance_is_scaled():
    learner = load_learner("two_obstacles")
    conformal = AdaptiveConformal()
    wrapped = ConformalLearner(learner, conformal=conformal)
    check_learner(wrapped)
    query = np.array([1.0]), learner.demonstrations[0, 10:11], learner.grid[20:]
    mean, variance = learner.predict(*query)
    np.testing.assert_array_equal(wrapped.predict(*query)[1], variance)
    conformal.observe(2.0)
    assert math.isinf(conformal.factor)  # One score does not bound a tenth of those to come.
    scaled_mean, scaled = wrapped.predict(*query)
    np.testing.assert_array_equal(scaled_mean, mean)
    np.testing.assert_allclose(scaled, 4.0 * variance)
    for _ in range(50):
        conformal.observe(0.0)
    assert conformal.factor == 0.0
    # However small the errors are, a variance stays positive.
    assert (wrapped.predict(*query)[1] > 0.0).all()


def test_an_alpha_of_1_covers_nothing_and_one_of_0_everything():
    conformal = AdaptiveConformal(coverage=0.5, rate=0.5)
    assert conformal.factor == 1.0
    assert conformal.observe(1.0)
    assert conformal.alpha == 0.75
    # With one score and the one to come, the quantile at a quarter is the smallest.
    assert conformal.factor == 1.0
    assert conformal.observe(0.5)
    assert conformal.alpha == 1.0
    assert conformal.factor == 0.0
    for score in (10.0, 20.0, 30.0, 40.0):
        assert not conformal.observe(score)
    assert conformal.alpha == 0.0
    assert conformal.factor == math.inf
    assert conformal.observe(99.0)


def test_a_forecast_is_scored_at_its_time_and_by_the_factor_of_its_own_time():
    learner = load_learner("two_obstacles")
    conformal = AdaptiveConformal(coverage=0.5)
    wrapped = ConformalLearner(learner, ahead=0.5, conformal=conformal)
    path, grid = learner.demonstrations[0], learner.grid
    told = [wrapped.observe(time, path[step]) for step, time in enumerate(grid[:8])]
    assert told[:5] == [None] * 5
    assert None not in told[5:]
    # The robot jumps far away: no interval covers that.
    assert wrapped.observe(grid[8], path[8] + 50.0) is False
    # Nothing is predicted for times after the end.
    late = ConformalLearner(learner, ahead=0.5, conformal=conformal)
    assert late.observe(learner.duration - 0.4, path[-5]) is None
    assert late.observe(learner.duration, path[-1]) is None


@pytest.mark.parametrize("ahead", [0.0, -1.0, math.inf, math.nan])
def test_a_time_ahead_that_is_not_positive_and_finite_is_refused(ahead):
    with pytest.raises(InputError) as caught:
        ConformalLearner(load_learner("two_obstacles"), ahead=ahead)
    assert caught.value.field == "ahead"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("coverage", 0.0),
        ("rate", math.inf),
        ("coverage", 1.0),
        ("rate", 0.0),
        ("memory", 0),
        ("coverage", math.nan),
    ],
)
def test_numbers_out_of_range_are_refused(field, value):
    with pytest.raises(InputError) as caught:
        AdaptiveConformal(**{field: value})
    assert caught.value.field == field
