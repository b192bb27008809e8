"""Training on toy tasks whose answer is known, and on minimal data."""

import dataclasses
import itertools
from time import perf_counter

import numpy as np
import pytest
import torch

from drake_shared.common.errors import InputError, RunError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners import PRESETS, calibrate, train
from drake_shared.learners.cnmp.training import MAX_TOGETHER, train_together
from drake_shared.learners.loss_threshold import early_stop, loss_threshold

QUICK = 60


def at(learner, time: float, position, query: float) -> tuple[np.ndarray, np.ndarray]:
    mean, variance = learner.predict([time], [position], [query])
    return mean[0], np.sqrt(variance[0])


def test_an_observation_on_one_route_predicts_that_route(learner):
    for side in (1.0, -1.0):
        mean, sigma = at(learner, 1.0, [1.0, side * np.sin(np.pi / 4)], 2.0)
        np.testing.assert_allclose(mean, [2.0, side], atol=0.05)
        assert (sigma < 0.1).all()


def test_where_routes_part_it_predicts_their_mean_and_spread(learner):
    """Two routes at +1 and -1 m: a mean of 0 and a standard deviation of 1."""
    mean, sigma = at(learner, 0.0, [0.0, 0.0], 2.0)
    np.testing.assert_allclose(mean, [2.0, 0.0], atol=0.15)
    assert sigma[1] == pytest.approx(1.0, abs=0.15)


def test_scores_weight_the_mean_while_the_spread_covers_both_routes(make_bows):
    scored = make_bows([1.0, -1.0], scores=[0.0, 0.2])
    learner = train(scored, iterations=400)
    # Width 0.2: weights exp(-0.5) and 1 give a mean of (0.607 - 1) / 1.607.
    expected = (np.exp(-0.5) - 1.0) / (np.exp(-0.5) + 1.0)
    mean, sigma = at(learner, 0.0, [0.0, 0.0], 2.0)
    assert mean[1] == pytest.approx(expected, abs=0.15)
    assert sigma[1] == pytest.approx(np.sqrt(1.0 + expected**2), abs=0.15)
    unweighted = train(scored, iterations=400, weighted=False)
    assert at(unweighted, 0.0, [0.0, 0.0], 2.0)[0][1] == pytest.approx(0.0, abs=0.15)


@pytest.fixture(scope="module")
def conditioned(two_ways):
    """The paper's method, trained to a threshold that needs routes to be told apart; smaller and shorter."""
    parameters = dataclasses.replace(
        PRESETS["paper"], loss_threshold=-5.0, encoder=(64, 64), decoder=(64,), cycle=1_500, iterations=10_500
    )
    return train(two_ways, parameters=parameters)


def test_the_paper_trains_until_the_running_mean_loss_is_below_its_threshold(conditioned):
    record = conditioned.metadata["training"]
    assert record["reached_threshold"]
    assert record["loss_threshold"] == -5.0
    steps, losses = np.array(record["loss"]).T
    assert steps[-1] == record["iterations"] < record["planned"]
    assert losses[-1] <= -5.0 < losses[:-1].min()
    assert losses[0] > 0.0


def test_the_paper_trained_to_its_threshold_passes_through_what_it_is_shown(conditioned):
    """And follows the route that it is on, while without a hint it is unsure."""
    for side in (1.0, -1.0):
        for time in (0.8, 2.0, 3.2):
            point = [time, side * np.sin(np.pi * time / 4.0)]
            mean, _ = at(conditioned, time, point, time)
            np.testing.assert_allclose(mean, point, atol=0.15)
        mean, sigma = at(conditioned, 1.0, [1.0, side * np.sin(np.pi / 4)], 2.0)
        np.testing.assert_allclose(mean, [2.0, side], atol=0.15)
        assert (sigma < 0.2).all()
        assert at(conditioned, 0.0, [0.0, 0.0], 2.0)[1][1] > 3.0 * sigma[1]


def test_training_ends_within_ten_iterations_of_its_threshold_whatever_the_checkpoints(two_ways):
    small = {"encoder": (64, 64), "decoder": (64,), "cycle": None, "iterations": 3_000, "first_floor": 0.0}
    parameters = dataclasses.replace(PRESETS["paper"], loss_threshold=1.52, **small)
    losses = {}

    def trained(checkpoints):
        (learner,) = train_together(
            [two_ways],
            [0],
            parameters=parameters,
            checkpoints=checkpoints,
            on_checkpoint=lambda _, step, loss, __: losses.update({step: loss}),
        )
        return learner

    plain = trained(())
    end = plain.metadata["training"]["iterations"]
    again = trained(range(end - 10, end))
    assert again.metadata["training"]["iterations"] == end
    assert losses[end - 10] > 1.52 >= plain.metadata["training"]["loss"][-1][1]
    query = ([1.0], [[1.0, 0.5]], [2.0, 3.0])
    np.testing.assert_array_equal(again.predict(*query), plain.predict(*query))


def test_at_some_distance_from_all_demonstrations_the_confidence_is_one_twentieth(learner, paper_learner):
    noise = PRESETS["default"].noise * learner.scale
    far = (PRESETS["default"].doubt_from + PRESETS["default"].doubt_within) * noise
    on, beside = ([[2.0, 1.0 + away]] for away in (0.0, far))
    added = [learner.predict([2.0], shown, learner.grid)[1].min() for shown in (on, beside)]
    assert added[1] == pytest.approx(1.0 / (0.05 * learner.confidence_gain), rel=0.1)
    assert added[0] < 0.05 * added[1]
    # By the paper only the network says so.
    assert paper_learner.doubt_gain == 0.0


def test_a_limit_on_iterations_ends_a_training_before_its_threshold(paper_learner, learner):
    record = paper_learner.metadata["training"]
    assert not record["reached_threshold"]
    assert record["iterations"] == record["planned"] == 50
    assert loss_threshold(paper_learner.metadata)["reached"] is False
    assert early_stop(paper_learner.metadata)
    assert learner.metadata["training"]["reached_threshold"] is None
    assert early_stop(learner.metadata) is None


def test_time_that_is_over_ends_a_training_before_its_threshold(two_ways):
    record = train(two_ways, preset="paper", seconds=0.5).metadata["training"]
    assert not record["reached_threshold"]
    assert record["iterations"] < PRESETS["paper"].iterations


def test_a_narrow_density_over_scores_draws_the_best_demonstration_more_often(make_bows):
    scored = make_bows([1.0, -1.0], scores=[0.0, 0.2])
    shares = {
        width: train(scored, preset="paper", iterations=2, score_width=width).weights[1]
        for width in (0.5, 1.0, 2.0)
    }
    # The scores are 0.2 apart, twice their standard deviation.
    for width, share in shares.items():
        assert share == pytest.approx(1.0 / (1.0 + np.exp(-0.5 * (2.0 / width) ** 2)))


def test_k_of_the_paper_makes_the_confidence_one_twentieth_at_the_largest_variance(two_ways):
    found = train(two_ways, preset="paper", iterations=2, calibration="largest")
    assert found.confidence_gain == pytest.approx(calibrate(found, two_ways, calibration="largest"))
    assert found.metadata["training"]["calibration"] == "largest"


@pytest.mark.parametrize(("batch", "queries", "memory"), [(64, 16, 10.0), (4, 8, 2_000 / 32)])
def test_the_running_mean_extends_over_2000_points_or_ten_iterations_and_with_a_threshold_over_100(
    two_ways, batch, queries, memory
):
    def losses(memory: float, threshold: float | None) -> np.ndarray:
        """The loss of each iteration, from the running means."""
        small = {"encoder": (8, 8), "decoder": (8,), "restarts": 0, "iterations": 120, "patience": 0.0}
        parameters = dataclasses.replace(
            PRESETS["default"], batch=batch, queries=queries, loss_threshold=threshold, **small
        )
        seen = []
        train(two_ways, parameters=parameters, progress=lambda *state: seen.append(state[2]))
        changes = np.diff(seen, prepend=0.0)
        return seen - changes + np.minimum(np.arange(1, 121), memory) * changes

    np.testing.assert_allclose(losses(memory, None), losses(100.0, -99.0), atol=1e-9)


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_the_same_seed_gives_the_same_bits(two_ways, preset):
    def trained(seed: int) -> np.ndarray:
        learner = train(two_ways, preset=preset, iterations=QUICK, seed=seed)
        return np.stack(learner.predict([1.0], [[1.0, 0.7]], learner.grid))

    np.testing.assert_array_equal(trained(4), trained(4))
    assert not np.array_equal(trained(4), trained(5))


@pytest.mark.parametrize("scale", [0.02, 50.0])
def test_the_size_of_the_task_does_not_matter(make_bows, scale):
    """Predictions scale with the task, and K with its inverse square."""
    plain = train(make_bows([1.0, -1.0]), iterations=QUICK)
    sized = train(make_bows([1.0, -1.0], scale=scale), iterations=QUICK)
    position = np.array([[1.0, 0.7]])
    mean, variance = plain.predict([1.0], position, plain.grid)
    sized_mean, sized_variance = sized.predict([1.0], scale * position, sized.grid)
    np.testing.assert_allclose(sized_mean, scale * mean, atol=2e-3 * scale)
    np.testing.assert_allclose(sized_variance, scale**2 * variance, rtol=0.02)
    assert sized.confidence_gain == pytest.approx(plain.confidence_gain / scale**2, rel=0.02)


def test_the_record_holds_iterations_seed_data_and_versions(two_ways):
    seen = []
    begun = perf_counter()
    learner = train(two_ways, iterations=QUICK, seed=7, progress=lambda *state: seen.append(state))
    spent = perf_counter() - begun
    record = learner.metadata["training"]
    assert (record["iterations"], record["seed"], record["restarts"]) == (QUICK, 7, 0)
    assert record["parameters"]["iterations"] == QUICK
    assert record["demonstrations"] == 2
    assert 0.0 < record["seconds"] < spent + 1e-3
    assert len(record["data_sha256"]) == 64
    assert set(record["versions"]) >= {"torch", "numpy", "python"}
    assert record["loss"][-1][0] == QUICK
    assert seen[-1][:2] == (QUICK, QUICK)


def test_seconds_determine_iterations_that_reproduce_the_learner(two_ways):
    timed = train(two_ways, seconds=0.8)
    record = timed.metadata["training"]
    assert record["seconds_allowed"] == 0.8
    if record["iterations"] == record["planned"]:
        again = train(two_ways, iterations=record["iterations"])
        shown = ([1.0], [[1.0, 0.7]], timed.grid)
        np.testing.assert_array_equal(timed.predict(*shown), again.predict(*shown))


def test_the_time_that_is_left_determines_the_iterations(two_ways, monkeypatch):
    """By a clock that goes on by 1 ms whenever it is read: one iteration takes as long."""
    clock = itertools.count()
    monkeypatch.setattr("time.perf_counter", lambda: 1e-3 * next(clock))
    parameters = dataclasses.replace(PRESETS["default"], encoder=(8, 8), decoder=(8,), restarts=0)
    record = train(two_ways, parameters=parameters, seconds=0.5).metadata["training"]
    # A twentieth of the time is reserved, and in a twentieth of the rest an iteration is timed.
    assert record["planned"] == pytest.approx(0.95 * 0.95 * 500, abs=8)
    assert record["iterations"] == record["planned"]


def test_training_restarts_if_the_learner_ignores_observations(two_ways):
    # At this rate nothing is learnt, so every attempt but the last is given up.
    inert = dataclasses.replace(PRESETS["default"], learning_rate=1e-9, iterations=20, restarts=2)
    record = train(two_ways, parameters=inert).metadata["training"]
    assert record["restarts"] == 2
    assert record["ignores_observations"]


def test_divergence_raises_a_run_error(two_ways):
    wild = dataclasses.replace(PRESETS["default"], learning_rate=1e30, iterations=50)
    with pytest.raises(RunError, match="diverged"):
        train(two_ways, parameters=wild)


def still(points: int) -> Demonstration:
    return Demonstration(times=np.arange(points) * 0.1, positions=np.full((points, 2), 2.0))


@pytest.mark.parametrize(
    "name",
    ["one", "identical", "two points", "standing still", "100,000 points", "varying step"],
)
@pytest.mark.parametrize("preset", ["default", "paper"])
def test_minimal_data_give_a_valid_learner(make_bows, name, preset):
    (way,) = make_bows([0.5])
    rng = np.random.default_rng(0)
    uneven = np.cumsum(rng.uniform(0.001, 0.3, 60))
    many = np.linspace(0.0, 4.0, 100_000)
    items = {
        "one": (way,),
        "identical": (way, way),
        "two points": (Demonstration(times=[0.0, 2.0], positions=[[0.0, 0.0], [1.0, 1.0]]),),
        "standing still": (still(20), still(20)),
        "100,000 points": (way, Demonstration(times=many, positions=np.stack([many, 0.1 * many], axis=-1))),
        "varying step": (Demonstration(times=uneven, positions=np.stack([uneven, uneven], axis=-1)), way),
    }[name]
    learner = train(Demonstrations(items=items), preset=preset, iterations=QUICK)
    time = float(learner.grid[10])
    mean, variance = learner.predict([time], learner.demonstrations[0, 10:11], learner.grid)
    assert np.isfinite(mean).all()
    assert (variance > 0.0).all()
    assert np.isfinite(learner.confidence_gain)
    assert learner.confidence_gain > 0.0


def test_one_demonstration_gives_full_confidence_on_it_and_none_beside_it(make_bows):
    learner = train(make_bows([0.5]), iterations=200)
    gain = learner.confidence_gain
    # Half the noise of observations is negligible.
    assert gain == pytest.approx(1.0 / (0.5 * PRESETS["default"].noise * learner.scale) ** 2)
    on, beside = (learner.predict([2.0], [[2.0, y]], learner.grid)[1].mean() for y in (0.5, 1.5))
    assert gain * on < 1.0
    assert gain * beside > 20.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"preset": "best"}, "preset must be one of paper, default, got 'best'"),
        ({"seconds": 0.0}, "seconds must be positive"),
        ({"seconds": float("nan")}, "seconds must be positive"),
        ({"iterations": 0}, "iterations must be at least 1"),
        ({"score_width": 0.0}, "width must be positive"),
        ({"calibration": "mean"}, "calibration must be one of percentile, largest"),
        ({"seed": -1}, "seed must be 0 or more"),
        ({"device": "tpu"}, "device must be one of cpu, cuda, auto"),
        ({"duration": -1.0}, "duration must be positive"),
    ],
)
def test_invalid_arguments_are_refused(two_ways, options, message):
    with pytest.raises(InputError, match=message):
        train(two_ways, **options)


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_without_a_gpu_auto_is_the_cpu_and_cuda_is_refused(two_ways):
    plain, automatic = (train(two_ways, iterations=5, device=device) for device in ("cpu", "auto"))
    assert automatic.metadata["training"]["device"] == "cpu"
    query = ([1.0], [[1.0, 0.7]], plain.grid)
    np.testing.assert_array_equal(plain.predict(*query), automatic.predict(*query))
    with pytest.raises(InputError) as caught:
        train(two_ways, device="cuda")
    assert caught.value.field == "device"


def test_learners_of_demonstrations_of_different_durations_are_those_trained_alone(make_bows):
    tasks = [make_bows([1.0, -1.0]), make_bows([0.5, -0.5], duration=3.0), make_bows([0.8, -0.8])]
    parameters = dataclasses.replace(PRESETS["default"], batch=4, encoder=(8, 8), decoder=(8,), restarts=0)
    options = {"parameters": parameters, "iterations": 10}
    together = train_together(tasks, [0, 1, 2], **options)
    for task, seed, learner in zip(tasks, [0, 1, 2], together, strict=True):
        (alone,) = train_together([task], [seed], **options)
        shown = ([1.0], [[1.0, 0.7]], alone.grid)
        np.testing.assert_allclose(learner.predict(*shown), alone.predict(*shown), atol=1e-4)


def test_many_learners_are_trained_in_groups_with_the_results_of_each_alone(make_bows):
    count = MAX_TOGETHER + 1
    tasks = [make_bows([height, -height]) for height in np.linspace(0.5, 1.5, count)]
    parameters = dataclasses.replace(PRESETS["default"], batch=4, encoder=(8, 8), decoder=(8,), restarts=0)
    iterations = 10  # In fewer, whether all ignore what they are shown decides when training ends.
    seen, reported = [], []
    learners = train_together(
        tasks,
        list(range(count)),
        parameters=parameters,
        iterations=iterations,
        progress=lambda done, planned, _: seen.append(done / planned),
        checkpoints=[2],
        on_checkpoint=lambda index, *_: reported.append(index),
    )
    assert sorted(reported) == list(range(count))
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    for index in (0, count - 1):
        alone = train(tasks[index], parameters=parameters, iterations=iterations, seed=index)
        shown = ([1.0], [[1.0, 0.7]], alone.grid)
        np.testing.assert_allclose(learners[index].predict(*shown), alone.predict(*shown), atol=1e-4)


def test_a_score_that_is_nan_is_refused(make_bows):
    with pytest.raises(InputError, match="demonstration 1 must be finite"):
        train(make_bows([1.0, -1.0], scores=[0.0, np.nan]), iterations=1)


def test_some_of_many_demonstrations_are_held_out(make_bows):
    rng = np.random.default_rng(0)
    many = make_bows([*rng.normal(1.0, 0.03, 30), *rng.normal(-1.0, 0.03, 30)])
    learner = train(many, iterations=200)
    assert learner.metadata["training"]["held_out"] == 6
    mean, _ = at(learner, 1.0, [1.0, np.sin(np.pi / 4)], 2.0)
    np.testing.assert_allclose(mean, [2.0, 1.0], atol=0.08)


def test_a_checkpoint_is_the_learner_of_a_training_that_ended_there_and_changes_nothing(make_bows):
    tasks = [make_bows([1.0, -1.0]), make_bows([0.5, -0.5])]
    parameters = dataclasses.replace(PRESETS["paper"], schedule="constant", first_floor=0.0)
    seen = {}

    def keep(index, step, loss, learner):
        seen[index, step] = learner
        assert learner.metadata["training"]["iterations"] == step
        assert np.isfinite(loss)

    seeds = [0, 1]
    final = train_together(
        tasks, seeds, parameters=parameters, iterations=20, checkpoints=(1, 10), on_checkpoint=keep
    )
    assert set(seen) == {(0, 1), (1, 1), (0, 10), (1, 10)}
    plain = train_together(tasks, seeds, parameters=parameters, iterations=20)
    earlier = train_together(tasks, seeds, parameters=parameters, iterations=10)
    query = ([1.0], [[1.0, 0.5]], [2.0, 3.0])
    for index in (0, 1):
        np.testing.assert_array_equal(final[index].predict(*query), plain[index].predict(*query))
        np.testing.assert_array_equal(seen[index, 10].predict(*query), earlier[index].predict(*query))
        assert seen[index, 10].confidence_gain == earlier[index].confidence_gain
