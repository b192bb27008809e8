"""The power of a planned study is that of its test."""

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.power import TTestPower

from drake_shared.study.design import DeclaredMeasure
from drake_shared.study.power import power_in_studies
from drake_shared.study.simulated import simulated_behaviours


@pytest.mark.parametrize("effect", [0.0, 0.6, 1.0])
def test_power_of_a_paired_contrast_is_that_of_the_t_test(effect):
    # Differences with the quantiles of a normal distribution of standard deviation 1.
    differences = stats.norm.ppf((np.arange(400) + 0.5) / 400)
    measure = DeclaredMeasure(name="completion_time", smallest_effect=max(effect, 1e-9))
    found = power_in_studies(measure, (differences, np.zeros(400)), 12, 0.05, True)
    known = TTestPower().power(effect_size=effect, nobs=12, alpha=0.05)
    assert found == pytest.approx(known, abs=0.03)


def test_simulated_participants_differ_and_follow_from_the_seed():
    some = simulated_behaviours(5, seed=1)
    assert some == simulated_behaviours(5, seed=1)
    assert len({item.delay for item in some}) == 5
