"""The rule of Robot-Trajectron V2 against the product of Gaussians."""

import numpy as np
from hypothesis import given, strategies as st
from scipy.stats import norm

from drake_shared.arbitration.rt_v2 import corrected_modes, obstacle_cost

velocities = st.floats(-1.0, 1.0)
pairs = st.tuples(velocities, velocities)


@given(pairs, pairs, pairs, st.floats(0.001, 1.0), st.floats(0.01, 1.0), st.floats(0.05, 0.95))
def test_a_mode_is_corrected_to_the_product_of_its_density_and_that_of_the_command(u, a, b, s, r, share):
    mean = np.array([a, b])[..., None]
    variance = np.full_like(mean, s)
    prior = np.array([[share], [1.0 - share]])
    probability, corrected, gain = corrected_modes(
        prior, mean, variance, np.array(u)[:, None], command_variance=r
    )
    product = (mean / s + np.array(u)[:, None] / r) / (1.0 / s + 1.0 / r)
    np.testing.assert_allclose(corrected, product, atol=1e-9)
    assert ((gain >= 0.0) & (gain <= 1.0)).all()
    density = norm.pdf(np.array(u)[:, None], mean, np.sqrt(s)).prod(axis=1) + 1e-5
    np.testing.assert_allclose(probability, prior * density / (prior * density).sum(), rtol=1e-6)


def test_obstacles_cost_more_the_nearer_they_are_and_nothing_far_away():
    cost = obstacle_cost(np.array([0.1, 0.4, 0.5, 0.6, 2.0]), contact=0.3, near=0.6)
    assert cost[0] == 9999.0
    assert cost[1] > cost[2] > cost[3] == cost[4] == 0.0
