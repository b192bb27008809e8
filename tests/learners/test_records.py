"""A shipped learner is what its training record says: training it again begins with the same losses."""

import numpy as np
import pytest

from drake_shared.common.files import models_directory
from drake_shared.demonstrations import Demonstrations, read_demonstrations
from drake_shared.learners import PRESETS, calibrate, load_learner, train

TASKS = ("two_obstacles", "three_obstacles", "doorway", "table_three_cups")


def demonstrations_of(task: str) -> Demonstrations:
    return read_demonstrations(models_directory() / "demonstrations" / f"{task}.parquet")


class EnoughError(Exception):
    """Ends a training."""


def first_losses(demonstrations: Demonstrations, iterations: int, **options) -> dict[int, float]:
    """The running mean losses of the first iterations, by iteration."""
    seen = {}

    def progress(done: int, planned: int, loss: float) -> None:
        seen[done] = loss
        if done > iterations:
            raise EnoughError

    with pytest.raises(EnoughError):
        train(demonstrations, progress=progress, **options)
    return seen


@pytest.mark.parametrize(
    ("name", "iterations", "options"),
    [
        ("two_obstacles_default", 60, {}),
        ("two_obstacles_paper", 0, {"preset": "paper"}),
        ("table_three_cups_mixture", 30, {"learner": "mixture"}),
        ("table_three_cups_paper", 0, {"preset": "paper"}),
    ],
)
def test_training_again_gives_the_recorded_losses(name, iterations, options):
    task = name.rpartition("_")[0]
    record = load_learner(name).metadata["training"]
    parts = [dict(part["loss"]) for part in record.get("ways", [record])]
    found = first_losses(demonstrations_of(task), iterations, **options)
    # Of the experts of a mixture the mean. Other processors round otherwise, which training magnifies.
    expected = [np.mean([losses[done] for losses in parts]) for done in found]
    np.testing.assert_allclose(list(found.values()), expected, atol=2e-3)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("preset", ["default", "paper"])
def test_shipped_learners_were_trained_by_the_presets_as_they_are(task, preset):
    recorded = load_learner(f"{task}_{preset}").metadata["training"]["parameters"]
    parameters = PRESETS[preset].to_json()
    assert recorded == {name: parameters[name] for name in recorded}


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("preset", ["default", "paper"])
def test_shipped_gains_are_those_of_their_demonstrations(task, preset):
    learner, parameters = load_learner(f"{task}_{preset}"), PRESETS[preset]
    negligible = max(0.5 * parameters.noise * learner.scale, learner.sigma_floor)
    gain = calibrate(learner, demonstrations_of(task), resolution=negligible)
    assert learner.confidence_gain == pytest.approx(gain, rel=1e-4)
