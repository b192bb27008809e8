"""The echo state network: its reservoir, its contexts, its intervals and its file."""

import json

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import save_file

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners import Learner, confidence, load_learner, mean_variance, save_learner, train
from drake_shared.learners.cesn.context import encode, within
from drake_shared.learners.cesn.reservoir import STEPS, echo_states


@pytest.fixture(scope="module")
def ways(two_ways):
    """Trained on one route to each side."""
    return train(two_ways, learner="cesn")


@pytest.fixture(scope="module")
def fan(make_bows):
    """Trained on twelve paths that bow to one side or the other, and 24 others of that kind."""
    rng = np.random.default_rng(5)
    heights = [side * (0.8 + 0.15 * rng.standard_normal()) for side in (-1.0, 1.0) for _ in range(18)]
    known = heights[:6] + heights[18:24]
    return train(make_bows(known), learner="cesn"), make_bows(heights[6:18] + heights[24:])


def transformed(demonstrations: Demonstrations, matrix) -> Demonstrations:
    items = tuple(
        Demonstration(times=item.times, positions=item.positions @ np.transpose(matrix))
        for item in demonstrations
    )
    return Demonstrations(items=items)


def test_it_is_a_learner_with_metadata(ways, two_ways):
    assert isinstance(ways, Learner)
    assert (ways.name, ways.preset) == ("cesn", "default")
    assert (ways.metadata["clock"], ways.metadata["evidence"]) == ("progress", "pose+command")
    assert ways.metadata["scenario"] == "bows"
    assert ways.metadata["training"]["demonstrations"] == 2
    paper = train(two_ways, learner="cesn", preset="paper")
    assert (paper.preset, paper.metadata["clock"], paper.metadata["evidence"]) == ("paper", "time", "pose")


@pytest.mark.parametrize(
    ("times", "positions", "expected"),
    [
        (
            [1.0],
            [[1.0, 0.5]],
            [[1.50117, 0.88555], [3.50090, 0.36741], [1.5971e-3, 2.9424e-3], [7.0040e-4, 1.1160e-3]],
        ),
        (
            [2.0, 3.0],
            [[2.1, -0.6], [3.0, -0.5]],
            [[1.50029, -0.89997], [3.49883, -0.37189], [1.7271e-3, 3.2986e-3], [9.8569e-4, 1.2726e-3]],
        ),
    ],
)
def test_a_seed_gives_the_predictions_of_version_0_2(ways, times, positions, expected):
    mean, variance = ways.predict(times, positions, [1.5, 3.5])
    np.testing.assert_allclose(mean, expected[:2], atol=3e-4)
    np.testing.assert_allclose(variance, expected[2:], rtol=5e-3)
    assert ways.confidence_gain == pytest.approx(224.97, rel=2e-3)


def test_a_seed_gives_the_predictions_of_version_0_2_for_many_demonstrations(fan):
    learner, _ = fan
    mean, variance = learner.predict([1.0], [[1.0, 0.5]], [1.5, 3.5])
    np.testing.assert_allclose(mean, [[1.50037, 0.67175], [3.49996, 0.27842]], atol=3e-4)
    np.testing.assert_allclose(variance, [[1.7286e-4, 3.2227e-3], [8.4977e-5, 6.1844e-4]], rtol=5e-3)
    assert learner.confidence_gain == pytest.approx(376.35, rel=2e-3)


def test_echo_states_are_orthonormal_and_represent_smooth_paths():
    states = echo_states(3)
    np.testing.assert_allclose(states.T @ states, np.eye(states.shape[1]), atol=1e-9)
    phase = np.linspace(0.0, 1.0, STEPS + 1)
    for way in (phase, np.sin(np.pi * phase), np.cos(3.0 * np.pi * phase)):
        np.testing.assert_allclose(states @ (states.T @ way), way, atol=0.02)


def test_a_code_is_the_posterior_of_the_modes():
    # One mode of standard deviation 2 in x, seen twice at 3 with a noise of 1: 3 * 8 / (1 + 8), 1 - 1 / 9.
    modes = np.array([[[2.0], [0.0]]] * 2 + [[[0.0], [0.0]]])
    positions = np.array([[3.0, 9.0], [3.0, -9.0], [7.0, 7.0]])
    np.testing.assert_allclose(encode(modes, positions, 1.0), 2.0 * np.array([12.0 / 9.0, 8.0 / 9.0]))


def test_positions_beyond_the_reach_are_moved_in_to_it():
    drawn = within(np.array([[3.0, 4.0], [0.3, 0.4], [0.0, 0.0]]), 1.0)
    np.testing.assert_allclose(drawn, [[0.6, 0.8], [0.3, 0.4], [0.0, 0.0]])


def test_the_mean_passes_the_observation_and_follows_its_route(ways, two_ways):
    for demonstration in ways.demonstrations:
        for step in (8, 20, 30):
            mean, _ = ways.predict([ways.grid[step]], demonstration[step : step + 1], ways.grid)
            np.testing.assert_allclose(mean[step], demonstration[step], atol=0.03)
            np.testing.assert_allclose(mean, demonstration, atol=0.08)


def test_paths_between_the_demonstrations_are_met_where_observed(fan):
    learner, others = fan
    for item in others:
        mean, variance = learner.predict([2.0], item.positions[20:21], learner.grid)
        np.testing.assert_allclose(mean[20], item.positions[20], atol=0.12)
        _, before = learner.predict([], np.empty((0, 2)), learner.grid)
        assert variance[20, 1] < 0.05 * before[20, 1]


def test_intervals_cover_new_paths_at_their_level(fan):
    learner, others = fan
    rng = np.random.default_rng(1)
    noise = learner.noise * learner.scale
    sizes = []
    for item in others:
        for count in (1, 1, 2, 5):
            steps = rng.integers(41, size=count)
            shown = item.positions[steps] + noise * rng.standard_normal((count, 2))
            mean, variance = learner.predict(item.times[steps], shown, item.times)
            sizes.append(np.abs(item.positions - mean)[:, 1] / np.sqrt(variance[:, 1]))
    assert 0.85 < np.mean(np.array(sizes) < 1.645) < 0.98


def test_confidence_is_low_until_a_route_is_observed(ways):
    at_start, beside = (
        mean_variance(ways.grid, ways.predict([t], [p], ways.grid)[1], t)
        for t, p in ((0.0, (0.0, 0.0)), (2.0, (2.0, 1.0)))
    )
    assert confidence(at_start, ways.confidence_gain) < 0.1
    assert confidence(beside, ways.confidence_gain) > 0.9


def test_variance_grows_with_the_distance_from_all_demonstrations(ways):
    spreads = []
    for away in (0.0, 1.0, 5.0, 100.0):
        _, variance = ways.predict([2.0], [[2.0, 1.0 + away]], ways.grid)
        spreads.append(mean_variance(ways.grid, variance, 2.0))
    assert all(np.diff(spreads) > 0.0)
    assert confidence(spreads[0], ways.confidence_gain) > 0.9
    assert all(confidence(spread, ways.confidence_gain) < 0.05 for spread in spreads[1:])


def test_at_some_distance_from_all_demonstrations_the_confidence_is_one_twentieth(ways):
    # 4.5 times the noise of observations.
    far = 4.5 * ways.noise * ways.scale
    _, variance = ways.predict([2.0], [[2.0, 1.0 + far]], ways.grid)
    assert variance.min() == pytest.approx(1.0 / (0.05 * ways.confidence_gain), rel=0.1)


def test_without_observations_it_predicts_the_moments_of_the_demonstrations(ways):
    mean, variance = ways.predict([], np.empty((0, 2)), ways.grid)
    np.testing.assert_allclose(mean, ways.demonstrations.mean(axis=0), atol=1e-12)
    floor = (ways.sigma_floor * ways.scale) ** 2
    np.testing.assert_allclose(variance, ways.demonstrations.var(axis=0) + floor, atol=1e-12)
    np.testing.assert_allclose(ways.predict([], np.empty((0, 2)), [2.0])[0], mean[20:21])


def test_predictions_do_not_depend_on_how_queries_are_grouped(ways):
    shown = ([1.0], [[1.0, 0.7]])
    whole = ways.predict(*shown, ways.grid)
    for queries, rows in ((ways.grid[12:], slice(12, None)), (ways.grid[5:9], slice(5, 9))):
        for part, values in zip(ways.predict(*shown, queries), whole, strict=True):
            np.testing.assert_allclose(part, values[rows], atol=1e-6, rtol=1e-4)
            assert part.dtype == np.float64
            assert part.flags.c_contiguous
    assert ways.predict(*shown, [])[0].shape == (0, 2)
    outside, ends = (ways.predict(*shown, q) for q in ([-3.0, 4.1, 1e6], [0.0, 4.0, 4.0]))
    np.testing.assert_allclose(outside, ends, atol=1e-9)
    early, start = (ways.predict([t], [[0.0, 0.0]], ways.grid) for t in (-2.0, 0.0))
    np.testing.assert_array_equal(early, start)


def test_order_of_observations_does_not_matter(ways):
    times, positions = np.array([0.5, 1.0, 3.0]), np.array([[0.5, 0.4], [1.0, 0.7], [3.0, 0.7]])
    one = ways.predict(times, positions, ways.grid)
    other = ways.predict(times[::-1], positions[::-1], ways.grid)
    np.testing.assert_allclose(one, other, atol=1e-5)


@pytest.mark.parametrize("bad", [([np.nan], [[1.0, 0.7]]), ([1.0, 2.0], [[1.0, 0.7], [np.nan, 0.7]])])
def test_nan_observations_give_nan_predictions(ways, bad):
    for values in ways.predict(*bad, ways.grid[3:]):
        assert values.shape == (38, 2)
        assert np.isnan(values).all()


def test_shapes_that_do_not_fit_are_refused(ways):
    with pytest.raises(ValueError, match="shapes"):
        ways.predict(np.zeros(2), np.zeros((1, 2)), ways.grid)


def test_the_same_seed_gives_the_same_bits(ways, two_ways):
    shown = ([1.0], [[1.0, 0.3]], ways.grid)
    again, other = (train(two_ways, learner="cesn", seed=seed) for seed in (0, 1))
    np.testing.assert_array_equal(again.predict(*shown), ways.predict(*shown))
    assert not np.array_equal(other.predict(*shown)[0], ways.predict(*shown)[0])
    with pytest.raises(InputError, match="seed"):
        train(two_ways, learner="cesn", seed=-1)


def test_the_size_of_the_task_does_not_matter(ways, make_bows):
    large = train(make_bows([1.0, -1.0], scale=50.0), learner="cesn")
    mean, variance = ways.predict([1.0], [[1.0, 0.4]], ways.grid)
    large_mean, large_variance = large.predict([1.0], [[50.0, 20.0]], large.grid)
    np.testing.assert_allclose(large_mean, 50.0 * mean, atol=0.08)
    np.testing.assert_allclose(large_variance, 2500.0 * variance, rtol=0.02)
    assert large.confidence_gain == pytest.approx(ways.confidence_gain / 2500.0, rel=0.02)


def test_mirroring_and_turning_the_task_hardly_matter(ways, two_ways):
    shown = np.array([[1.0, 0.7]])
    mean, _ = ways.predict([1.0], shown, ways.grid)
    matrix = [[0.6, 0.8], [0.8, -0.6]]
    other = train(transformed(two_ways, matrix), learner="cesn")
    turned, _ = other.predict([1.0], shown @ np.transpose(matrix), other.grid)
    np.testing.assert_allclose(turned, mean @ np.transpose(matrix), atol=0.06)


def test_scores_weight_the_mean_and_not_the_spread(make_bows):
    demonstrations = make_bows([1.0, -1.0], scores=[3.0, 0.0])
    leant, even = (train(demonstrations, learner="cesn", weighted=weighted) for weighted in (True, False))
    shown = ([0.0], [[0.0, 0.0]], leant.grid)
    assert leant.predict(*shown)[0][20, 1] > even.predict(*shown)[0][20, 1] + 0.2
    np.testing.assert_allclose(even.predict(*shown)[0][20, 1], 0.0, atol=0.1)
    # About a mean that is near one route, the spread of both is larger, not smaller.
    assert leant.predict(*shown)[1][20, 1] > 0.9 * even.predict(*shown)[1][20, 1]


def test_one_demonstration_gives_confidence_on_it_alone(make_bows):
    learner = train(make_bows([1.0]), learner="cesn")
    mean, variance = learner.predict([2.0], [[2.0, 1.0]], learner.grid)
    np.testing.assert_allclose(mean, learner.demonstrations[0], atol=0.02)
    assert confidence(mean_variance(learner.grid, variance, 2.0), learner.confidence_gain) == 1.0
    _, astray = learner.predict([2.0], [[2.0, 0.0]], learner.grid)
    assert confidence(mean_variance(learner.grid, astray, 2.0), learner.confidence_gain) < 0.05


def test_scaled_multiplies_every_standard_deviation(ways):
    for shown in (([1.0], [[1.0, 0.7]]), ([], np.empty((0, 2)))):
        mean, variance = ways.predict(*shown, ways.grid)
        scaled_mean, scaled_variance = ways.scaled(2.0).predict(*shown, ways.grid)
        np.testing.assert_array_equal(scaled_mean, mean)
        np.testing.assert_allclose(scaled_variance, 4.0 * variance, rtol=1e-6)


def test_a_learner_read_back_predicts_the_same_bits_and_writes_the_same_file(ways, tmp_path):
    save_learner(ways, tmp_path / "one")
    read = load_learner(tmp_path / "one")
    for count in (0, 1, 3):
        shown = (ways.grid[5 : 5 + count], ways.demonstrations[1, 5 : 5 + count], ways.grid)
        np.testing.assert_array_equal(read.predict(*shown), ways.predict(*shown))
    assert (read.name, read.preset, read.confidence_gain) == ("cesn", "default", ways.confidence_gain)
    assert read.metadata["training"] == ways.metadata["training"]
    save_learner(read, tmp_path / "two")
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("readout", lambda w: w[:-1].copy()),
        ("readout", lambda w: np.full_like(w, np.nan)),
        ("hidden_weights", lambda w: w[:1].copy()),
        ("modes", lambda w: None),
        ("grid", lambda w: w[::-1].copy()),
        ("grid", lambda w: w**2),
        ("demonstrations", lambda w: w[:0].copy()),
        ("noise", 0.0),
        ("reach", float("nan")),
        ("scale", None),
    ],
)
def test_an_invalid_file_is_refused_in_a_line_that_names_the_field(ways, tmp_path, name, spoil):
    save_learner(ways, tmp_path / "good")
    with safe_open(tmp_path / "good", framework="numpy") as file:
        tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
        description = json.loads(file.metadata()["drake_shared"])
    if name in tensors:
        spoilt = spoil(tensors.pop(name))
        tensors |= {} if spoilt is None else {name: np.ascontiguousarray(spoilt)}
    else:
        description[name] = spoil
    save_file(tensors, tmp_path / "bad", metadata={"drake_shared": json.dumps(description)})
    with pytest.raises(InputError) as error:
        load_learner(tmp_path / "bad")
    assert (error.value.source, error.value.field) == (str(tmp_path / "bad"), name)
    assert "\n" not in str(error.value)
