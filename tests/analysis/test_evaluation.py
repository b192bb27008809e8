"""Measures of predictions, against answers known beforehand."""

import numpy as np
import pytest
from scipy.stats import norm

from drake_shared.analysis.evaluation import (
    Confidence,
    calibration_of_confidence,
    draw_reliability,
    evaluate,
    judge_confidence,
    predictions,
    recalibration,
    ways_of,
)
from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.simulation.teaching import teach

T = np.linspace(0.0, 10.0, 101)
WAY = np.stack([0.5 * T, np.zeros_like(T)], -1)


@pytest.fixture
def scattered():
    """Demonstrations whose points lie about WAY with a standard deviation of 0.1 m."""
    rng = np.random.default_rng(0)
    return Demonstrations(
        items=tuple(
            Demonstration(times=T, positions=WAY + 0.1 * rng.standard_normal(WAY.shape)) for _ in range(20)
        )
    )


def test_an_honest_spread_covers_what_it_says(fake_learner, scattered):
    result = evaluate(predictions(fake_learner(WAY, variance=0.01), scattered))
    assert result["coverage50"] == pytest.approx(0.5, abs=0.01)
    assert result["coverage90"] == pytest.approx(0.9, abs=0.01)
    assert result["coverage95"] == pytest.approx(0.95, abs=0.01)
    assert result["scale"] == pytest.approx(1.0, abs=0.01)
    # Of two normal errors: entropy, mean of a Rayleigh density, and sigma/sqrt(pi).
    assert result["nll"] == pytest.approx(1 + np.log(2 * np.pi * 0.01), abs=0.02)
    assert result["ade"] == pytest.approx(0.1 * np.sqrt(np.pi / 2), abs=0.002)
    assert result["crps"] == pytest.approx(0.1 / np.sqrt(np.pi), abs=0.001)
    np.testing.assert_allclose(result["reliability"]["covered"], result["reliability"]["level"], atol=0.02)


def test_recalibration_finds_how_much_too_narrow_it_was(fake_learner, scattered):
    found = predictions(fake_learner(WAY, variance=0.01 / 4), scattered)
    assert recalibration(found) == pytest.approx(2.0, abs=0.02)
    assert evaluate(found)["coverage90"] == pytest.approx(2 * norm.cdf(1.645 / 2) - 1, abs=0.01)


def test_the_last_point_alone_makes_the_fde(fake_learner):
    late = WAY.copy()
    late[-1, 1] = 0.5
    shifted = Demonstrations(items=(Demonstration(times=T, positions=late),))
    result = evaluate(predictions(fake_learner(WAY), shifted))
    assert result["fde"] == pytest.approx(0.5)
    assert result["ade"] < 0.1


def test_time_to_the_end_is_told_apart(fake_learner, scattered):
    parts = evaluate(predictions(fake_learner(WAY), scattered))["by_time_to_end"]
    assert [round(part["to"], 6) for part in parts] == [2, 4, 6, 8, 10]


def test_bad_noise_is_refused(fake_learner, scattered):
    with pytest.raises(InputError, match="noise must be finite and not negative, got -1"):
        predictions(fake_learner(WAY), scattered, noise=-1)


def test_confidence_that_says_how_often_it_is_right_has_no_error():
    confidence = np.repeat([0.25, 0.75], 400)
    right = np.concatenate([np.arange(400) % 4 == 0, np.arange(400) % 4 != 0])
    judged = calibration_of_confidence([Confidence(confidence=confidence, right=right)])
    assert judged["expected_calibration_error"] == pytest.approx(0.0, abs=1e-12)
    assert judged["confident_and_wrong"] == 0.0
    assert [row["steps"] for row in judged["bins"]] == [400, 400]


def test_sure_and_wrong_is_counted():
    sure = Confidence(confidence=np.full(10, 0.9), right=np.arange(10) < 7)
    judged = calibration_of_confidence([sure])
    assert judged["confident_and_wrong"] == pytest.approx(0.3)
    assert judged["expected_calibration_error"] == pytest.approx(0.2)


def test_an_agent_that_expects_the_drivers_way_is_right(scenario, route_learner, human_trial):
    route = human_trial.metadata["route"]
    index = [item.name for item in scenario.routes].index(route)
    same = route_learner(scenario, route)
    assert judge_confidence(same, human_trial, 0).right.mean() > 0.95
    other = route_learner(scenario, scenario.routes[(index + 1) % 3].name)
    other.demonstrations = np.concatenate([other.demonstrations, same.demonstrations])
    assert judge_confidence(other, human_trial, 1).right.mean() < 0.6


def test_the_figure_is_a_picture(fake_learner, scattered, tmp_path):
    draw_reliability(evaluate(predictions(fake_learner(WAY), scattered)), tmp_path / "r.png")
    assert (tmp_path / "r.png").read_bytes().startswith(b"\x89PNG")


def test_the_way_of_a_route_is_the_first_demonstration_that_passes_on_its_sides(scenario, fake_learner):
    routes = {item.provenance["route"]: item for item in teach(scenario, seed=9)}
    first, second = list(routes)[:2]
    learner = fake_learner(WAY)
    learner.demonstrations = np.array([routes[name].positions for name in (second, first, second)])
    assert ways_of(scenario, learner) == {second: 0, first: 1}
    learner.demonstrations = None
    assert ways_of(scenario, learner) == {}
