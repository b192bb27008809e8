"""Posterior fusion against a posterior on a grid, and what its command is made of."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from drake_shared.arbitration.command_filter import CommandFilters
from drake_shared.arbitration.fusion import Fusion
from drake_shared.arbitration.fusion_model import FusionModel
from drake_shared.arbitration.route_guide import RouteGuide
from drake_shared.arbitration.routes import routes_of
from drake_shared.arbitration.rule import ArbiterInputs
from drake_shared.common.errors import InputError
from drake_shared.scenario import load_scenario

PERIOD = 0.05
SCENARIO = load_scenario("two_obstacles")
ROUTES = routes_of(SCENARIO, [])
COUNT = len(ROUTES.lengths) + 1  # And straight to the goal.
# Drivers change neither their route nor their noise, and obstacles say nothing.
FIXED = FusionModel(switching=1e-12, drifting=1e-12, delay=1e-9, blocked_time=1e9)


def fusion_with(model: FusionModel) -> Fusion:
    return Fusion(model, ROUTES, scenario=SCENARIO, robot=SCENARIO.robot, period=PERIOD)


def inputs_of(pose: np.ndarray, human: np.ndarray, *, clearance: float = np.inf) -> ArbiterInputs:
    """Inputs of a rule that uses pose (3, n), the human's command (2, n) and clearance."""
    return ArbiterInputs(
        human=human,
        autonomous=np.full_like(human, np.nan),
        confidence=np.full(pose.shape[1], np.nan),
        pose=pose,
        clearance=np.full(pose.shape[1], clearance),
    )


def observe(fusion: Fusion, commands: np.ndarray, poses: np.ndarray):
    """The state after commands (t, 2) at poses (t, 3), and what was expected of each (t, H + 1)."""
    state, expected = fusion.initial_state(1), []
    for command, pose in zip(commands, poses, strict=True):
        _, _, state = fusion.step(state, inputs_of(pose[:, None], command[:, None]))
        expected.append(state["expected"][-1, :, 0])
    return state, np.array(expected)


@pytest.fixture(scope="module")
def drive():
    """Poses on the first route, and commands of a driver who is noisy about a constant speed."""
    points = ROUTES.points[0, :60:2]
    yaw = np.arctan2(*np.diff(points, axis=0).T[::-1])
    rng = np.random.default_rng(3)
    commands = 6.0 + rng.normal(0.0, 0.8, (len(yaw), 2))
    return commands, np.column_stack((points[:-1], yaw))


@pytest.mark.parametrize("noises", [(0.5,), (0.1, 0.6, 1.3)])
def test_the_posterior_is_that_on_the_grid_of_destinations_and_noises(drive, noises):
    model = FusionModel(**{**FIXED.__dict__, "noises": noises, "noise_times": (0.25, 1.0)})
    commands, poses = drive
    routes = dataclasses.replace(ROUTES, demonstrated=np.arange(COUNT - 1) == 1)
    fusion = Fusion(model, routes, scenario=SCENARIO, robot=SCENARIO.robot, period=PERIOD)
    state, expected = observe(fusion, *drive)
    pairs = [(noise, time) for noise in noises for time in (0.25, 1.0)]
    log, share = np.zeros((2, COUNT + 1, len(pairs)))
    meant = [(model.meant_planned, model.meant_planned_rate)] * COUNT + [(model.none_turn, model.none_rate)]
    meant[1] = (model.meant, model.meant_rate)  # The route that was demonstrated.
    turn, speed = 0.5 * (commands[:, 1] - commands[:, 0]), 0.5 * commands.sum(axis=1)
    for pair, (noise, time) in enumerate(pairs):
        for row, kind in enumerate([*meant, (model.speed, model.speed_rate)]):
            # One hypothesis at a time, as if there were no others.
            filters = CommandFilters(
                [kind], np.array([noise / 2**0.5]), np.array([time]), period=PERIOD, tail=4.0
            )
            if row <= COUNT:
                share[row, pair] = filters.share.item()
            own = filters.initial_state(1)
            for step in range(len(turn)):
                given = speed if row == COUNT + 1 else turn
                value = np.array([[given[step] - expected[step, row]]])
                own, score, *_ = filters.step(own, value, np.ones(1, bool))
                log[slice(None) if row == COUNT + 1 else row, pair] += score.item()
    known = np.where(np.arange(COUNT) == 1, 1.0, model.prior_planned)
    prior = np.append(known * (1.0 - model.prior_none) / known.sum(), model.prior_none)
    np.testing.assert_allclose(fusion.route_probability(fusion.initial_state(1))[:, 0], prior)
    odds = prior[:, None] * np.exp(log - log.max())
    np.testing.assert_allclose(state["probability"][..., 0], odds / odds.sum(), rtol=1e-6, atol=1e-9)
    before, _ = observe(fusion, commands[:-1], poses[:-1])
    weight, _, _ = fusion.step(before, inputs_of(poses[-1][:, None], commands[-1][:, None]))
    assert weight.item() == pytest.approx((odds / odds.sum() * share).sum())


def test_what_is_known_of_a_driver_who_does_nothing_fades_at_the_rates_of_the_model(drive):
    model = FusionModel(blocked_time=1e9, noise_times=(0.25,))
    fusion = fusion_with(model)
    state, _ = observe(fusion, *drive)
    route, noise = fusion.route_probability(state)[:, 0], fusion.noise_probability(state)[:, 0]
    steps = 7
    for _ in range(steps):
        _, _, state = fusion.step(state, inputs_of(np.zeros((3, 1)), np.zeros((2, 1))))
    anew = np.append(np.full(COUNT, (1.0 - model.switching_to_none) / COUNT), model.switching_to_none)
    kept = (1.0 - model.switching * PERIOD) ** steps
    np.testing.assert_allclose(fusion.route_probability(state)[:, 0], anew + kept * (route - anew))
    kept, anybody = (1.0 - model.drifting * PERIOD) ** steps, 1.0 / len(model.noises)
    np.testing.assert_allclose(fusion.noise_probability(state)[:, 0], anybody + kept * (noise - anybody))


def test_a_driver_on_a_route_is_found_and_the_noise_is_known_with_its_uncertainty():
    fusion = fusion_with(FusionModel())
    robot, found = SCENARIO.robot, {}
    for noise in (0.05, 1.2):
        rng = np.random.default_rng(0)
        state, route, shaken = fusion.initial_state(1), ROUTES.points[1], np.zeros(2)
        for index in range(4, 110):
            x, y = route[index]
            yaw = np.arctan2(*(route[index + 1] - route[index])[::-1])
            shaken = 0.9 * shaken + 0.19**0.5 * rng.normal(0.0, noise, 2)
            command = np.array(robot.command_toward((x, y, yaw), tuple(route[index + 18]), 1.0)) + shaken
            _, _, state = fusion.step(state, inputs_of(np.array([[x], [y], [yaw]]), command[:, None]))
        found[noise] = fusion.route_probability(state)[:, 0], *fusion.noise(state)[:, 0]
    for probability, _, deviation in found.values():
        assert probability.argmax() == 1
        assert probability.sum() == pytest.approx(1.0)
        assert 0.0 < deviation < 0.6
    assert found[0.05][1] < 0.3 < 0.8 < found[1.2][1]


def test_the_command_of_a_steady_driver_is_executed_whatever_the_route():
    fusion = fusion_with(FusionModel())
    state = fusion.initial_state(1)
    # A slow turn that leads along none of the routes.
    for step in range(120):
        human = np.array([[5.0 + np.sin(0.02 * step)], [5.0 - np.sin(0.02 * step)]])
        weight, shared, state = fusion.step(state, inputs_of(np.array([[0.5], [0.9], [1.5]]), human))
    assert weight.item() > 0.9
    np.testing.assert_allclose(shared, human, atol=0.1)


def test_a_sudden_change_of_route_is_followed_within_half_a_second():
    fusion = fusion_with(FusionModel())
    state, pose = fusion.initial_state(1), np.array([[0.3], [0.0], [0.0]])
    for turn in (*[1.5] * 40, *[-1.5] * 10):
        human = np.array([[5.0 - turn], [5.0 + turn]])
        weight, shared, state = fusion.step(state, inputs_of(pose, human))
    assert weight.item() > 0.5
    np.testing.assert_allclose(shared, human, atol=0.5)


def test_a_smooth_drive_on_an_untaught_route_is_not_taken_for_a_bend_off_a_demonstrated_one():
    model = FusionModel()
    kinds = [(model.meant, model.meant_rate), (model.meant_planned, model.meant_planned_rate)]
    filters = CommandFilters(kinds, np.array([0.1]), np.array([1.0]), period=PERIOD, tail=model.tail)
    state, evidence = filters.initial_state(1), np.zeros(2)
    for _ in range(20):
        # For 1 s, as the planned route expects, and 1.2 rad/s beside the demonstrated one.
        state, log, _, _ = filters.step(state, np.array([[-1.2], [0.0]]), np.array([True]))
        evidence += log[:, 0, 0]
    assert evidence[1] > evidence[0] + 1.0


def test_the_prior_of_a_person_is_where_a_drive_begins(drive):
    pairs = len(FusionModel().noises) * len(FusionModel().noise_times)
    weights = np.eye(pairs)[3]
    fusion = fusion_with(FusionModel(noise_prior=tuple(weights)))
    state = fusion.initial_state(1)
    np.testing.assert_allclose(fusion.noise_probability(state)[:, 0], weights, atol=1e-6)
    assert state["another_driver"].item() == 0.0
    state, _ = observe(fusion, *drive)
    assert state["another_driver"].item() == 1.0  # Somebody noisier drives.


def test_after_a_notice_the_noise_is_that_of_a_driver_of_whom_nothing_was_known(drive):
    pairs = len(FIXED.noises) * len(FIXED.noise_times)
    calm = tuple(np.geomspace(1.0, 1e-6, pairs))
    person = fusion_with(FusionModel(**{**FIXED.__dict__, "noise_prior": calm}))
    unknown = fusion_with(FIXED)
    (state, _), (expected, _) = observe(person, *drive), observe(unknown, *drive)
    assert state["another_driver"].item() == 1.0
    found, known = person.noise_probability(state), unknown.noise_probability(expected)
    np.testing.assert_allclose(found, known, rtol=1e-3, atol=1e-6)


speeds = st.floats(-12.0, 12.0)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(speeds, speeds), min_size=1, max_size=8), st.floats(-0.5, 5.5), st.floats(-1.5, 1.5)
)
def test_any_commands_give_a_finite_command_and_a_distribution(commands, x, y):
    fusion = fusion_with(FusionModel())
    state = fusion.initial_state(1)
    pose = np.array([[x], [y], [0.3]])
    for command in commands:
        before = {name: value.copy() for name, value in state.items()}
        weight, shared, after = fusion.step(state, inputs_of(pose, np.array(command)[:, None]))
        for name, value in before.items():
            np.testing.assert_array_equal(state[name], value)  # The state is an argument, not a buffer.
        state = after
        assert 0.0 <= weight.item() <= 1.0
        assert np.isfinite(shared).all()
        np.testing.assert_allclose(state["probability"].sum(), 1.0)


def test_without_a_command_the_robot_stops_and_nothing_is_learnt(drive):
    fusion = fusion_with(FIXED)
    _, poses = drive
    state, _ = observe(fusion, np.zeros((len(poses), 2)), poses)
    prior = fusion.route_probability(fusion.initial_state(1))
    np.testing.assert_allclose(fusion.route_probability(state), prior, atol=1e-9)
    _, shared, _ = fusion.step(state, inputs_of(poses[-1][:, None], np.zeros((2, 1))))
    assert (shared == 0.0).all()


def test_a_destination_behind_an_obstacle_is_blocked():
    guide = RouteGuide(ROUTES, SCENARIO, SCENARIO.robot)
    # Beside the first obstacle, on its left: routes that pass it on the right lie behind it.
    pose = np.array([[1.4], [0.6], [0.0]])
    progress = guide.initial_progress(1)
    for _ in range(10):
        progress = guide.advance(progress, pose)
    *_, target = guide.commands(progress, pose, np.array([0.6]))
    first = SCENARIO.obstacles[0]
    right = [route[np.abs(route[:, 0] - first.x).argmin(), 1] < first.y for route in ROUTES.points]
    blocked = guide.is_blocked(pose, target[0])[:, 0]
    assert blocked[:-1].tolist() == right
    assert blocked[-1]  # The second obstacle is in front of the goal.


def test_a_turn_is_compared_with_those_of_the_routes_a_reaction_delay_earlier(drive):
    commands, poses = drive
    states = {}
    for delay in (1e-9, 4 * PERIOD):
        fusion = fusion_with(FusionModel(**{**FIXED.__dict__, "delay": delay}))
        states[delay], _ = observe(fusion, commands, poses)
    late = states[4 * PERIOD]["expected"][..., 0]
    np.testing.assert_allclose(late[-1], states[1e-9]["expected"][-1, :, 0])
    assert len(late) == 5


def test_drivers_side_by_side_do_not_depend_on_each_other(drive):
    fusion = fusion_with(FusionModel())
    commands, poses = drive
    alone, _ = observe(fusion, commands, poses)
    state = fusion.initial_state(2)
    for command, pose in zip(commands, poses, strict=True):
        both = np.stack([command, -command], axis=1)
        _, _, state = fusion.step(state, inputs_of(np.repeat(pose[:, None], 2, axis=1), both))
    np.testing.assert_allclose(state["probability"][..., :1], alone["probability"], rtol=1e-9)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("meant", 0.0),
        ("prior_none", 1.0),
        ("noises", ()),
        ("delay", float("nan")),
        ("noise_prior", (float("nan"),) * 30),
        ("noise_prior", (1.0,)),
    ],
)
def test_fields_of_the_model_out_of_range_are_refused(field, value):
    with pytest.raises(InputError) as caught:
        FusionModel(**{field: value})
    assert caught.value.field == field


def test_a_robot_that_an_obstacle_holds_turns_to_a_route_that_is_free():
    fusion = fusion_with(FusionModel())
    first = SCENARIO.obstacles[0]
    # In front of the obstacle, a little to its left; the driver pushes straight on.
    pose = np.array([[first.x - 0.52], [first.y + 0.1], [0.0]])
    state, human = fusion.initial_state(1), np.full((2, 1), 8.0)
    turns = []
    for _ in range(30):
        _, shared, state = fusion.step(state, inputs_of(pose, human, clearance=0.03))
        turns.append(0.5 * (shared[1] - shared[0]).item())
    assert abs(turns[-1]) > 2.0 * abs(turns[1])
    moved = pose.copy()
    for _ in range(30):
        moved[0] -= 0.05
        _, shared, state = fusion.step(state, inputs_of(moved, human, clearance=0.03))
    assert state["held"].item() == 0.0
