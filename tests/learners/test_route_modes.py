"""The routes into which a prediction with one mode is split."""

import numpy as np
import pytest

from drake_shared import load_learner, load_scenario
from drake_shared.learners.route_modes import RouteModes
from drake_shared.scenario.obstacles import ObstacleDistance

SHIPPED = [
    f"{task}_{preset}"
    for task in ("two_obstacles", "three_obstacles", "doorway")
    for preset in ("default", "paper")
]


def split(learner, step: int, position):
    first = step + 1
    seen = np.array([learner.grid[step]]), np.array([position])
    mean, variance = learner.predict(*seen, learner.grid[first:])
    modes = RouteModes(learner)(float(learner.grid[step]), tuple(position), first, mean, variance)
    return modes, mean, variance


@pytest.mark.parametrize("name", SHIPPED)
def test_at_the_start_there_are_several_routes_and_none_leads_through_an_obstacle(name):
    learner = load_learner(name)
    scenario = load_scenario(learner.metadata["scenario"])
    modes, mean, _ = split(learner, 0, (scenario.start.x, scenario.start.y))
    distance = ObstacleDistance(scenario.obstacles)
    likely = modes.mean[modes.probability > 0.05]
    assert len(likely) >= 2
    assert all(distance(path).min() > scenario.robot.footprint_radius for path in likely)
    # The prediction's own mean does.
    assert distance(mean).min() < scenario.robot.footprint_radius


@pytest.mark.parametrize("name", SHIPPED)
def test_the_probabilities_mix_the_routes_to_the_prediction(name):
    """Their mean is near that of the prediction, which no single route is near."""
    learner = load_learner(name)
    modes, mean, _ = split(learner, 0, learner.demonstrations[0, 0])
    assert modes.probability.sum() == pytest.approx(1.0)
    mixed = np.nansum(modes.probability[:, None, None] * modes.mean, axis=0)
    error = np.sqrt(np.square(mixed - mean).mean())
    of_routes = np.sqrt(np.square(learner.demonstrations[:, 1:] - mean).mean(axis=(1, 2)))
    assert error < 0.3 * of_routes.min()


@pytest.mark.parametrize("route", [0, 1, 2])
def test_between_the_obstacles_a_clear_prediction_is_one_route_and_the_prediction_itself(route):
    learner = load_learner("two_obstacles_paper")
    modes, mean, variance = split(learner, 60, learner.demonstrations[route, 60])
    assert modes.aim == route
    assert modes.probability[route] > 0.95
    np.testing.assert_array_equal(modes.mean[route], mean)
    np.testing.assert_array_equal(modes.variance[route], variance)


def test_routes_that_are_left_behind_have_no_probability():
    learner = load_learner("two_obstacles_default")
    # On the left of the first obstacle, where the second route passes on the right.
    modes, _, _ = split(learner, 30, learner.demonstrations[0, 30])
    assert modes.probability[1] < 0.02
    assert np.isnan(modes.mean[1]).all()


def test_far_from_all_demonstrations_every_route_is_as_uncertain_as_the_prediction():
    learner = load_learner("two_obstacles_default")
    modes, _, variance = split(learner, 0, (0.0, 0.8))
    assert variance.min() > 0.5
    assert np.nanmin(modes.variance) >= variance.min() - 1e-12
