"""SurrogateOperator: its command, its imperfections, and whether it reaches the goal."""

import copy
import dataclasses
import math

import numpy as np
import pytest
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput

from drake_shared.analysis.metrics import metrics, sides_passed
from drake_shared.common.errors import InputError
from drake_shared.scenario import load_scenario
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.surrogate_operator import Behaviour, SurrogateOperator

CALM = Behaviour(noise=0.0)
PERIOD = 0.05


class Source(LeafSystem):
    """Outputs the value of a function of time."""

    def __init__(self, size: int, function):
        super().__init__()
        self.DeclareVectorOutputPort(
            "value",
            size,
            lambda context, output: output.set_value(function(round(context.get_time(), 6))),
            {self.time_ticket()},
        )


def commands(scenario, *, pose, behaviour=CALM, route=None, duration=2.0, noise=None, **others) -> np.ndarray:
    """Commands (n, 2) of an operator whose input is ``pose(time)``, one row per period, as in a log.

    Other ports of the operator are connected if functions of time are given for them.
    """
    builder = DiagramBuilder()
    dut = builder.AddSystem(SurrogateOperator(scenario=scenario))
    functions = {"pose": pose, "noise": noise or (lambda time: [0.0, 0.0]), **others}
    for name, function in functions.items():
        source = builder.AddSystem(Source(dut.GetInputPort(name).size(), function))
        builder.Connect(source.get_output_port(), dut.GetInputPort(name))
    sink = LogVectorOutput(dut.get_output_port(), builder, PERIOD)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    route = scenario.routes[0] if route is None else scenario.route(route)
    dut.SetBehaviour(
        dut.GetMyMutableContextFromRoot(simulator.get_mutable_context()), route=route, behaviour=behaviour
    )
    simulator.AdvanceTo(duration)
    return sink.FindLog(simulator.get_context()).data().T.copy()


def still(time: float) -> list[float]:
    return [0.0, 0.0, 0.0]


@pytest.mark.parametrize("delay", [0.05, 0.1, 0.2, 0.35, 1.0])
def test_the_command_responds_to_a_step_of_the_pose_after_exactly_the_delay(open_floor, delay):
    behaviour = dataclasses.replace(CALM, delay=delay)
    seen = commands(open_floor, pose=still, behaviour=behaviour)
    pushed = commands(
        open_floor, pose=lambda time: [0.0, 0.2 if time >= 0.5 else 0.0, 0.0], behaviour=behaviour
    )
    first = np.flatnonzero(np.abs(pushed - seen).sum(axis=1) > 1e-9)[0]
    assert first * PERIOD == pytest.approx(0.5 + delay)


def test_a_delay_between_two_periods_is_interpolated(open_floor):
    answers = []
    for delay in (0.10, 0.125, 0.15):
        behaviour = dataclasses.replace(CALM, delay=delay)
        pushed = commands(
            open_floor, pose=lambda time: [0.0, 0.0, 0.4 if time >= 0.5 else 0.0], behaviour=behaviour
        )
        answers.append(np.diff(pushed[round(0.6 / PERIOD)]).item())
    assert answers[0] < answers[1] < answers[2]


def test_without_delay_the_command_responds_one_period_later_since_it_is_state(open_floor):
    dut = SurrogateOperator(scenario=open_floor)
    assert not dut.HasAnyDirectFeedthrough()
    behaviour = dataclasses.replace(CALM, delay=0.0)
    pushed = commands(open_floor, pose=lambda time: [0, 0, 0.3 if time >= 0.5 else 0.0], behaviour=behaviour)
    assert np.flatnonzero(pushed[:, 0] != pushed[:, 1])[0] == round(0.55 / PERIOD)


@pytest.mark.parametrize(
    ("pose", "turn"), [([1, 0.3, 0], -1), ([1, -0.3, 0], 1), ([1, 0, 0.3], -1), ([1, 0, -0.3], 1)]
)
def test_steers_back_to_the_route(open_floor, pose, turn):
    left, right = commands(open_floor, pose=lambda time: pose, duration=3.0)[-1]
    assert np.sign(right - left) == turn


def test_the_correction_of_an_error_is_proportional_to_skill(open_floor):
    def turn(skill: float) -> float:
        behaviour = dataclasses.replace(CALM, skill=skill)
        return np.diff(commands(open_floor, pose=lambda time: [1, 0.1, 0.1], behaviour=behaviour)[-1]).item()

    assert turn(1.0) != 0
    assert turn(0.5) == pytest.approx(0.5 * turn(1.0))
    assert turn(0.0) == pytest.approx(0.0, abs=1e-12)


def test_an_operator_without_skill_fails_on_a_route_that_a_skilled_one_completes(scenario):
    simulation = Simulation(scenario)

    def successes(skill: float) -> int:
        behaviour = Behaviour(skill=skill, noise=0.4)
        settings = [
            TrialSettings(driver="human", route="right_left", seed=seed, behaviour=behaviour)
            for seed in range(5)
        ]
        return sum(metrics(simulation.run(item))["success"] for item in settings)

    assert successes(1.0) == 5
    assert successes(0.0) <= 1


def test_the_command_is_zero_until_the_late_start(open_floor):
    behaviour = Behaviour(noise=2.0, late_start=1.0)
    driven = commands(open_floor, pose=still, behaviour=behaviour, noise=lambda time: [1.0, -1.0])
    started = round(1.0 / PERIOD)
    np.testing.assert_array_equal(driven[: started + 1], 0)
    assert np.abs(driven[started + 1]).min() > 0


def test_a_late_start_shifts_the_commands_in_time(open_floor):
    plain = commands(open_floor, pose=still, duration=2.0)
    late = commands(open_floor, pose=still, duration=3.0, behaviour=dataclasses.replace(CALM, late_start=1.0))
    np.testing.assert_allclose(late[20:], plain, atol=1e-9)


def test_a_pause_inserts_zero_commands_for_its_duration(open_floor):
    behaviour = dataclasses.replace(CALM, pause_time=1.0, pause=0.5)
    plain = commands(open_floor, pose=still, duration=2.0)
    paused = commands(open_floor, pose=still, duration=2.5, behaviour=behaviour)
    np.testing.assert_array_equal(paused[21:31], 0)
    np.testing.assert_allclose(np.delete(paused, range(21, 31), axis=0), plain, atol=1e-9)


def test_travel_time_is_inversely_proportional_to_the_speed_factor(open_floor):
    simulation = Simulation(open_floor)

    def arrival(factor: float) -> float:
        behaviour = dataclasses.replace(CALM, speed_factor=factor)
        trial = simulation.run(TrialSettings(driver="human", behaviour=behaviour))
        assert trial.status == "reached"
        return trial["t"][-1]

    usual = arrival(1.0)
    assert 0.8 * open_floor.travel_time < usual < open_floor.travel_time + 0.5
    assert arrival(1.3) == pytest.approx(usual / 1.3, rel=0.05)
    assert arrival(0.8) == pytest.approx(usual / 0.8, rel=0.05)


def test_noise_has_the_given_standard_deviation_and_time_constant(open_floor):
    rng = np.random.default_rng(3)
    count = 20_000
    samples = rng.standard_normal((count + 1, 2))
    # The robot stands at the goal, so the command is noise alone.
    behaviour = Behaviour(noise=0.75, noise_time=0.5)
    driven = commands(
        open_floor,
        pose=lambda time: [4.0, 0.0, 0.0],
        behaviour=behaviour,
        duration=count * PERIOD,
        noise=lambda time: samples[round(time / PERIOD)],
    )[500:]
    assert driven.std(axis=0) == pytest.approx([0.75, 0.75], rel=0.05)
    assert driven.mean(axis=0) == pytest.approx([0, 0], abs=0.05)
    left, right = (driven - driven.mean(axis=0)).T
    for lag in (1, 5, 10):
        for wheel in (left, right):
            correlation = (wheel[:-lag] * wheel[lag:]).mean() / wheel.var()
            assert correlation == pytest.approx(math.exp(-lag * PERIOD / 0.5), abs=0.05)
    assert abs((left * right).mean()) / left.var() < 0.05


def test_the_command_never_exceeds_the_wheels_speed_limit(open_floor):
    rng = np.random.default_rng(4)
    driven = commands(
        open_floor,
        pose=lambda time: rng.uniform(-3, 3, 3),
        behaviour=Behaviour(noise=50.0, speed_factor=5.0, skill=10.0),
        noise=lambda time: rng.standard_normal(2),
    )
    limit = open_floor.robot.max_wheel_speed
    assert np.abs(driven).max() == pytest.approx(limit)
    assert np.abs(driven).max() <= limit * (1 + 1e-12)


def chances(count: int):
    samples = np.random.default_rng(5).uniform(size=(count + 1, 4))
    return lambda time: samples[round(time / PERIOD)]


def test_signal_dependent_noise_is_proportional_to_the_command(open_floor):
    rng = np.random.default_rng(6)
    count = 4000
    samples = rng.standard_normal((count + 1, 2))

    def spread(x: float) -> np.ndarray:
        # At a constant distance behind the plan the command is constant.
        driven = commands(
            open_floor,
            pose=lambda time: [x, 0.0, 0.0],
            behaviour=dataclasses.replace(CALM, signal_noise=0.1, noise_time=0.1),
            duration=count * PERIOD,
            noise=lambda time: samples[round(time / PERIOD)],
        )[400:]
        assert driven.std(axis=0) == pytest.approx(0.1 * driven.mean(axis=0), rel=0.07)
        return driven.std(axis=0)

    assert (spread(3.0) > 1.5 * spread(3.5)).all()


def test_the_given_share_of_the_commands_is_random(open_floor):
    count = 4000
    plain, driven = (
        commands(
            open_floor,
            pose=still,
            behaviour=dataclasses.replace(CALM, random_share=share),
            duration=count * PERIOD,
            chance=chances(count),
        )
        for share in (0.0, 0.3)
    )
    random = np.abs(driven - plain).sum(axis=1) > 1e-9
    assert random.mean() == pytest.approx(0.3, abs=0.02)
    limit = open_floor.robot.max_wheel_speed
    np.testing.assert_allclose(driven[random].mean(axis=0), 0, atol=0.06 * limit)
    np.testing.assert_allclose(driven[random].std(axis=0), limit / math.sqrt(3), rtol=0.04)
    assert np.abs(driven).max() <= limit


def test_a_lagging_operator_repeats_the_last_command_with_the_given_probability(open_floor):
    count = 4000
    noise = np.random.default_rng(7).standard_normal((count + 1, 2))
    driven = commands(
        open_floor,
        pose=lambda time: [3.5, 0.0, 0.0],  # Where the wheels' limit is far.
        behaviour=Behaviour(lag=0.8),
        duration=count * PERIOD,
        noise=lambda time: noise[round(time / PERIOD)],
        chance=chances(count),
    )
    assert (np.diff(driven, axis=0) == 0).all(axis=1).mean() == pytest.approx(0.8, abs=0.02)


def test_a_stubborn_operator_opposes_the_change_that_assistance_made_to_the_last_command(open_floor):
    wished = commands(open_floor, pose=still)
    pushed = commands(
        open_floor,
        pose=still,
        behaviour=dataclasses.replace(CALM, stubbornness=0.5),
        shared_command=lambda time: [1.0, -2.0],
    )
    np.testing.assert_allclose(pushed[1:], wished[1:] + 0.5 * (wished[:-1] - [1.0, -2.0]), atol=1e-12)


def test_a_yielding_operator_reduces_the_command_as_the_human_weight_falls(open_floor):
    wished = commands(open_floor, pose=still)

    def weight(time: float) -> list[float]:
        return [1.0 if time < 1.0 else 0.25]

    held = commands(
        open_floor, pose=still, behaviour=dataclasses.replace(CALM, yielding=0.8), human_weight=weight
    )
    np.testing.assert_array_equal(held[:21], wished[:21])
    np.testing.assert_allclose(held[21:], 0.4 * wished[21:], atol=1e-12)


@pytest.mark.parametrize("reaction", [{"stubbornness": 0.8}, {"yielding": 1.0}])
def test_stubbornness_and_yielding_have_no_effect_without_assistance(scenario, reaction):
    simulation = Simulation(scenario)
    plain, alone = (
        simulation.run(TrialSettings(driver="human", seed=2, behaviour=Behaviour(**options)))
        for options in ({}, reaction)
    )
    np.testing.assert_allclose(alone.commands("human"), plain.commands("human"), atol=1e-9)


def test_an_operator_that_does_not_react_ignores_assistance(open_floor):
    inputs = {"human_weight": lambda time: [0.3], "shared_command": lambda time: [3.0, -3.0]}
    np.testing.assert_array_equal(
        commands(open_floor, pose=still, **inputs), commands(open_floor, pose=still)
    )


def test_a_seed_draws_the_same_noise_for_every_behaviour(scenario):
    simulation = Simulation(scenario)
    plain, lagging = (
        simulation.run(TrialSettings(driver="human", seed=3, behaviour=Behaviour(lag=lag)))["human_left"][1]
        for lag in (0.0, 1e-9)
    )
    assert plain == lagging != 0


def test_a_deep_copy_of_a_behaviour_is_the_same_object():
    assert copy.deepcopy(CALM) is CALM


@pytest.mark.parametrize(
    ("task", "route"),
    [
        (task, route.name)
        for task in ("two_obstacles", "three_obstacles", "doorway")
        for route in load_scenario(task).routes
    ],
)
def test_reaches_the_goal_without_assistance_on_every_route_of_every_scenario(task, route):
    trial = Simulation(load_scenario(task)).run(TrialSettings(driver="human", route=route, seed=1))
    assert trial.status == "reached"
    assert not trial["contact"].any()


def test_changes_its_route_at_the_switch_time(scenario):
    simulation = Simulation(scenario)
    behaviour = dataclasses.replace(CALM, switch_time=4.5)
    trial = simulation.run(
        TrialSettings(driver="human", route="left_right", then="left_left", behaviour=behaviour)
    )
    assert trial.status == "reached"
    assert sides_passed(trial) == {"first": "left", "second": "left"}


def run_with(diagram, operator, seed: int) -> np.ndarray:
    context = diagram.CreateDefaultContext()
    diagram.SetRandomContext(context, RandomGenerator(seed))
    simulator = Simulator(diagram, context)
    simulator.AdvanceTo(2.0)
    return operator.GetOutputPort("human_command").Eval(operator.GetMyContextFromRoot(context)).copy()


def test_noise_is_reproducible_from_the_random_context(scenario):
    simulation = Simulation(scenario)
    diagram, operator = simulation.diagram, simulation.parts.operator
    first = run_with(diagram, operator, 7)
    other = run_with(diagram, operator, 8)
    np.testing.assert_array_equal(first, run_with(diagram, operator, 7))
    assert np.all(first != other)


def test_route_and_behaviour_belong_to_the_context(scenario):
    dut = SurrogateOperator(scenario=scenario)
    contexts = [dut.CreateDefaultContext() for _ in range(2)]
    dut.SetBehaviour(contexts[0], route=scenario.route("right_left"), behaviour=CALM)
    for context in contexts:
        dut.GetInputPort("pose").FixValue(context, BasicVector([1.0, 0.0, 0.0]))
        dut.GetInputPort("noise").FixValue(context, [0.0, 0.0])
        for count in range(60):
            context.SetTime(count * PERIOD)
            update = dut.EvalUniquePeriodicDiscreteUpdate(context)
            context.get_mutable_discrete_state().SetFrom(update)
    below, above = (np.diff(dut.get_output_port().Eval(context)).item() for context in contexts)
    assert below < 0 < above


@pytest.mark.parametrize("field", [field.name for field in dataclasses.fields(Behaviour)])
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_a_negative_or_non_finite_behaviour_is_refused(field, value):
    with pytest.raises(InputError, match=f"operator: {field} must be finite and not negative"):
        Behaviour(**{field: value})


@pytest.mark.parametrize("field", ["noise_time", "speed_factor"])
def test_a_noise_time_or_speed_factor_of_zero_is_refused(field):
    with pytest.raises(InputError, match=f"operator: {field} must be positive"):
        Behaviour(**{field: 0.0})


@pytest.mark.parametrize("field", ["random_share", "lag", "yielding"])
def test_a_share_above_1_is_refused(field):
    with pytest.raises(InputError, match=f"operator: {field} must be at most 1"):
        Behaviour(**{field: 1.01})


def test_a_delay_above_one_second_is_refused():
    with pytest.raises(InputError, match=r"operator: delay must be at most 1\.0 s"):
        Behaviour(delay=1.01)


def test_a_scenario_without_routes_is_refused(scenario):
    scenario.routes = []
    with pytest.raises(InputError) as caught:
        SurrogateOperator(scenario=scenario)
    assert caught.value.field == "routes"
