"""Calibration of the confidence on trials."""

import numpy as np
import pytest

from drake_shared.analysis.confidence_calibration import ConfidenceSteps, confidence_calibration
from drake_shared.analysis.confidence_fit import calibrated_confidence, open_ways_of
from drake_shared.common.errors import InputError
from drake_shared.learners import load_learner
from drake_shared.scenario import load_scenario


def drawn(seed: int, count: int = 4_000):
    """Ratios, and forecasts that are correct with a probability that falls with the ratio."""
    rng = np.random.default_rng(seed)
    logs = rng.uniform(-2.0, 2.0, count)
    return 10.0**logs, rng.random(count) < 1.0 / (1.0 + np.exp(3.0 * logs))


def test_the_probability_that_is_fitted_has_hardly_a_calibration_error_on_other_steps():
    calibration = calibrated_confidence(*drawn(0), [])
    ratio, correct = drawn(1)
    steps = ConfidenceSteps(confidence=calibration.on_demonstrated(ratio), correct=correct)
    judged = confidence_calibration([steps])
    assert judged["expected_calibration_error"] < 0.03
    own = ConfidenceSteps(confidence=np.minimum(1.0, 1.0 / ratio), correct=correct)
    assert confidence_calibration([own])["expected_calibration_error"] > 0.1


def test_it_never_rises_with_the_variance_and_equal_ratios_are_one_point():
    ratio = np.repeat([0.1, 1.0, 10.0], 100)
    calibration = calibrated_confidence(ratio, np.arange(300) % 3 < 2, [])
    assert np.allclose(calibration.log_ratio, [-1.0, 0.0, 1.0])
    assert all(np.diff(calibration.probability) <= 0.0)
    assert calibration.probability[0] == pytest.approx(2 / 3, abs=0.01)


def test_without_steps_nothing_can_be_calibrated():
    with pytest.raises(InputError):
        calibrated_confidence(np.array([np.nan]), np.array([True]), [])


def test_of_the_shipped_demonstrations_one_leaves_a_way_open_that_was_never_shown():
    scenario, learner = load_scenario("two_obstacles"), load_learner("two_obstacles")
    ways = open_ways_of(scenario, learner)
    # Past the first obstacle on the right, only the left of the second was shown; on the left, both sides.
    (way,) = [way for ways_of_one in ways for way in ways_of_one]
    index = next(index for index, ways_of_one in enumerate(ways) if ways_of_one)
    path = learner.demonstrations[index]
    assert path[np.abs(path[:, 0] - 1.4).argmin(), 1] < 0.0
    assert way.alike == 1
    # It stays open beyond the middle, where the ways part, and ends before the obstacle.
    x = np.interp(way.until, learner.grid, path[:, 0])
    assert 2.5 < x < 3.35
