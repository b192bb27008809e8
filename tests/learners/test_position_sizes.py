"""Every learner works for positions of any size."""

import dataclasses

import numpy as np
import pytest

from drake_shared.demonstrations import (
    Demonstration,
    Demonstrations,
    read_demonstrations,
    write_demonstrations,
)
from drake_shared.learners import MultimodalLearner, check_learner, load_learner, save_learner, train

T = np.linspace(0.0, 4.0, 41)


def arcs(size: int) -> Demonstrations:
    """Two routes along the first axis that bow to either side along the last."""
    items = []
    for side in (1.0, -1.0):
        positions = np.full((41, size), 0.3)
        positions[:, 0] = T
        positions[:, -1] += side * np.sin(np.pi * T / 4.0)
        items.append(Demonstration(times=T, positions=positions, score=0.2 + 0.01 * side))
    return Demonstrations(items=tuple(items))


@pytest.mark.parametrize(
    ("name", "size", "options"),
    [
        ("cnmp", 3, {"iterations": 250}),
        ("cnmp", 3, {"iterations": 40, "preset": "paper"}),
        ("cnmp", 3, {"iterations": 40, "members": 2}),
        ("mixture", 3, {"iterations": 150}),
        ("cesn", 3, {}),
        ("promp", 3, {}),
        ("cnmp", 1, {"iterations": 40}),
        ("mixture", 4, {"iterations": 40}),
        ("cesn", 4, {}),
    ],
)
def test_learners_train_predict_and_are_stored(name, options, size, tmp_path):
    if name == "promp":
        pytest.importorskip("movement_primitives")
    demonstrations = arcs(size)
    learner = train(demonstrations, learner=name, **options)
    check_learner(learner)
    path = demonstrations[0].positions
    at = (T[[20]], path[[20]], learner.grid)
    mean, variance = learner.predict(*at)
    assert mean.shape == variance.shape == (41, size)
    if options.get("iterations", 1000) > 100 and size > 1:
        np.testing.assert_allclose(mean[10:31], path[10:31], atol=0.15)
    if isinstance(learner, MultimodalLearner):
        assert learner.predict_modes(*at)[2].mean.shape == (2, 41, size)
    save_learner(learner, tmp_path / "learner")
    np.testing.assert_array_equal(load_learner(tmp_path / "learner").predict(*at), (mean, variance))


def test_named_coordinates_are_trained_from_a_file(tmp_path):
    names = ("lift", "reach", "swing")
    items = tuple(dataclasses.replace(item, position_names=names) for item in arcs(3))
    write_demonstrations(tmp_path / "arm.parquet", Demonstrations(items=items))
    read = read_demonstrations(tmp_path / "arm.parquet")
    assert read.position_names == names
    learner = train(read, learner="cesn")
    assert learner.demonstrations.shape == (2, 41, 3)
