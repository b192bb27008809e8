"""Demonstrations made by driving: one a route, scored, and none of a failure."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import RunError
from drake_shared.demonstrations import read_demonstrations, write_demonstrations
from drake_shared.scenario import clearance_scorer
from drake_shared.scenario.paths import passing_side
from drake_shared.simulation.teaching import teach
from drake_shared.systems.surrogate_operator import Behaviour


@pytest.fixture(scope="module")
def taught(_two_obstacles):
    return teach(_two_obstacles, seed=3)


def test_there_is_one_of_each_route_from_start_to_goal(taught, scenario):
    assert [item.provenance["route"] for item in taught] == [route.name for route in scenario.routes]
    assert {item.provenance["human_weight"] for item in taught} == {1.0}
    for item, route in zip(taught, scenario.routes, strict=True):
        np.testing.assert_array_equal(item.positions[0], [0.0, 0.0])
        assert np.linalg.norm(item.positions[-1] - [5.0, 0.0]) <= scenario.goal.radius
        for obstacle in scenario.obstacles:
            assert passing_side(item.positions, (obstacle.x, obstacle.y)) == route.sides[obstacle.name]


def test_each_lasts_as_long_as_a_trial_with_a_point_a_step(taught, scenario):
    for item in taught:
        assert len(item) == scenario.steps + 1
        assert item.times[-1] == pytest.approx(scenario.duration)
        assert item.yaws.shape == item.times.shape


def test_the_score_is_the_least_clearance_of_the_body(taught, scenario):
    scores = [clearance_scorer(scenario)(item.positions) for item in taught]
    np.testing.assert_array_equal(taught.scores, scores)
    assert min(scores) > 0


def test_routes_take_turns_and_each_demonstration_has_the_next_seed(scenario, taught):
    four = teach(scenario, count=4, seed=3)
    assert [item.provenance["seed"] for item in four] == [3, 4, 5, 6]
    assert four[3].provenance["route"] == "left_right"
    for one, same in zip(four, taught, strict=False):
        np.testing.assert_array_equal(one.positions, same.positions)
    assert not np.array_equal(four[3].positions, four[0].positions)


def test_comes_back_from_its_file(taught, tmp_path):
    write_demonstrations(tmp_path / "demos.parquet", taught)
    back = read_demonstrations(tmp_path / "demos.parquet")
    assert back.scenario == "two_obstacles"
    np.testing.assert_array_equal(back.scores, taught.scores)
    for item, other in zip(back, taught, strict=True):
        np.testing.assert_array_equal(item.positions, other.positions)
        np.testing.assert_array_equal(item.yaws, other.yaws)


def test_behaviour_is_that_of_the_operator(scenario):
    still = teach(scenario, count=1, behaviour=Behaviour(noise=0.0, late_start=1.0))
    np.testing.assert_array_equal(still[0].positions[:20], 0.0)


def test_an_operator_who_fails_teaches_nothing(scenario):
    with pytest.raises(RunError, match="the operator failed on route left_right"):
        teach(scenario, count=1, behaviour=Behaviour(late_start=14.0))
    narrow = dataclasses.replace(scenario, duration=3.0)
    with pytest.raises(RunError, match="timed_out"):
        teach(narrow, count=1)
