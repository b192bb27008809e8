"""A consistency model of demonstrated actions."""

import numpy as np
import pytest

from drake_shared.learners.consistency.model import (
    LEAST_NOISE,
    MOST_NOISE,
    consistency_scalings,
    denoiser_scalings,
    noise_level,
)
from drake_shared.learners.consistency.training import demonstrated_actions, train_consistency
from drake_shared.learners.dataset import make_grid, resample

LEFT, RIGHT = np.array([0.3, 0.2]), np.array([0.3, -0.2])


@pytest.fixture(scope="module")
def model():
    """Where x is negative there are two actions, elsewhere the left one alone."""
    random = np.random.default_rng(1)
    positions = random.uniform(-1.0, 1.0, (4000, 2))
    is_right = (random.random(4000) < 0.5) & (positions[:, 0] < 0.0)
    actions = np.where(is_right[:, None], RIGHT, LEFT) + 0.01 * random.standard_normal((4000, 2))
    return train_consistency(positions, actions, iterations=500)


def test_noise_levels_begin_at_the_least_and_end_at_the_largest():
    levels = noise_level(np.linspace(0.0, 1.0, 9))
    assert levels[[0, -1]] == pytest.approx([LEAST_NOISE, MOST_NOISE])
    assert (np.diff(levels) > 0.0).all()


def test_scalings_by_hand():
    # At a noise as large as the spread of the data, 0.5.
    assert denoiser_scalings(0.5) == pytest.approx((0.5, 0.5 / 2.0**0.5, 2.0**0.5))
    assert consistency_scalings(LEAST_NOISE)[:2] == (1.0, 0.0)
    skip, out, inner = consistency_scalings(0.502)
    assert (skip, inner) == pytest.approx((0.5, 1.0 / (0.502**2 + 0.25) ** 0.5))
    assert out == pytest.approx(0.25 * inner)
    # Levels are even in their seventh roots.
    assert noise_level(0.5) == pytest.approx((0.5 * (0.002 ** (1 / 7) + 80.0 ** (1 / 7))) ** 7)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_at_the_least_noise_it_is_the_identity(size):
    random = np.random.default_rng(size)
    positions, actions = random.standard_normal((2, 50, size))
    untrained = train_consistency(positions, actions, iterations=2)
    action = random.standard_normal(size)
    np.testing.assert_allclose(untrained.denoised(positions[0], action, 0.0), action, atol=1e-12)
    assert not np.allclose(untrained.denoised(positions[0], action, 0.5), action)


@pytest.mark.parametrize("mode", [LEFT, RIGHT], ids=["left", "right"])
def test_one_step_recovers_the_demonstrated_action_that_is_near(model, mode):
    errors = np.array([[0.0, 0.0], [0.05, 0.03], [-0.05, -0.03], [0.05, -0.05], [0.0, 0.06]])
    for degree in (0.3, 0.35):
        found = [model.denoised(np.array([-0.5, 0.2]), mode + error, degree) for error in errors]
        left = np.linalg.norm(found - mode, axis=1)
        assert left.max() < 0.06
        assert left.mean() < 0.6 * np.linalg.norm(errors, axis=1).mean()


def test_at_full_noise_the_action_does_not_depend_on_what_was_given(model):
    found = [
        model.denoised(np.array([0.5, 0.0]), action, 1.0) for action in (LEFT, RIGHT, -LEFT, np.zeros(2))
    ]
    np.testing.assert_allclose(found, [LEFT] * 4, atol=0.04)


def test_the_same_seed_gives_the_same_bits():
    random = np.random.default_rng(0)
    positions, actions = random.standard_normal((2, 50, 2))
    first, again, other = (
        train_consistency(positions, actions, seed=seed, iterations=3) for seed in (0, 0, 1)
    )
    for (weights, _), (same, _), (different, _) in zip(first.layers, again.layers, other.layers, strict=True):
        np.testing.assert_array_equal(weights, same)
        assert not np.array_equal(weights, different)


def test_a_seed_gives_the_model_of_version_0_2(make_bows):
    grid = make_grid(4.0)
    paths = np.stack([resample(item, grid) for item in make_bows([1.0, -1.0])])
    positions, actions = demonstrated_actions(paths, grid, horizon=0.5)
    np.testing.assert_allclose(positions[:2], [[2.91291, -1.04243], [1.13537, -0.55691]], atol=1e-5)
    np.testing.assert_allclose(actions[:2], [[0.38709, 0.51994], [0.46463, -0.39415]], atol=1e-5)
    model = train_consistency(positions, actions, iterations=30)
    found = [model.denoised(positions[0], np.array([0.3, 0.3]), degree) for degree in (0.2, 0.5, 0.9)]
    expected = [[0.30750, 0.33984], [0.46156, 0.35944], [0.47594, 0.38896]]
    np.testing.assert_allclose(found, expected, atol=2e-3)


def test_actions_lead_back_to_where_the_demonstration_is_after_the_horizon():
    grid = np.linspace(0.0, 4.0, 41)
    paths = np.stack([[grid, side * grid] for side in (-1.0, 1.0)]).transpose(0, 2, 1)
    positions, actions = demonstrated_actions(paths, grid, horizon=0.5)
    ends = positions + actions
    np.testing.assert_allclose(abs(ends[:, 1]), ends[:, 0], atol=1e-12)
    assert ends.min(axis=0)[0] == pytest.approx(0.5)
    # From the last half second on, they lead to the end, where the demonstrations stay.
    assert ends.max(axis=0)[0] == 4.0
    beside = np.abs(np.abs(positions[:, 1]) - positions[:, 0])
    assert 0.1 < np.median(beside) < 1.5
