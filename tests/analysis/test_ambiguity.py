"""Ambiguous and clear steps on simple paths."""

import dataclasses
import math

import numpy as np
import pytest

from drake_shared.analysis.ambiguity import (
    Ambiguity,
    ambiguity,
    ambiguity_ranking,
    area_under_curve,
    mean_weights,
    undecided,
)
from drake_shared.robots import DiffDrive
from drake_shared.robots.description import describe_robot
from drake_shared.simulation.trial import Trial

TIMES = np.arange(0.0, 10.05, 0.1)
ALONG = 0.5 * TIMES
# Both go straight for 2 m; then one turns left.
STRAIGHT = np.stack([ALONG, np.zeros_like(TIMES)], axis=-1)
FORK = np.stack([ALONG, np.maximum(ALONG - 2.0, 0.0)], axis=-1)


def driven(path: np.ndarray, weight: np.ndarray | None = None) -> Trial:
    weight = np.zeros(len(path)) if weight is None else weight
    columns = {"t": 0.05 * np.arange(len(path)), "x": path[:, 0], "y": path[:, 1], "human_weight": weight}
    return Trial(columns=columns, metadata={"robot": describe_robot(DiffDrive()).to_json()})


@pytest.mark.parametrize("own", [STRAIGHT, FORK])
def test_ambiguous_before_the_fork_and_clear_after_it(own):
    parts = ambiguity(driven(own), TIMES, np.stack([STRAIGHT, FORK]))
    x = own[:-1, 0]
    assert parts.ambiguous[x < 1.9].all()
    assert not parts.ambiguous[x > 2.3].any()
    assert not parts.clear[x < 2.2].any()
    assert parts.clear[x > 2.5].all()


def test_between_both_distances_steps_are_neither_ambiguous_nor_clear():
    parts = ambiguity(driven(STRAIGHT), TIMES, np.stack([STRAIGHT, FORK]))
    between = (ALONG[:-1] > 2.2) & (ALONG[:-1] < 2.28)
    assert between.any()
    assert not parts.ambiguous[between].any()
    assert not parts.clear[between].any()


def test_paths_that_stay_together_are_not_ambiguous():
    parts = ambiguity(driven(STRAIGHT), TIMES, np.stack([STRAIGHT, STRAIGHT + np.array([0.0, 0.1])]))
    assert not parts.ambiguous.any()
    assert not parts.clear.any()


def test_the_same_path_at_another_speed_does_not_separate():
    slow = np.stack([np.minimum(ALONG**2 / 5.0, 5.0), np.zeros_like(TIMES)], axis=-1)
    assert not ambiguity(driven(STRAIGHT), TIMES, np.stack([STRAIGHT, slow])).ambiguous.any()


def test_the_distances_scale_with_the_robot():
    paths = np.stack([STRAIGHT, FORK])
    plain = ambiguity(driven(FORK), TIMES, paths)
    small = ambiguity(driven(0.1 * FORK), TIMES, 0.1 * paths, robot=DiffDrive(footprint_radius=0.0267))
    assert plain.ambiguous.any()
    np.testing.assert_array_equal(small.ambiguous, plain.ambiguous)
    np.testing.assert_array_equal(small.clear, plain.clear)


def test_the_own_demonstration_is_the_nearest_one():
    wide = STRAIGHT + np.array([0.0, 1.0])
    near_wide = wide + np.array([0.0, 0.1])
    assert ambiguity(driven(near_wide), TIMES, np.stack([STRAIGHT, wide])).clear.all()


def test_the_last_row_is_left_out():
    weight = np.linspace(1.0, 0.0, len(TIMES))
    parts = ambiguity(driven(STRAIGHT, weight), TIMES, np.stack([STRAIGHT, FORK]))
    np.testing.assert_array_equal(parts.human_weight, weight[:-1])
    assert len(parts.ambiguous) == len(parts.clear) == len(weight) - 1


def part(high, low) -> Ambiguity:
    weight = np.array([*high, *low])
    first = np.arange(len(weight)) < len(high)
    return Ambiguity(ambiguous=first, clear=~first, human_weight=weight)


@pytest.mark.parametrize(
    ("high", "low", "area"),
    [
        ([0.9, 0.8], [0.1, 0.2, 0.3], 1.0),
        ([0.1, 0.2], [0.9, 0.8], 0.0),
        ([0.5, 0.5], [0.5, 0.5], 0.5),
        ([0.9, 0.2], [0.1, 0.3], 0.75),
    ],
)
def test_ranking_is_the_share_of_pairs_in_the_right_order(high, low, area):
    assert ambiguity_ranking([part(high, low)]) == pytest.approx(area)


def test_ranking_is_over_all_steps_of_all_trials():
    assert ambiguity_ranking([part([0.9], [0.5]), part([0.4], [0.1])]) == pytest.approx(3 / 4)


def test_without_steps_of_one_kind_ranking_and_mean_are_nan():
    parts = [part([0.9], [])]
    assert math.isnan(ambiguity_ranking(parts))
    assert math.isnan(mean_weights(parts)["weight_where_clear"])
    assert mean_weights(parts)["weight_where_ambiguous"] == 0.9


def test_a_route_is_open_while_another_one_is_near_and_differs_at_an_obstacle_ahead(scenario):
    # left_right and left_left run together until they pass the second obstacle on different sides.
    found = {}
    for route in scenario.routes:
        curve = scenario.path_of(route)
        trial = driven(curve.position(np.linspace(0.0, curve.length, 401)))
        trial.metadata["route"] = route.name
        found[route.name] = undecided(trial, scenario)
        assert found[route.name][0]
        assert not found[route.name][-1]
    x = scenario.path_of(scenario.route("left_right")).position(np.linspace(0.0, 5.0, 401))[:, 0]
    first = scenario.static_obstacles[0].x
    beside = int(np.argmin(np.abs(x - first)))
    assert found["left_right"][beside]
    assert not found["right_left"][beside]
    # A route that passes all obstacles alike does not count.
    own = scenario.route("left_right")
    scenario.routes = [own, dataclasses.replace(own, name="x")]
    trial.metadata["route"] = "x"
    assert not undecided(trial, scenario).any()


def test_the_area_under_the_curve_counts_pairs():
    assert area_under_curve(np.array([2.0, 3.0]), np.array([1.0, 2.0])) == 3.5 / 4.0
    assert math.isnan(area_under_curve(np.array([]), np.array([1.0])))
