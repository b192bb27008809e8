"""Learners evaluated on the way through their training."""

import dataclasses

import numpy as np
import pytest

from drake_shared.experiments import training_curve
from drake_shared.experiments.training import PRESETS
from drake_shared.learners import load_learner


@pytest.fixture(scope="module")
def results(short_training, run_plan, tiny):
    with short_training(40) as patch:
        patch.setattr(training_curve, "SHARES", (0.0, 0.5, 1.0))
        yield run_plan(training_curve, tiny, only="paper")


def made_up(learners=6):
    """Rows in which conditions are met at the second of three checkpoints only, and w always shows it."""
    rng = np.random.default_rng(0)
    return [
        {
            "preset": preset,
            "learner": learner,
            "iterations": iterations,
            "loss": loss + 0.1 * learner,
            "missed": (0.05 if iterations == 10 else 0.5) + 0.01 * rng.random(),
            "follow": 0.5,
            "toward_best": 0.1,
            "weight_where_ambiguous": 0.8 + 0.01 * rng.random(),
            "weight_where_clear": 0.1,
            "steady": 1.0,
            "noisy": 0.75 + 0.01 * rng.random(),
            "noisy_alone": 0.75 + 0.01 * rng.random(),
        }
        for preset in PRESETS
        for learner in range(learners)
        for iterations, loss in ((1, 2.0), (10, -3.0), (20, -6.0))
    ]


def test_every_learner_is_evaluated_at_every_checkpoint(results):
    rows = [row for result in results for row in result]
    assert len(rows) == 2 * 2 * 3
    for preset in PRESETS:
        for learner in (0, 1):
            own = [row for row in rows if (row["preset"], row["learner"]) == (preset, learner)]
            assert [row["iterations"] for row in own] == [1, 20, 40]
            assert own[0]["loss"] > own[-1]["loss"]
            assert len({row["noisy_alone"] for row in own}) == 1


def test_training_goes_on_below_the_threshold():
    parameters = training_curve.parameters_of("paper")
    assert parameters.loss_threshold is None
    assert parameters.iterations >= 40


def test_errors_of_a_trained_learner_are_those_of_its_predictions():
    found = training_curve.prediction_errors(load_learner("two_obstacles_paper"))
    assert found["missed"] < 0.06
    assert found["follow"] < 0.03
    learner = load_learner("two_obstacles_paper")
    shifted = dataclasses.replace(learner, demonstrations=np.add(learner.demonstrations, [0.0, 1.0]))
    assert training_curve.prediction_errors(shifted)["missed"] > 0.3


def test_the_report_says_in_which_range_of_the_loss_a_figure_holds(results, tiny):
    section = training_curve.report(None, tiny, [made_up()])
    text = " ".join(section.text)
    assert "point shown) holds at a loss of −2.75" in text
    assert "clear) holds from a loss of 2.25 to −5.75" in text
    assert "below 0.1 m) holds at no checkpoint" in text
    assert "than alone) holds at no checkpoint" in text
    assert len(training_curve.report(None, tiny, results).tables) == 3
