"""Nothing presumes the size of one robot: a task of another scale, robot and all, goes the same way."""

import copy
import dataclasses

import numpy as np
import pytest

from drake_shared.common.files import models_directory
from drake_shared.learners import load_learner, train
from drake_shared.scenario import Scenario, check_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.teaching import teach
from drake_shared.simulation.trial import Simulation, TrialSettings

SCALES = [0.1, 0.2, 0.3, 2.0, 10.0]


def scaled(scenario: Scenario, scale: float) -> Scenario:
    """The task with every length, speed and acceleration in [m] times ``scale``."""
    large = copy.deepcopy(scenario)
    for item, names in [
        (large.start, ("x", "y")),
        (large.goal, ("x", "y", "radius")),
        (large.workspace, ("x_min", "x_max", "y_min", "y_max")),
        (large.robot, ("footprint_radius", "wheel_radius", "track", "max_speed", "max_acceleration")),
        *[(obstacle, ("x", "y", *obstacle.sizes())) for obstacle in large.obstacles],
    ]:
        for name in names:
            setattr(item, name, scale * getattr(item, name))
    for route in large.routes:
        route.waypoints = [[scale * x, scale * y] for x, y in route.waypoints]
    return large


class ScaledLearner:
    """A learner of the task at another scale."""

    def __init__(self, learner, scale: float, preset: str):
        self._learner, self._scale = learner, scale
        self.name, self.preset, self.grid, self.duration = (
            learner.name,
            preset,
            learner.grid,
            learner.duration,
        )
        self.metadata = learner.metadata
        self.confidence_gain = learner.confidence_gain / scale**2
        self.demonstrations = scale * learner.demonstrations

    def predict(self, times, positions, query_times):
        mean, variance = self._learner.predict(times, np.asarray(positions) / self._scale, query_times)
        return self._scale * mean, self._scale**2 * variance


class ScaledModes(ScaledLearner):
    """The same for a learner that predicts modes."""

    def predict_modes(self, times, positions, query_times):
        mean, variance, modes = self._learner.predict_modes(
            times, np.asarray(positions) / self._scale, query_times
        )
        modes = dataclasses.replace(
            modes, mean=self._scale * modes.mean, variance=self._scale**2 * modes.variance
        )
        return self._scale * mean, self._scale**2 * variance, modes


@pytest.fixture(scope="module")
def learner():
    return load_learner(models_directory() / "learners" / "two_obstacles_default.safetensors")


@pytest.mark.parametrize("route", ["left_right", "left_left"])
@pytest.mark.parametrize("preset", ["default", "of my own"])
def test_the_human_weight_and_the_outcome_do_not_depend_on_the_scale(scenario, learner, route, preset):
    settings = TrialSettings(seed=3, route=route)
    reference = Simulation(scenario, learner=ScaledLearner(learner, 1.0, preset)).run(settings)
    assert reference.status == "reached"
    assert reference["human_weight"].min() < 0.5
    for scale in SCALES:
        large = scaled(scenario, scale)
        check_scenario(large)
        trial = Simulation(large, learner=ScaledLearner(learner, scale, preset)).run(settings)
        assert trial.status == reference.status
        assert len(trial["t"]) == len(reference["t"])
        np.testing.assert_allclose(trial["human_weight"], reference["human_weight"], atol=0.02)
        np.testing.assert_allclose(trial.positions, scale * reference.positions, atol=0.02 * scale)
        assert trial["contact"].any() == reference["contact"].any()


@pytest.mark.parametrize("arbitration", ["hindsight", "rt-v2"])
def test_arbiters_that_weigh_distances_do_not_depend_on_the_scale(scenario, learner, arbitration):
    kind = ScaledLearner
    if arbitration == "rt-v2":
        learner = train(teach(scenario, count=3, seed=5), learner="mixture", iterations=100)
        kind = ScaledModes
    trials = [
        Simulation(
            scaled(scenario, scale),
            learner=kind(learner, scale, "of my own"),
            config=SharedControlConfig(arbitration=arbitration),
        ).run(TrialSettings(seed=3, route="left_right"))
        for scale in (1.0, 0.3)
    ]
    plain, small = (trial["human_weight"] for trial in trials)
    assert 0.0 < plain.mean() < 1.0
    np.testing.assert_allclose(small, plain, atol=0.02)


@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_demonstrations_scale_with_the_task(scenario, scale):
    plain, large = teach(scenario, count=1), teach(scaled(scenario, scale), count=1)
    np.testing.assert_allclose(large[0].positions, scale * plain[0].positions, atol=0.005 * scale)
    assert dataclasses.replace(large[0], score=None).times.shape == plain[0].times.shape
