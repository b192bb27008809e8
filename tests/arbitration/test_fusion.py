"""Posterior fusion against closed forms, and what its command is made of."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import multivariate_normal

from drake_shared.arbitration.fusion import Fusion, FusionModel
from drake_shared.arbitration.routes import routes_of
from drake_shared.arbitration.rule import ArbiterInputs
from drake_shared.common.errors import InputError
from drake_shared.scenario import load_scenario

PERIOD = 0.05
SCENARIO = load_scenario("two_obstacles")
ROUTES = routes_of(SCENARIO, [])
COUNT = len(ROUTES.lengths)
# Drivers neither change their route nor their noise.
FIXED = FusionModel(switching=1e-12, drifting=1e-12, delay=1e-9)


def fusion_with(model: FusionModel) -> Fusion:
    return Fusion(model, ROUTES, robot=SCENARIO.robot, period=PERIOD, travel_time=SCENARIO.travel_time)


def inputs_of(pose: np.ndarray, human: np.ndarray) -> ArbiterInputs:
    """Inputs of a rule that uses pose (3, n) and the human's command (2, n)."""
    unused = np.full(pose.shape[1], np.nan)
    return ArbiterInputs(
        human=human, autonomous=np.full_like(human, np.nan), confidence=unused, pose=pose, clearance=unused
    )


def observe(fusion: Fusion, commands: np.ndarray, poses: np.ndarray):
    """The state after commands (t, 2) at poses (t, 3), and the differences (t, K + 1) of the turns."""
    state, differences = fusion.initial_state(1), []
    for command, pose in zip(commands, poses, strict=True):
        _, _, state = fusion.step(state, inputs_of(pose[:, None], command[:, None]))
        differences.append(state["difference"][:, 0])
    return state, np.array(differences)


@pytest.fixture(scope="module")
def drive():
    """Poses on the first route, and commands of a driver who is noisy about a constant speed."""
    points = ROUTES.points[0, :60:2]
    yaw = np.arctan2(*np.diff(points, axis=0).T[::-1])
    rng = np.random.default_rng(3)
    commands = 6.0 + rng.normal(0.0, 0.8, (len(yaw), 2))
    return commands, np.column_stack((points[:-1], yaw))


def posterior(differences, model, noises):
    """By the joint normal density of all differences after the first, given the first."""
    log = np.empty((COUNT + 1, len(noises)))
    steps = np.arange(len(differences))
    for route in range(COUNT + 1):
        own, time = (
            (model.none_turn, model.none_time) if route == COUNT else (model.mismatch, model.mismatch_time)
        )
        for index, noise in enumerate(noises):
            # With one time constant for both, their sum is a process of first order as well.
            variance = 0.5 * noise**2 + own**2
            covariance = variance * np.exp(-PERIOD / time * np.abs(steps[:, None] - steps))
            values = differences[:, route]
            log[route, index] = multivariate_normal.logpdf(values, cov=covariance)
            log[route, index] -= multivariate_normal.logpdf(values[0], cov=variance)
    prior = np.append(np.full(COUNT, (1.0 - model.prior_none) / COUNT), model.prior_none)
    odds = prior[:, None] * np.exp(log - log.max())
    return odds / odds.sum()


@pytest.mark.parametrize("noises", [(0.5,), (0.1, 0.6, 1.3)])
def test_the_posterior_is_that_of_the_joint_density_of_all_commands(drive, noises):
    model = dataclasses.replace(FIXED, mismatch_time=1.0, none_time=1.0, noises=noises, noise_times=(1.0,))
    state, differences = observe(fusion_with(model), *drive)
    np.testing.assert_allclose(
        state["probability"][..., 0], posterior(differences, model, noises), rtol=1e-6, atol=1e-9
    )


def test_a_driver_on_a_route_is_found_and_a_noisy_one_is_known_to_be_noisy():
    fusion = fusion_with(FusionModel())
    robot = SCENARIO.robot
    found = {}
    for noise in (0.05, 1.2):
        rng = np.random.default_rng(0)
        state, route = fusion.initial_state(1), ROUTES.points[1]
        for index in range(4, 90):
            x, y = route[index]
            yaw = np.arctan2(*(route[index + 1] - route[index])[::-1])
            command = np.array(robot.command_toward((x, y, yaw), tuple(route[index + 12]), 0.6))
            command += rng.normal(0.0, noise, 2)
            _, _, state = fusion.step(state, inputs_of(np.array([[x], [y], [yaw]]), command[:, None]))
        found[noise] = fusion.route_probability(state)[:, 0], fusion.noise(state).item()
    for probability, _ in found.values():
        assert probability.argmax() == 1
        assert probability.sum() == pytest.approx(1.0)
    assert found[0.05][1] < 0.3 < 0.8 < found[1.2][1]


speeds = st.floats(-12.0, 12.0)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(speeds, speeds), min_size=1, max_size=8), st.floats(-0.5, 5.5), st.floats(-1.5, 1.5)
)
def test_the_command_is_a_convex_combination_of_the_human_and_the_routes(commands, x, y):
    fusion = fusion_with(FusionModel())
    state = fusion.initial_state(1)
    pose = np.array([[x], [y], [0.3]])
    for command in commands:
        before = {name: value.copy() for name, value in state.items()}
        human = np.array(command)[:, None]
        weight, shared, after = fusion.step(state, inputs_of(pose, human))
        for name, value in before.items():
            np.testing.assert_array_equal(state[name], value)  # The state is an argument, not a buffer.
        state = after
        assert 0.0 <= weight.item() <= 1.0
        np.testing.assert_allclose(state["probability"].sum(), 1.0)
        limit = SCENARIO.robot.max_wheel_speed
        assert np.abs(shared).max() <= max(np.abs(human).max(), limit) + 1e-9


def test_without_a_command_nothing_is_learnt_of_the_route(drive):
    fusion = fusion_with(FIXED)
    _, poses = drive
    state, _ = observe(fusion, np.zeros((len(poses), 2)), poses)
    prior = fusion.route_probability(fusion.initial_state(1))
    np.testing.assert_allclose(fusion.route_probability(state), prior, atol=1e-9)


def test_a_turn_is_compared_with_those_of_the_routes_a_reaction_delay_earlier(drive):
    _, poses = drive
    still = np.zeros((len(poses), 2))
    _, at_once = observe(fusion_with(FIXED), still, poses)
    _, delayed = observe(fusion_with(dataclasses.replace(FIXED, delay=4 * PERIOD)), still, poses)
    np.testing.assert_allclose(delayed[4:, :COUNT], at_once[:-4, :COUNT])
    np.testing.assert_allclose(delayed[:4], at_once[:4])


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
    ("field", "value"), [("mismatch", 0.0), ("prior_none", 1.0), ("noises", ()), ("delay", float("nan"))]
)
def test_fields_of_the_model_out_of_range_are_refused(field, value):
    with pytest.raises(InputError) as caught:
        FusionModel(**{field: value})
    assert caught.value.field == field
