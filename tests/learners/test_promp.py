"""ProMP as a baseline learner; left out where its package is not installed."""

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners import load_learner, promp, save_learner, train

T = np.linspace(0.0, 10.0, 101)


@pytest.fixture(scope="module")
def fan():
    """A ProMP of twenty paths that leave (0, 0) in different directions."""
    pytest.importorskip("movement_primitives")
    items = [
        Demonstration(times=T, positions=np.stack([0.3 * T, slope * 0.3 * T], -1))
        for slope in np.linspace(-0.5, 0.5, 20)
    ]
    return train(Demonstrations(items=tuple(items)), learner="promp")


def test_one_observation_determines_the_direction(fan):
    mean, variance = fan.predict([5.0], [[1.5, 0.6]], fan.grid[60:])
    np.testing.assert_allclose(mean[-1], [3.0, 1.2], atol=0.1)
    _, before = fan.predict([], np.zeros((0, 2)), fan.grid[60:])
    assert (variance[:, 1] < 0.1 * before[:, 1]).all()


def test_without_observations_the_prediction_is_the_mean_and_the_spread_of_the_demonstrations(fan):
    mean, variance = fan.predict([], np.zeros((0, 2)), [4.0, 10.0])
    np.testing.assert_allclose(mean, [[1.2, 0.0], [3.0, 0.0]], atol=0.01)
    spread = np.linspace(-0.5, 0.5, 20).std() * np.array([1.2, 3.0])
    np.testing.assert_allclose(variance[:, 1], spread**2 + fan.floor**2, rtol=0.02)
    np.testing.assert_allclose(variance[:, 0], fan.floor**2, rtol=0.02)
    wide = fan.scaled(2.0)
    np.testing.assert_allclose(wide.predict([], np.zeros((0, 2)), [4.0, 10.0]), (mean, 4.0 * variance))
    # Conditioning stays as it is.
    at = ([5.0], [[1.5, 0.2]], [6.0])
    np.testing.assert_allclose(wide.predict(*at)[0], fan.predict(*at)[0])
    assert (wide.confidence_gain, fan.scaled(2.0, confidence_gain=7.0).confidence_gain) == (
        fan.confidence_gain,
        7.0,
    )


def test_an_observed_position_is_known_up_to_its_noise(fan):
    mean, variance = fan.predict([5.0], [[1.5, 0.6]], [5.0])
    np.testing.assert_allclose(mean, [[1.5, 0.6]], atol=2.0 * fan.noise)
    assert variance[0, 1] - fan.floor**2 == pytest.approx(fan.noise**2, rel=0.3)


def test_intervals_cover_new_paths_at_their_level(fan):
    rng = np.random.default_rng(0)
    sizes = []
    for slope, time in rng.uniform([-0.5, 3.0], [0.5, 9.0], (60, 2)):
        shown = 0.3 * time * np.array([[1.0, slope]]) + fan.noise * rng.standard_normal((1, 2))
        mean, variance = fan.predict([time], shown, T[30:])
        sizes.append((slope * 0.3 * T[30:] - mean[:, 1]) / np.sqrt(variance[:, 1]))
    assert 0.85 < np.mean(np.abs(sizes) < 1.645) < 0.97


def test_k_is_bounded_by_the_noise_of_observations(fan):
    assert fan.confidence_gain == pytest.approx(1.0 / fan.noise**2)


def test_round_trip_gives_the_same_bits(fan, tmp_path):
    save_learner(fan, tmp_path / "p")
    again = load_learner(tmp_path / "p")
    at = ([5.0], [[1.5, 0.2]], fan.grid[60:])
    np.testing.assert_array_equal(fan.predict(*at), again.predict(*at))
    assert again.confidence_gain == fan.confidence_gain


@pytest.mark.parametrize("bad", [([5.0], [[np.nan, 0.0]]), ([np.nan], [[1.0, 0.0]])])
def test_nan_observations_give_nan_predictions(fan, bad):
    for values in fan.predict(*bad, fan.grid[60:]):
        assert values.shape == (41, 2)
        assert np.isnan(values).all()


@pytest.mark.parametrize(("time", "end"), [(-3.0, 0.0), (14.0, 10.0)])
def test_times_outside_the_grid_count_as_its_ends(fan, time, end):
    shown = [[0.3 * end, 0.0]]
    np.testing.assert_array_equal(fan.predict([time], shown, [4.0]), fan.predict([end], shown, [4.0]))


def test_a_missing_package_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "movement_primitives.promp", None)
    with pytest.raises(InputError, match=r"\[baselines\]"):
        promp.make_promp(2)
