"""Eq. (1) by hand."""

import math
import subprocess
import sys

import numpy as np
import pytest

from drake_shared.learners import Learner, confidence, mean_variance

TIMES = np.array([0.0, 1.0, 2.0, 3.0])
VARIANCE = np.array([[9.0, 9.0], [1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])


def test_mean_variance_is_over_the_steps_after_t_and_over_x_and_y():
    assert mean_variance(TIMES, VARIANCE, 0.0) == pytest.approx((1 + 2 + 3 + 4 + 5 + 6) / 6)
    assert mean_variance(TIMES, VARIANCE, 1.5) == pytest.approx((3 + 4 + 5 + 6) / 4)
    assert mean_variance(TIMES, VARIANCE, -1.0) == pytest.approx(VARIANCE.mean())


def test_a_query_at_t_is_not_after_it_whatever_the_rounding():
    t = 0.1 + 0.2 + 0.7 - 1e-16
    assert mean_variance(TIMES, VARIANCE, t) == mean_variance(TIMES, VARIANCE, 1.0)
    assert mean_variance(TIMES, VARIANCE, 1.0 - 1e-12) == mean_variance(TIMES, VARIANCE, 1.0)


@pytest.mark.parametrize("t", [3.0, 3.1, 100.0])
def test_at_the_end_the_last_query_alone_counts(t):
    assert mean_variance(TIMES, VARIANCE, t) == 5.5


def test_confidence_is_the_inverse_of_k_times_the_mean_variance_within_0_and_1():
    assert confidence(0.5, 40.0) == pytest.approx(1 / 20)
    assert confidence(1 / 40, 40.0) == 1.0
    assert confidence(1e-9, 40.0) == 1.0
    assert confidence(0.0, 40.0) == 1.0
    assert confidence(math.inf, 40.0) == 0.0


def test_nan_variance_gives_nan_confidence():
    assert math.isnan(confidence(math.nan, 40.0))


def test_trained_learners_offer_the_interface(learner, paper_learner):
    assert isinstance(learner, Learner)
    assert isinstance(paper_learner, Learner)
    assert (learner.name, learner.preset, paper_learner.preset) == ("cnmp", "default", "paper")
    assert (learner.metadata["clock"], paper_learner.metadata["clock"]) == ("progress", "time")
    assert learner.metadata["scenario"] == "bows"
    np.testing.assert_allclose(learner.grid, np.arange(41) * 0.1, atol=1e-12)
    assert learner.duration == 4.0
    for shared in (learner.grid, learner.demonstrations):
        assert not shared.flags.writeable


def test_prediction_does_not_import_torch():
    code = "import sys, drake_shared.learners as l; l.find_learner('cnmp'); print('torch' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"
