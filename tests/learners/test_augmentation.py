"""Demonstrations of one route are mixed, those of two routes never."""

import numpy as np
import pytest

from drake_shared.learners.augmentation import low_frequency_basis, make_neighborhoods, unexplained


def routes(*heights: float) -> np.ndarray:
    share = np.linspace(0.0, 1.0, 11)
    return np.stack([np.stack([share, height * np.sin(np.pi * share)], axis=-1) for height in heights])


def test_two_routes_do_not_mix():
    shares, gains = make_neighborhoods(routes(1.0, -1.0), reach=0.2, widening=1.0)
    np.testing.assert_allclose(shares, np.eye(2), atol=1e-12)
    np.testing.assert_array_equal(gains, 1.0)


def test_equal_demonstrations_have_equal_weights_and_few_are_widened():
    shares, gains = make_neighborhoods(routes(0.3, 0.3, 0.3), reach=0.1, widening=1.2)
    np.testing.assert_allclose(shares, 1 / 3)
    np.testing.assert_allclose(gains, 1.2 * np.sqrt(3 / 2))
    np.testing.assert_allclose(unexplained(shares), np.sqrt(1 / 3))


def test_two_equal_demonstrations_are_widened_most():
    _, gains = make_neighborhoods(routes(0.3, 0.3), reach=0.1, widening=1.0)
    np.testing.assert_allclose(gains, np.sqrt(2.0))


def test_weights_fall_with_the_largest_distance():
    shares, _ = make_neighborhoods(routes(0.0, 0.1), reach=0.1, widening=1.0)
    assert shares[0, 1] / shares[0, 0] == pytest.approx(np.exp(-0.5))


def test_samples_vary_as_the_demonstrations_do():
    rng = np.random.default_rng(0)
    paths = routes(*rng.normal(0.5, 0.02, 40))
    shares, gains = make_neighborhoods(paths, reach=1.0, widening=1.0)
    normal = rng.standard_normal((20_000, 40)) * np.sqrt(shares[0]) * gains[0]
    parts = shares[0] * (1.0 - normal.sum(axis=1, keepdims=True)) + normal
    drawn = parts @ paths[:, 5, 1]
    assert drawn.mean() == pytest.approx(paths[:, 5, 1].mean(), abs=1e-3)
    assert drawn.std() == pytest.approx(paths[:, 5, 1].std(ddof=1), rel=0.03)


def test_low_frequency_noise_is_smooth_of_variance_one_and_zero_at_the_ends():
    basis = low_frequency_basis(401)
    np.testing.assert_allclose(basis[:, [0, -1]], 0.0, atol=1e-12)
    assert np.square(basis).sum(axis=0).mean() == pytest.approx(1.0, rel=0.01)
    assert np.abs(np.diff(basis, axis=1)).max() * 400 < 2.0 * np.pi
