"""Accuracy and calibration of predictions, against known values."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import norm

from drake_shared.analysis.confidence_calibration import (
    ConfidenceSteps,
    assess_confidence,
    confidence_calibration,
    demonstrations_of_routes,
    intended_path,
    predictions,
)
from drake_shared.analysis.evaluation import (
    PredictionErrors,
    draw_reliability,
    evaluate,
    prediction_errors,
    sigma_scale,
)
from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners import load_learner
from drake_shared.simulation.teaching import teach
from drake_shared.simulation.trial import Simulation, TrialSettings

T = np.linspace(0.0, 10.0, 101)
PATH = np.stack([0.5 * T, np.zeros_like(T)], -1)


@pytest.fixture
def noisy():
    """Demonstrations along PATH with noise of 0.1 m."""
    rng = np.random.default_rng(0)
    return Demonstrations(
        items=tuple(
            Demonstration(times=T, positions=PATH + 0.1 * rng.standard_normal(PATH.shape)) for _ in range(20)
        )
    )


def test_a_correct_sigma_covers_the_nominal_shares(fake_learner, noisy):
    result = evaluate(prediction_errors(fake_learner(PATH, variance=0.01), noisy))
    assert result["coverage50"] == pytest.approx(0.5, abs=0.01)
    assert result["coverage90"] == pytest.approx(0.9, abs=0.01)
    assert result["coverage95"] == pytest.approx(0.95, abs=0.01)
    assert result["scale"] == pytest.approx(1.0, abs=0.01)
    # For two normal errors: entropy, mean of the Rayleigh distribution, and sigma / sqrt(pi).
    assert result["nll"] == pytest.approx(1 + np.log(2 * np.pi * 0.01), abs=0.02)
    assert result["ade"] == pytest.approx(0.1 * np.sqrt(np.pi / 2), abs=0.002)
    assert result["crps"] == pytest.approx(0.1 / np.sqrt(np.pi), abs=0.001)
    np.testing.assert_allclose(result["reliability"]["covered"], result["reliability"]["level"], atol=0.02)
    # The errors of all points are independent here, so that no path of more than a few points is covered.
    assert result["coverage90_of_points"] == pytest.approx(0.9, abs=0.01)
    assert result["coverage90_of_paths"] < 0.1


def test_a_point_is_covered_by_an_ellipse_and_a_path_if_all_its_points_are():
    # Two cases of two points, at 2.1 standard deviations where the 90% ellipse has a radius of 2.15.
    error = np.array([[2.1, 0.0], [0.0, 2.1], [2.1, 0.0], [2.1, 1.0]])
    found = PredictionErrors(
        error=error, sigma=np.ones_like(error), case=np.array([0, 0, 1, 1]), to_end=np.array([1.0, 1.0])
    )
    result = evaluate(found)
    assert result["coverage90"] == pytest.approx(4 / 8)
    assert result["coverage90_of_points"] == pytest.approx(3 / 4)
    assert result["coverage90_of_paths"] == pytest.approx(1 / 2)


def test_sigma_scale_corrects_a_sigma_that_is_too_small(fake_learner, noisy):
    found = prediction_errors(fake_learner(PATH, variance=0.01 / 4), noisy)
    assert sigma_scale(found) == pytest.approx(2.0, abs=0.02)
    assert evaluate(found)["coverage90"] == pytest.approx(2 * norm.cdf(1.645 / 2) - 1, abs=0.01)


def test_fde_is_the_error_at_the_last_point(fake_learner):
    late = PATH.copy()
    late[-1, 1] = 0.5
    shifted = Demonstrations(items=(Demonstration(times=T, positions=late),))
    result = evaluate(prediction_errors(fake_learner(PATH), shifted))
    assert result["fde"] == pytest.approx(0.5)
    assert result["ade"] < 0.1


def test_errors_are_given_for_fifths_of_the_time_to_the_end(fake_learner, noisy):
    parts = evaluate(prediction_errors(fake_learner(PATH), noisy))["by_time_to_end"]
    assert [round(part["to"], 6) for part in parts] == [2, 4, 6, 8, 10]


def test_negative_noise_is_refused(fake_learner, noisy):
    with pytest.raises(InputError, match="noise"):
        prediction_errors(fake_learner(PATH), noisy, noise=-1)


def test_confidence_equal_to_the_share_correct_has_no_calibration_error():
    confidence = np.repeat([0.25, 0.75], 400)
    correct = np.concatenate([np.arange(400) % 4 == 0, np.arange(400) % 4 != 0])
    judged = confidence_calibration([ConfidenceSteps(confidence=confidence, correct=correct)])
    assert judged["expected_calibration_error"] == pytest.approx(0.0, abs=1e-12)
    assert judged["confident_and_wrong"] == 0.0
    assert [row["steps"] for row in judged["bins"]] == [400, 400]


def test_confident_wrong_steps_are_counted():
    sure = ConfidenceSteps(confidence=np.full(10, 0.9), correct=np.arange(10) < 7)
    judged = confidence_calibration([sure])
    assert judged["confident_and_wrong"] == pytest.approx(0.3)
    assert judged["expected_calibration_error"] == pytest.approx(0.2)
    # 0.1 squared in seven steps, 0.9 squared in three; one confidence for all ranks nothing.
    assert judged["brier_score"] == pytest.approx(0.7 * 0.01 + 0.3 * 0.81)
    assert judged["confidence_ranking"] == pytest.approx(0.5)


def test_an_agent_is_correct_if_it_expects_the_route_of_the_operator(scenario, route_learner, human_trial):
    route = human_trial.metadata["route"]
    index = [item.name for item in scenario.routes].index(route)
    same, other = (route_learner(scenario, scenario.routes[(index + one) % 3].name) for one in (0, 1))
    meant = intended_path(scenario, same, route)
    np.testing.assert_array_equal(meant, same.demonstrations[0])
    assert assess_confidence(same, human_trial, meant).correct.mean() > 0.95
    assert assess_confidence(other, human_trial, meant).correct.mean() < 0.6
    # A learner that was not shown the route is judged by the curve of the route, and is as wrong.
    untaught = intended_path(scenario, other, route)
    assert len(untaught) != len(meant)
    assert assess_confidence(other, human_trial, untaught).correct.mean() < 0.6


def test_the_judged_prediction_is_the_one_whose_confidence_was_logged(scenario):
    # It takes the command of the human as evidence, which changes it.
    learner = load_learner("two_obstacles")
    assert learner.metadata["evidence"] == "pose+command"
    trial = Simulation(scenario, learner=learner).run(TrialSettings(route=scenario.routes[1].name, seed=3))
    found = [confidence for _, confidence in predictions(learner, trial)]
    np.testing.assert_allclose(found, trial["confidence"][:-1], atol=1e-9)
    alone = dataclasses.replace(trial, metadata={**trial.metadata, "mode": "agent"})
    assert np.abs([one for _, one in predictions(learner, alone)] - trial["confidence"][:-1]).max() > 0.001


def test_the_figure_is_a_png(fake_learner, noisy, tmp_path):
    draw_reliability(evaluate(prediction_errors(fake_learner(PATH), noisy)), tmp_path / "r.png")
    assert (tmp_path / "r.png").read_bytes().startswith(b"\x89PNG")


def test_the_demonstration_of_a_route_is_the_first_one_with_its_sides(scenario, fake_learner):
    routes = {item.provenance["route"]: item for item in teach(scenario, seed=9)}
    first, second = list(routes)[:2]
    learner = fake_learner(PATH)
    learner.demonstrations = np.array([routes[name].positions for name in (second, first, second)])
    assert demonstrations_of_routes(scenario, learner) == {second: 0, first: 1}
    learner.demonstrations = None
    assert demonstrations_of_routes(scenario, learner) == {}
