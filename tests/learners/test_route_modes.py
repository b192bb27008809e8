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


class Straight:
    """Predicts the last position shown, with a variance of 0.01 m^2."""

    grid = np.linspace(0.0, 2.0, 21)

    def __init__(self, demonstrations):
        self.demonstrations = demonstrations
        self.shown = []

    def predict(self, times, positions, query_times):
        self.shown.append((times, positions))
        shape = (len(query_times), positions.shape[1])
        return np.broadcast_to(positions[-1], shape), np.full(shape, 0.01)


def fan_of_three(counts=(1, 1, 1)):
    """Routes along x that end at y = 1, 0 and -1, each demonstrated some times."""
    grid = Straight.grid
    ends = np.repeat([1.0, 0.0, -1.0], counts)
    return np.stack([np.stack([grid, 0.5 * end * grid], axis=-1) for end in ends])


@pytest.mark.parametrize("weights", [(0.2, 0.3, 0.5), (0.45, 0.1, 0.45), (0.7, 0.3, 0.0), (1.0, 0.0, 0.0)])
def test_the_probabilities_of_a_mixture_are_found_from_its_mean_and_variance(weights):
    learner = Straight(fan_of_three())
    later = learner.demonstrations[:, 1:]
    mean = np.tensordot(weights, later, 1)
    variance = np.tensordot(weights, np.square(later - mean), 1)
    modes = RouteModes(learner)(0.0, (0.0, 0.0), 1, mean, variance)
    np.testing.assert_allclose(modes.probability, weights, atol=0.01)
    assert modes.aim == np.argmax(weights)
    likely = np.array(weights) > 0.02
    assert np.isnan(modes.mean[~likely]).all()
    assert np.isfinite(modes.mean[likely]).all()


def test_a_mode_is_the_prediction_for_a_driver_who_goes_on_along_its_route():
    learner = Straight(fan_of_three())
    later = learner.demonstrations[:, 5:]
    mean, variance = later.mean(axis=0), later.var(axis=0) + 0.04
    modes = RouteModes(learner)(0.42, (0.4, 0.02), 5, mean, variance)
    for (times, positions), route in zip(learner.shown, learner.demonstrations, strict=True):
        # The position now, and four of the route up to its end.
        assert times[0] == 0.42
        assert positions[0].tolist() == [0.4, 0.02]
        assert (np.diff(times) > 0.0).all()
        steps = np.searchsorted(learner.grid, times[1:])
        np.testing.assert_array_equal(positions[1:], route[steps])
        assert steps[-1] == 20
        assert len(steps) >= 4
    np.testing.assert_allclose(modes.mean[:, 0], learner.demonstrations[:, -1])
    # What is uncertain about the prediction at all times is so on every route.
    np.testing.assert_allclose(modes.variance, np.broadcast_to([0.04, variance[:, 1].min()], (3, 16, 2)))


def test_routes_are_ordered_by_the_number_of_their_demonstrations():
    modes = RouteModes(Straight(fan_of_three((1, 3, 2))))
    later = fan_of_three()[:, 1:]
    for place, route in enumerate((1, 2, 0)):
        found = modes(0.0, (0.0, 0.0), 1, later[route], np.zeros((20, 2)))
        assert found.aim == place


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
