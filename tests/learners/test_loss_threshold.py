"""Shipped learners of preset paper were trained to Lt, and use what they are shown."""

import numpy as np
import pytest

from drake_shared.learners import load_learner
from drake_shared.learners.loss_threshold import early_stop, loss_threshold

SHIPPED = ["two_obstacles_paper", "three_obstacles_paper", "doorway_paper", "table_three_cups_paper"]


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_learners_were_trained_to_the_threshold_of_the_paper(name):
    metadata = load_learner(name).metadata
    record = metadata["training"]
    assert record["loss_threshold"] == record["parameters"]["loss_threshold"] == -6.0
    assert record["reached_threshold"]
    assert record["loss"][-1][0] == record["iterations"] < record["planned"]
    assert loss_threshold(metadata) == {"threshold": -6.0, "loss": record["loss"][-1][1], "reached": True}
    assert early_stop(metadata) is None


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_learners_pass_through_what_they_are_shown_and_follow_it(name):
    learner = load_learner(name)
    paths, grid = learner.demonstrations, learner.grid
    moments = np.linspace(0, len(grid) - 1, 9).round().astype(int)[1:-1]
    for index, path in enumerate(paths):
        for step in moments:
            mean, _ = learner.predict(grid[[step]], path[[step]], grid)
            assert np.linalg.norm(mean[step] - path[step]) < 0.3
        # A point that no other demonstration passes.
        others = np.linalg.norm(np.delete(paths, index, axis=0) - path, axis=-1).min(axis=0)
        step = int(others.argmax())
        mean, _ = learner.predict(grid[[step]], path[[step]], grid)
        assert np.sqrt(np.square(mean - path)[step:].sum(axis=1).mean()) < 0.1


@pytest.mark.parametrize("part", ["members", "ways"])
def test_one_part_that_stopped_early_makes_the_learner_one_that_did(part):
    parts = [{"loss": [[1, 3.0], [9, -6.1]]}, {"loss": [[1, 2.0], [9, -1.9]]}]
    metadata = {"training": {"parameters": {"loss_threshold": -6.0}, part: parts}}
    assert loss_threshold(metadata) == {"threshold": -6.0, "loss": -1.9, "reached": False}
    assert "-1.90" in early_stop(metadata)


def test_a_learner_without_a_record_or_a_threshold_did_not_stop_early():
    assert loss_threshold({}) is None
    assert loss_threshold({"training": {"parameters": {"loss_threshold": None}, "loss": [[1, 0.0]]}}) is None
    assert early_stop({}) is None
