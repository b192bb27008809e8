"""Predictions for many rows of observations at once are those of the learner for each row."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.files import models_directory
from drake_shared.learners import load_learner, train
from drake_shared.learners.ensemble.learner import EnsembleLearner
from drake_shared.learners.mixture.learner import MixtureLearner
from drake_shared.learners.rows import make_rows, predicts_rows


def shipped(name: str):
    return load_learner(models_directory() / "learners" / f"{name}.safetensors")


@pytest.fixture(scope="module")
def learners(two_ways):
    cnmp, other = shipped("two_obstacles_default"), shipped("doorway_default")
    other = dataclasses.replace(other, grid=cnmp.grid, reference=cnmp.reference)
    parts = [
        dataclasses.replace(cnmp, demonstrations=cnmp.demonstrations[:2], weights=np.full(2, 0.5)),
        dataclasses.replace(other, demonstrations=cnmp.demonstrations[2:], weights=np.ones(1)),
    ]
    common = {"confidence_gain": 100.0, "metadata": cnmp.metadata, "preset": "default"}
    return {
        "cnmp": cnmp,
        "paper": shipped("two_obstacles_paper"),
        "ensemble": EnsembleLearner(members=(cnmp, parts[1]), **common),
        "mixture": MixtureLearner(
            experts=tuple(parts),
            shares=np.array([0.7, 0.3]),
            leanings=np.array([0.8, 1.5]),
            noise=0.15,
            **common,
        ),
        "cesn": train(two_ways, learner="cesn"),
    }


@pytest.mark.parametrize("kind", ["cnmp", "paper", "ensemble", "mixture", "cesn"])
def test_each_row_is_what_the_learner_predicts_alone(learners, kind):
    learner = learners[kind]
    assert predicts_rows(learner)
    rng = np.random.default_rng(3)
    times = np.array([-0.1, *np.sort(rng.uniform(0.0, 1.0, 10)), 1.05]) * learner.duration
    last = len(learner.grid) - 1
    first = np.array([2, 2, 9, last // 2, last // 2, last])
    index = rng.integers(len(times), size=(len(first), 2))
    # Times before the start and after the end count as these.
    index[[0, 1, 2], [0, 0, 1]] = 0, 11, 11
    steps = np.clip(np.rint(times[index] / learner.duration * last), 0, last).astype(int)
    positions = learner.demonstrations[rng.integers(2, size=len(first))[:, None], steps]
    positions = positions + rng.normal(0.0, 0.2, positions.shape)
    mean, variance, aimed = make_rows(learner, times).predict(index, positions, first)
    for row, begin in enumerate(first):
        for count in (1, 2):
            shown = times[index[row, :count]], positions[row, :count], learner.grid[begin:]
            own = slice(begin - first[0], None)
            alone = learner.predict(*shown)
            aim = alone[0]
            if kind == "mixture":
                modes = learner.predict_modes(*shown)[2]
                aim = modes.mean[modes.aim]
            for ours, theirs in zip((mean, variance, aimed), (*alone, aim), strict=True):
                np.testing.assert_allclose(ours[row, count - 1, :, own].T, theirs, rtol=1e-5, atol=1e-6)


def test_the_deviation_of_an_echo_state_network_lies_between_its_floor_and_its_reach(learners):
    learner = learners["cesn"]
    shown = np.array([2.0]), learner.demonstrations[0][20:21], learner.grid
    for shift, bound in ((-100.0, learner.sigma_floor), (100.0, learner.reach)):
        extreme = dataclasses.replace(learner, log_variance=learner.log_variance + shift)
        # No further variance: the observation is on a demonstration.
        np.testing.assert_allclose(extreme.predict(*shown)[1], (bound * learner.scale) ** 2, rtol=1e-5)
        _, variance, _ = make_rows(extreme, shown[0]).predict(
            np.array([[0]]), shown[1][None], np.array([0], dtype=np.int64)
        )
        np.testing.assert_allclose(variance, (bound * learner.scale) ** 2, rtol=1e-5)
