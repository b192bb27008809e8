"""Judging the confidence of learners of an arm's tip."""

import numpy as np
import pytest

from drake_shared.analysis.ambiguity import undecided
from drake_shared.analysis.confidence_calibration import (
    assess_confidence,
    demonstrations_of_routes,
    intended_path,
)
from drake_shared.learners import load_learner
from drake_shared.scenario import load_scenario
from drake_shared.simulation.trial import Simulation, TrialSettings

CUPS = load_scenario("table_three_cups")
LEARNER = load_learner("table_three_cups")


@pytest.fixture(scope="module")
def trial():
    return Simulation(CUPS, learner=LEARNER).run(TrialSettings(route="left"))


def test_each_route_has_the_demonstration_that_ends_at_its_goal():
    found = demonstrations_of_routes(CUPS, LEARNER)
    assert set(found) == {"left", "over", "right"}
    for route, index in found.items():
        goal = CUPS.goal_of(CUPS.route(route))
        end = LEARNER.demonstrations[index][-1]
        assert np.linalg.norm(end - [goal.x, goal.y, goal.z]) < goal.radius


def test_a_route_is_open_above_the_fork_alone(trial):
    still_open, height = undecided(trial, CUPS), trial["z"][:-1]
    assert still_open[height > 0.45].all()
    assert not still_open[height < 0.36].any()


def test_predictions_after_the_fork_are_correct_and_confident(trial):
    steps = assess_confidence(LEARNER, trial, intended_path(CUPS, LEARNER, "left"), every=10)
    low = trial["z"][:-1][::10] < 0.36
    assert steps.correct[low].all()
    assert steps.confidence[low].min() > 0.8


def test_points_of_a_route_lie_evenly_along_it():
    points = CUPS.points_of(CUPS.routes[0], 50)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert steps == pytest.approx(np.full(49, steps.mean()), rel=0.02)
    assert points[0] == pytest.approx(CUPS.routes[0].waypoints[0])
