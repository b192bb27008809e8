"""Why the control is divided as it is: one reason for each situation."""

import math

import numpy as np
import pytest

from drake_shared.cockpit.reasons import DemonstratedRoutes, Surroundings, reason_for

SURE, HELPFUL, UNSURE = {"confidence": 0.95}, {"confidence": 0.6}, {"confidence": 0.1}
AT_AN_OBSTACLE = {"shared_left": 6.0, "shared_right": 6.0, "safe_left": 0.5, "safe_right": 0.5}
ON_A_FORK = Surroundings(open_routes=2, distance=0.02)
ON_ONE_ROUTE = Surroundings(open_routes=1, distance=0.02)
FAR_AWAY = Surroundings(open_routes=0, distance=0.9)


def reason(values=SURE, *, mode="shared", has_learner=True, **options):
    return reason_for({"contact": 0.0, **values}, mode=mode, has_learner=has_learner, **options)


@pytest.mark.parametrize(
    ("expected", "situation"),
    [
        ("sure", {}),
        ("follows_you", {"values": HELPFUL}),
        ("paused", {"paused": True}),
        ("contact", {"values": SURE | {"contact": 1.0}}),
        ("kept_away", {"values": SURE | AT_AN_OBSTACLE}),
        ("kept_away", {"values": SURE | AT_AN_OBSTACLE, "mode": "human"}),
        ("sure", {"values": SURE | AT_AN_OBSTACLE | {"safe_left": 5.9, "safe_right": 6.0}}),
        ("no_learner", {"mode": "human", "has_learner": False}),
        ("assistance_off", {"mode": "human"}),
        ("agent_alone", {"mode": "agent"}),
        ("hands_off", {"let_go": "hands_off"}),
        ("conflict", {"let_go": "conflict"}),
        ("no_prediction", {"values": {"confidence": math.nan}}),
        ("fixed_share", {"arbitration": "halves"}),
        ("steady", {"arbitration": "fusion", "values": UNSURE | {"human_weight": 0.9}}),
        ("smoothed", {"arbitration": "fusion", "values": {"confidence": math.nan, "human_weight": 0.3}}),
        ("hands_off", {"arbitration": "fusion", "let_go": "hands_off"}),
        ("off_demonstrations", {"values": UNSURE, "surroundings": FAR_AWAY}),
        ("points_elsewhere", {"values": UNSURE | {"moved_by_command": 0.5}, "surroundings": ON_A_FORK}),
        ("routes_open", {"values": UNSURE, "surroundings": ON_A_FORK}),
        ("unsure", {"values": UNSURE, "surroundings": ON_ONE_ROUTE}),
        ("unsure", {"values": UNSURE}),
    ],
)
def test_each_situation_has_its_reason(expected, situation):
    assert reason(**situation) == expected


@pytest.mark.parametrize(
    "other", [{"let_go": "conflict"}, {"let_go": "hands_off"}, {"mode": "human"}, {"arbitration": "halves"}]
)
def test_contact_goes_before_everything_but_a_pause(other):
    assert reason({"confidence": 0.1, "contact": 1.0}, **other) == "contact"
    assert reason({"confidence": 0.1, "contact": 1.0}, paused=True, **other) == "paused"


def test_an_agent_that_is_sure_needs_no_further_reason():
    assert reason(SURE, surroundings=ON_A_FORK) == "sure"


def test_distances_count_relative_to_the_robot():
    near = Surroundings(open_routes=1, distance=0.1)
    assert reason(UNSURE, surroundings=near) == "unsure"
    assert reason(UNSURE, surroundings=near, scale=0.1) == "off_demonstrations"


@pytest.fixture
def fork():
    """Two routes that run together for 1 m, each demonstrated twice, and then part."""
    x = np.linspace(0.0, 2.0, 21)
    away = np.maximum(x - 1.0, 0.0)
    return np.stack([np.column_stack([x, side * away + shift]) for side in (-1, 1) for shift in (0.0, 0.02)])


def test_routes_are_open_until_they_part(fork):
    routes = DemonstratedRoutes(fork)
    assert routes.look(0, np.array([0.0, 0.0])).open_routes == 2
    assert routes.look(10, np.array([1.0, 0.0])).open_routes == 2
    assert routes.look(20, np.array([2.0, 1.0])).open_routes == 1
    assert routes.look(20, np.array([2.0, 0.0])).open_routes == 0


def test_the_distance_is_that_to_the_nearest_demonstration_at_equal_progress(fork):
    look = DemonstratedRoutes(fork).look
    assert look(5, np.array([0.5, 0.52])).distance == pytest.approx(0.5)
    assert look(20, np.array([0.5, 0.0])).distance > 1.0
    assert look(99, np.array([2.0, 1.0])).distance == pytest.approx(0.0)


def test_many_demonstrations_of_one_route_are_one_route():
    x = np.linspace(0.0, 2.0, 21)
    paths = np.stack([np.column_stack([x, np.full(21, 0.001 * index)]) for index in range(200)])
    assert DemonstratedRoutes(paths).look(3, np.array([0.3, 0.1])).open_routes == 1
