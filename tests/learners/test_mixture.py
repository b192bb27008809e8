"""A mixture keeps routes apart that a single Gaussian would average."""

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners import load_learner, save_learner, train
from drake_shared.learners.route_clustering import group_by_route

T = np.linspace(0.0, 10.0, 101)


def way(side: float, *, score: float | None = None) -> Demonstration:
    """From (0, 0) to (5, 0), passing (2.5, side)."""
    x = 0.5 * T
    return Demonstration(times=T, positions=np.stack([x, side * np.sin(np.pi * x / 5) ** 2], -1), score=score)


@pytest.fixture(scope="module")
def fork():
    demonstrations = Demonstrations(items=(way(1.0, score=0.3), way(-1.0, score=0.1)))
    return train(demonstrations, learner="mixture", iterations=300)


def test_demonstrations_are_grouped_by_route():
    sides = [1.0, -1.0, 1.05, 0.95, -0.9]
    positions = np.stack([way(side).positions for side in sides])
    groups = group_by_route(positions)
    assert [group.tolist() for group in groups] == [[0, 2, 3], [1, 4]]
    assert [group.tolist() for group in group_by_route(positions[:1])] == [[0]]


def test_at_the_fork_both_routes_are_modes_within_5_cm(fork):
    later = fork.grid[1:]
    mean, variance, modes = fork.predict_modes([0.0], [[0.0, 0.0]], later)
    np.testing.assert_allclose(modes.probability, [0.5, 0.5], atol=0.01)
    for side, path in zip((1.0, -1.0), modes.mean, strict=True):
        truth = np.stack([0.5 * later, side * np.sin(np.pi * 0.5 * later / 5) ** 2], -1)
        assert np.linalg.norm(path - truth, axis=1).max() < 0.05
    middle = np.abs(later - 5.0).argmin()
    # Both routes pass 1 m beside the middle, so the variance between them is about 1 m^2.
    assert variance[middle, 1] == pytest.approx(1.0, abs=0.2)
    assert abs(mean[middle, 1]) < 0.6


def test_scores_choose_the_aim_but_exclude_no_route(fork):
    modes = fork.predict_modes([0.0], [[0.0, 0.0]], fork.grid[1:])[2]
    assert modes.aim == 0
    assert modes.probability.min() > 0.4
    lower = fork.predict_modes([5.0], [[2.5, -0.9]], fork.grid[60:])[2]
    assert lower.aim == 1
    assert lower.probability[1] > 0.99


def test_total_variance_is_that_within_and_between_modes(fork):
    mean, variance, modes = fork.predict_modes([2.0], [[1.0, 0.05]], fork.grid[30:])
    leaning = modes.probability * fork.leanings
    np.testing.assert_allclose(mean, np.tensordot(leaning / leaning.sum(), modes.mean, 1), atol=1e-9)
    total = np.tensordot(modes.probability, modes.variance + (modes.mean - mean) ** 2, 1)
    np.testing.assert_allclose(variance, total, rtol=1e-9)


@pytest.mark.parametrize("bad", [([0.0], [[np.nan, 0.0]]), ([np.nan], [[0.0, 0.0]])])
def test_nan_observations_give_nan_predictions(fork, bad):
    for values in fork.predict(*bad, fork.grid[1:]):
        assert values.shape == (100, 2)
        assert np.isnan(values).all()


def test_file_round_trip(fork, tmp_path):
    save_learner(fork, tmp_path / "m")
    again = load_learner(tmp_path / "m")
    assert again.name == "mixture"
    for old, new in zip(
        fork.predict([3.0], [[1.5, 0.6]], fork.grid[31:]),
        again.predict([3.0], [[1.5, 0.6]], fork.grid[31:]),
        strict=True,
    ):
        np.testing.assert_array_equal(old, new)


def test_scaled_widens_within_modes(fork):
    wide = fork.scaled(2.0)
    at = ([5.0], [[2.5, 1.0]], fork.grid[60:])
    np.testing.assert_allclose(wide.predict(*at)[1], 4.0 * fork.predict(*at)[1], rtol=1e-4)


@pytest.mark.parametrize("experts", [[], None, [1, 2], {}])
def test_a_file_without_experts_is_refused(fork, experts):
    tensors, description = fork.to_file()
    with pytest.raises(InputError) as caught:
        type(fork).from_file("file", tensors, {**description, "experts": experts})
    assert caught.value.field == "experts"


@pytest.mark.parametrize(
    ("name", "factor", "field"),
    [
        ("expert.1.grid", 2.0, "experts"),
        ("shares", -1.0, "shares, leanings"),
        ("leanings", 0.0, "shares, leanings"),
    ],
)
def test_a_file_whose_experts_do_not_fit_is_refused(fork, name, factor, field):
    tensors, description = fork.to_file()
    with pytest.raises(InputError) as caught:
        type(fork).from_file("file", {**tensors, name: factor * tensors[name]}, description)
    assert caught.value.field == field
