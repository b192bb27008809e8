"""K makes c_f 0.05 at the 95th percentile of the mean variance along the demonstrations."""

import numpy as np
import pytest

from drake_shared.learners import calibrate, confidence, mean_variance
from drake_shared.learners.calibration import variances_along


class Ramp:
    """Predicts a variance that falls with the time of the observation, from 1 m^2 to 0.01 m^2."""

    grid = np.linspace(0.0, 4.0, 41)

    def predict(self, times, positions, query_times):
        variance = 1.0 - 0.99 * np.asarray(times)[0] / 4.0
        return np.zeros((len(query_times), 2)), np.full((len(query_times), 2), variance)


def test_confidence_is_one_twentieth_at_the_95th_percentile(make_bows):
    gain = calibrate(Ramp(), make_bows([1.0, -1.0]))
    percentile = np.percentile(1.0 - 0.99 * np.arange(41) / 40, 95)
    assert confidence(percentile, gain) == pytest.approx(0.05)


def test_as_the_paper_says_it_is_one_twentieth_at_the_largest_variance(make_bows):
    gain = calibrate(Ramp(), make_bows([1.0, -1.0]), calibration="largest")
    assert confidence(1.0, gain) == pytest.approx(0.05)


def test_the_resolution_bounds_the_gain(make_bows):
    assert calibrate(Ramp(), make_bows([1.0]), resolution=0.5) == pytest.approx(1 / 0.5**2)


@pytest.mark.parametrize(("count", "every"), [(73, 1), (147, 2), (300, 4)])
def test_of_many_points_some_thousands_that_are_evenly_spaced_are_tried(count, every):
    found = variances_along(Ramp(), [np.zeros((41, 2))] * count)
    steps = np.arange(0, count * 41, every) % 41
    np.testing.assert_allclose(found, 1.0 - 0.99 * steps / 40)


def test_a_trained_learner_is_confident_after_routes_part_and_not_before(learner, two_ways):
    assert learner.confidence_gain == pytest.approx(calibrate(learner, two_ways))
    shares = []
    for time, position in ((0.0, [0.0, 0.0]), (1.5, [1.5, np.sin(1.5 * np.pi / 4)])):
        _, variance = learner.predict([time], [position], learner.grid)
        spread = mean_variance(learner.grid, variance, time)
        shares.append(confidence(spread, learner.confidence_gain))
    assert shares[0] < 0.1
    assert shares[1] == 1.0
