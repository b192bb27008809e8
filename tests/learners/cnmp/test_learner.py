"""The predictor in numpy equals the torch network for any observations and queries."""

import numpy as np
import pytest
import torch

from drake_shared.learners import confidence, mean_variance
from drake_shared.learners.cnmp.layers import aggregate, softplus, time_features
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.network import aggregate as torch_aggregate
from drake_shared.learners.cnmp.optimization import Optimization
from drake_shared.learners.cnmp.parameters import PRESETS
from drake_shared.learners.dataset import make_dataset


def torch_prediction(run: Optimization, learner: CnmpLearner, times, positions, queries):
    """The prediction of the torch network, in metres."""
    model = learner

    def interpolated(when):
        return np.stack([np.interp(when, model.grid, model.reference[:, axis]) for axis in (0, 1)], axis=-1)

    def features_of(when):
        features = time_features(when, learner.duration, model.harmonics)
        scale = run.parameters.time_scale
        return features if scale is None else scale * (2.0 * features - 1.0)

    features = features_of(times)
    seen = np.concatenate([features, (positions - interpolated(times)) / model.scale], axis=1)
    queries_features = features_of(queries)
    with torch.no_grad():
        mean, spread = run.objective.predict(
            torch.tensor(seen, dtype=torch.float32)[None],
            torch.zeros(len(times), dtype=torch.long),
            torch.tensor(queries_features, dtype=torch.float32),
        )
    mean, spread = mean[0, 0].numpy(), spread[0, 0].numpy()
    return mean * model.scale + interpolated(queries), (spread * model.scale + model.sigma_floor) ** 2


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize("count", [1, 2, 7])
def test_numpy_predicts_what_torch_predicts(two_ways, preset, count):
    run = Optimization([make_dataset(two_ways)], PRESETS[preset], seeds=[3])
    for fraction in np.linspace(0.0, 1.0, 20):
        run.step(1e-3, 0.5, float(fraction))
    learner = run.export(0)
    rng = np.random.default_rng(count)
    steps = rng.integers(0, 41, count)
    times, positions = learner.grid[steps], learner.demonstrations[0, steps]
    others = [rng.uniform(0.0, 4.0, number) for number in (9, 41, 60)]
    for queries in (learner.grid, learner.grid[17:], learner.grid[-1:], *others):
        mean, variance = learner.predict(times, positions, queries)
        expected_mean, expected_variance = torch_prediction(run, learner, times, positions, queries)
        np.testing.assert_allclose(mean, expected_mean, atol=1e-5, rtol=0.0)
        np.testing.assert_allclose(variance, expected_variance, atol=1e-5, rtol=1e-5)


def test_results_are_new_float64_arrays(learner):
    first = learner.predict([1.0], [[1.0, 0.7]], learner.grid)
    kept = [values.copy() for values in first]
    second = learner.predict([1.0], [[1.0, -0.7]], learner.grid)
    for before, after, copy in zip(first, second, kept, strict=True):
        assert before.shape == (41, 2)
        assert before.dtype == np.float64
        assert before.flags.c_contiguous
        assert before.base is None
        assert not np.shares_memory(before, after)
        np.testing.assert_array_equal(before, copy)


def test_predictions_do_not_depend_on_how_queries_are_grouped(learner):
    shown = ([1.0], [[1.0, 0.7]])
    mean, variance = learner.predict(*shown, learner.grid)
    for queries, rows in ((learner.grid[12:], slice(12, None)), (learner.grid[5:9], slice(5, 9))):
        part_mean, part_variance = learner.predict(*shown, queries)
        np.testing.assert_allclose(part_mean, mean[rows], atol=1e-5)
        np.testing.assert_allclose(part_variance, variance[rows], atol=1e-7, rtol=1e-4)
    assert learner.predict(*shown, [])[0].shape == (0, 2)


def test_times_outside_the_grid_count_as_its_ends(learner):
    shown = ([1.0], [[1.0, 0.7]])
    outside = learner.predict(*shown, [-3.0, 4.1, 1e6])
    ends = learner.predict(*shown, [0.0, 4.0, 4.0])
    np.testing.assert_allclose(outside, ends, atol=1e-6)
    early, late = (learner.predict([t], [[0.0, 0.0]], learner.grid) for t in (0.0, -2.0))
    np.testing.assert_allclose(early, late, atol=1e-12)


def test_without_observations_it_predicts_the_moments_of_the_demonstrations(learner, two_ways):
    mean, variance = learner.predict([], np.empty((0, 2)), learner.grid)
    np.testing.assert_allclose(mean[:, 0], learner.grid, atol=1e-9)
    np.testing.assert_allclose(mean[:, 1], 0.0, atol=1e-9)
    floor = learner.sigma_floor**2
    np.testing.assert_allclose(variance[:, 0], floor, rtol=1e-9)
    np.testing.assert_allclose(variance[:, 1], np.sin(np.pi * learner.grid / 4.0) ** 2 + floor, rtol=1e-9)
    np.testing.assert_allclose(learner.predict([], np.empty((0, 2)), [2.0])[0], mean[20:21])


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_prefixes_have_the_bits_of_separate_predictions(learner, paper_learner, preset):
    dut = learner if preset == "default" else paper_learner
    times, positions = np.array([0.5, 1.0, 3.0]), np.array([[0.5, 0.4], [1.0, 2.7], [3.0, 0.7]])
    for queries in (dut.grid, dut.grid[12:], [0.3, 7.0]):
        answers = dut.predict_prefixes(times, positions, queries)
        for count, answer in enumerate(answers, start=1):
            expected = dut.predict(times[:count], positions[:count], queries)
            np.testing.assert_array_equal(answer, expected)
        assert len(answers) == 3
        assert not np.shares_memory(answers[0][0], answers[1][0])
    assert dut.predict_prefixes([], np.empty((0, 2)), dut.grid) == []


def test_order_of_observations_does_not_matter(learner):
    times, positions = np.array([0.5, 1.0, 3.0]), np.array([[0.5, 0.4], [1.0, 0.7], [3.0, 0.7]])
    one = learner.predict(times, positions, learner.grid)
    other = learner.predict(times[::-1], positions[::-1], learner.grid)
    np.testing.assert_allclose(one, other, atol=1e-5)


@pytest.mark.parametrize("bad", [([np.nan], [[1.0, 0.7]]), ([1.0], [[np.nan, 0.7]])])
def test_nan_observations_give_nan_predictions(learner, bad):
    mean, variance = learner.predict(*bad, learner.grid)
    assert np.isnan(mean).all()
    assert np.isnan(variance).all()


@pytest.mark.parametrize(
    "shapes", [((2,), (1, 2), (3,)), ((1,), (1, 3), (3,)), ((1,), (2,), (3,)), ((1,), (1, 2), (3, 1))]
)
def test_shapes_that_do_not_fit_are_refused(learner, shapes):
    with pytest.raises(ValueError, match="shapes"):
        learner.predict(*(np.zeros(shape) for shape in shapes))


def test_variance_grows_with_the_distance_from_all_demonstrations(learner):
    spreads = []
    for away in (0.0, 1.0, 5.0, 100.0):
        _, variance = learner.predict([2.0], [[2.0, 1.0 + away]], learner.grid)
        spreads.append(mean_variance(learner.grid, variance, 2.0))
    assert all(np.diff(spreads) > 0.0)
    assert confidence(spreads[0], learner.confidence_gain) > 0.9
    assert all(confidence(spread, learner.confidence_gain) < 0.05 for spread in spreads[1:])


def test_scaled_multiplies_every_standard_deviation(learner):
    mean, variance = learner.predict([1.0], [[1.0, 0.7]], learner.grid)
    scaled_mean, scaled_variance = learner.scaled(2.0).predict([1.0], [[1.0, 0.7]], learner.grid)
    np.testing.assert_array_equal(scaled_mean, mean)
    np.testing.assert_allclose(scaled_variance, 4.0 * variance, rtol=1e-5)


def test_codes_are_averaged_or_weighted_by_their_precision():
    codes = np.array([[1.0, -2.0, 0.3, 5.0], [2.0, 4.0, -1.0, 100.0]], np.float32)
    np.testing.assert_allclose(aggregate(codes, "mean"), codes.mean(axis=0))
    said, precision = codes[:, :2], np.log1p(np.exp(codes[:, 2:].astype(float)))
    variance = 1.0 / (1.0 + precision.sum(axis=0))
    expected = np.concatenate([variance * (precision * said).sum(axis=0), variance])
    np.testing.assert_allclose(aggregate(codes, "bayesian"), expected, rtol=1e-5)
    for kind in ("mean", "bayesian"):
        in_torch = torch_aggregate(torch.tensor(codes)[None], torch.tensor([0, 0]), kind)[0, 0]
        np.testing.assert_allclose(aggregate(codes, kind), in_torch, rtol=1e-5)


def test_softplus_equals_that_of_torch_and_does_not_overflow():
    values = np.array([-100.0, -1.0, 0.0, 3.0, 79.0, 500.0], np.float32)
    expected = torch.nn.functional.softplus(torch.tensor(values)).numpy()
    np.testing.assert_allclose(softplus(values), expected, rtol=1e-6)
