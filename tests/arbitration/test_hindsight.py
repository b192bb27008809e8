"""Hindsight optimisation against dynamic programming on small worlds, and on the routes of a scenario."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from drake_shared.arbitration.hindsight import (
    Hindsight,
    HindsightModel,
    least_expected,
    route_value,
    updated_posterior,
)
from drake_shared.arbitration.route_pursuit import RoutePursuit
from drake_shared.arbitration.routes import POINTS, routes_of
from drake_shared.arbitration.rule import ArbiterInputs
from drake_shared.common.errors import InputError
from drake_shared.scenario import load_scenario

PERIOD = 0.05
SCENARIO = load_scenario("two_obstacles")
ROUTES = routes_of(SCENARIO, [])
COUNT = len(ROUTES.lengths)
# Left, right, up, down on a grid of 5 x 4 fields, two of which are goals.
MOVES = ((-1, 0), (1, 0), (0, 1), (0, -1))
WIDE, HIGH, GOALS = 5, 4, ((4, 0), (4, 3))


def next_field(field, move):
    x, y = field[0] + move[0], field[1] + move[1]
    return (x, y) if 0 <= x < WIDE and 0 <= y < HIGH else field


def soft_values(goal, rationality):
    """V and Q of a driver who is noisily rational, by soft value iteration; each move costs 1."""
    fields = list(itertools.product(range(WIDE), range(HIGH)))
    value = dict.fromkeys(fields, 0.0)
    for _ in range(400):
        costs = {f: [1.0 + value[next_field(f, m)] for m in MOVES] for f in fields}
        value = {
            f: 0.0 if f == goal else -np.logaddexp.reduce(-rationality * np.array(costs[f])) / rationality
            for f in fields
        }
    return value, costs


def test_the_posterior_is_that_of_all_moves_of_a_noisily_rational_driver():
    rationality, moves = 1.7, (1, 2, 1, 0, 2)
    worlds = [soft_values(goal, rationality) for goal in GOALS]
    probability, joint = np.full((2, 1), 0.5), np.full(2, 0.5)
    field = (1, 1)
    for move in moves:
        advantage = np.array([[value[field] - costs[field][move]] for value, costs in worlds])
        probability = updated_posterior(probability, advantage, rationality=rationality, most=1.0)
        for goal, (_, costs) in enumerate(worlds):
            odds = np.exp(-rationality * np.array(costs[field]))
            joint[goal] *= odds[move] / odds.sum()
        field = next_field(field, MOVES[move])
    np.testing.assert_allclose(probability[:, 0], joint / joint.sum(), rtol=1e-9)


@pytest.mark.parametrize("share", [0.05, 0.4, 0.5, 0.8])
def test_the_move_is_that_of_dynamic_programming_where_the_goal_is_told_after_it(share):
    # QMDP: the goal becomes known after this move, so the best move costs least in the mean over the goals.
    worlds = [soft_values(goal, 200.0) for goal in GOALS]
    probability = np.array([share, 1.0 - share])
    for field in itertools.product(range(WIDE - 1), range(HIGH)):
        expected = [
            sum(
                p * (1.0 + value[next_field(field, move)])
                for p, (value, _) in zip(probability, worlds, strict=True)
            )
            for move in MOVES
        ]
        values = np.array([costs[field] for _, costs in worlds]).T[:, :, None]
        chosen = least_expected(probability[:, None], values, np.zeros((4, 1))).item()
        assert expected[chosen] == pytest.approx(min(expected))


def test_the_cost_to_go_beside_a_route_is_that_of_dynamic_programming():
    # Moves along the route cost their length, moves across it their length times the rate at that distance.
    slope, width, cell = 1.5, 0.1, 0.01
    across, along = np.arange(-40, 41) * cell, np.arange(31) * cell
    rate = slope * np.minimum(np.abs(across) / width, 1.0)
    value = np.full((len(along), len(across)), np.inf)
    value[0, 40] = 0.0  # The end of the route.
    for _ in range(len(along) + len(across)):
        value[1:] = np.minimum(value[1:], value[:-1] + cell)
        value[:-1] = np.minimum(value[:-1], value[1:] + cell)
        step = 0.5 * (rate[1:] + rate[:-1]) * cell
        value[:, 1:] = np.minimum(value[:, 1:], value[:, :-1] + step)
        value[:, :-1] = np.minimum(value[:, :-1], value[:, 1:] + step)
    closed = route_value(along[:, None], np.abs(across), slope=slope, width=width)
    np.testing.assert_allclose(closed, value, atol=1e-9)


def test_no_goal_becomes_more_probable_than_allowed():
    probability = np.array([[0.5], [0.3], [0.2]])
    for _ in range(50):
        advantage = np.array([[0.0], [-1.0], [-2.0]])
        probability = updated_posterior(probability, advantage, rationality=1.0, most=0.99)
    assert probability[0, 0] == pytest.approx(0.99)
    assert probability.sum() == pytest.approx(1.0)
    assert (probability > 0.0).all()


def test_positions_are_projected_onto_the_nearest_point_of_a_route():
    pursuit = RoutePursuit(ROUTES, robot=SCENARIO.robot, look_ahead=0.6, travel_time=SCENARIO.travel_time)
    points = ROUTES.points[..., 0] + 1j * ROUTES.points[..., 1]
    # A corner has no direction; two of the planned routes have some.
    bends = np.abs(np.diff(np.angle(np.diff(points, axis=1)), axis=1)).max(axis=1)
    smooth = np.flatnonzero(bends < 0.05)
    assert len(smooth)
    rng = np.random.default_rng(1)
    for at in range(5, POINTS - 20, 12):
        beside = points[:, at] + 0.05 * rng.standard_normal(2).dot([1.0, 1j])
        _, left, distance = pursuit.project(beside[:, None], np.full((COUNT, 1), at - 4))
        # Against the nearest of points so close together that those between them do not matter.
        for route in smooth:
            fine = np.interp(np.linspace(0, POINTS - 1, 20_001), np.arange(POINTS), points[route])
            apart = np.abs(fine - beside[route])
            assert distance[route, 0] == pytest.approx(apart.min(), abs=2e-3)
            length = ROUTES.lengths[route] * (1.0 - apart.argmin() / 20_000)
            assert left[route, 0] == pytest.approx(length, abs=0.02)


def rule_with(**changes) -> Hindsight:
    model = dataclasses.replace(HindsightModel(), **changes)
    return Hindsight(model, ROUTES, robot=SCENARIO.robot, period=PERIOD, travel_time=SCENARIO.travel_time)


def inputs(pose, human) -> ArbiterInputs:
    pose, human = np.reshape(pose, (3, -1)), np.reshape(human, (2, -1))
    count = human.shape[1]
    unused = np.full((2, count), np.nan)
    return ArbiterInputs(human=human, autonomous=unused, confidence=unused[0], pose=pose, clearance=unused[0])


def drive(rule, route, noise, seed=0):
    """The state after a driver with noise followed a route for 4 s, and the weights on the way."""
    pursuit = RoutePursuit(ROUTES, robot=SCENARIO.robot, look_ahead=0.6, travel_time=SCENARIO.travel_time)
    rng = np.random.default_rng(seed)
    state, weights = rule.initial_state(1), []
    points = ROUTES.points[route]
    for index in range(2, 90):
        x, y = points[index]
        yaw = np.arctan2(*(points[index + 1] - points[index])[::-1])
        pose = np.array([[x], [y], [yaw]])
        command = pursuit.commands(np.full((COUNT, 1), index), pose)[:, route, 0]
        weight, _, state = rule.step(state, inputs(pose, command + rng.normal(0.0, noise, 2)))
        weights.append(weight.item())
    return state, np.array(weights)


@pytest.mark.parametrize("route", range(COUNT))
def test_the_route_of_a_driver_is_found(route):
    state, _ = drive(rule_with(), route, 0.3)
    assert state["probability"][:, 0].argmax() == route


def test_with_a_prohibitive_cost_of_differing_the_driver_drives():
    _, weights = drive(rule_with(deviation=1e9), 0, 0.8)
    assert (weights == 1.0).all()
    _, weights = drive(rule_with(deviation=0.0), 0, 0.8)
    assert weights.mean() < 0.5


speeds = st.floats(-12.0, 12.0)


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.tuples(speeds, speeds), min_size=1, max_size=6), st.floats(-0.5, 5.5), st.floats(-1.5, 1.5)
)
def test_the_command_is_a_convex_combination_of_the_driver_and_the_routes(commands, x, y):
    rule = rule_with()
    state, pose = rule.initial_state(1), [[x], [y], [0.3]]
    pursuit = RoutePursuit(ROUTES, robot=SCENARIO.robot, look_ahead=0.6, travel_time=SCENARIO.travel_time)
    for command in commands:
        before = {name: value.copy() for name, value in state.items()}
        weight, shared, after = rule.step(state, inputs(pose, command))
        for name, value in before.items():
            np.testing.assert_array_equal(state[name], value)  # The state is an argument, not a buffer.
        own = pursuit.commands(after["index"], np.array(pose))[..., 0]
        state = after
        assert 0.0 <= weight.item() <= 1.0
        np.testing.assert_allclose(state["probability"].sum(), 1.0)
        if weight.item() < 1.0:
            # What is not the driver's lies between the commands of the routes.
            rest = (shared[:, 0] - weight.item() * np.array(command)) / (1.0 - weight.item())
            assert (rest >= own.min(axis=1) - 1e-9).all()
            assert (rest <= own.max(axis=1) + 1e-9).all()


def test_without_a_command_nothing_is_learnt_of_the_route():
    rule = rule_with()
    state = rule.initial_state(1)
    before = state["probability"]
    _, _, state = rule.step(state, inputs([0.5, 0.1, 0.2], [0.0, 0.0]))
    np.testing.assert_array_equal(state["probability"], before)


def test_a_command_answers_what_the_driver_saw_a_reaction_delay_ago():
    poses, human, still = [[0.1 * step, 0.02 * step, 0.1] for step in range(6)], [4.0, 6.0], [0.0, 0.0]
    late = rule_with(delay=3 * PERIOD)
    state = late.initial_state(1)
    for pose in poses[:5]:
        _, _, state = late.step(state, inputs(pose, still))
    _, _, answered = late.step(state, inputs(poses[5], human))
    prompt = rule_with(delay=0.0)
    state = prompt.initial_state(1)
    for pose in poses[:2]:
        _, _, state = prompt.step(state, inputs(pose, still))
    _, _, expected = prompt.step(state, inputs(poses[2], human))
    np.testing.assert_allclose(answered["probability"], expected["probability"])
    assert np.ptp(expected["probability"]) > 1e-3


def test_trials_side_by_side_do_not_depend_on_each_other():
    rule = rule_with()
    alone, both = rule.initial_state(1), rule.initial_state(2)
    rng = np.random.default_rng(2)
    for step in range(30):
        pose, command = np.array([0.03 * step, 0.01 * step, 0.1]), rng.uniform(2.0, 6.0, 2)
        weight, shared, alone = rule.step(alone, inputs(pose, command))
        weights, commands, both = rule.step(
            both, inputs(np.stack([pose, -pose], axis=1), np.stack([command, command[::-1]], axis=1))
        )
        np.testing.assert_allclose(weights[0], weight[0])
        np.testing.assert_allclose(commands[:, 0], shared[:, 0], atol=1e-12)
    np.testing.assert_allclose(both["probability"][:, 0], alone["probability"][:, 0])


@pytest.mark.parametrize(
    ("field", "value"), [("width", 0.0), ("most_probable", 1.0), ("delay", float("nan")), ("slope", -1.0)]
)
def test_fields_of_the_model_out_of_range_are_refused(field, value):
    with pytest.raises(InputError) as caught:
        HindsightModel(**{field: value})
    assert caught.value.field == field
