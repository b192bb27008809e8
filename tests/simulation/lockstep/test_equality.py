"""Trials in lock-step are those of the Drake diagram."""

import copy
import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings, strategies

from drake_shared.arbitration.authority import Authority
from drake_shared.common.files import models_directory
from drake_shared.demonstrations import read_demonstrations
from drake_shared.learners import load_learner, train
from drake_shared.learners.calibrated_confidence import CALIBRATION_KEY, CalibratedConfidence, OpenWay
from drake_shared.learners.ensemble.learner import EnsembleLearner
from drake_shared.learners.mixture.learner import MixtureLearner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.named import OPERATORS, changes_of_route
from drake_shared.scenario import Goal, load_scenario
from drake_shared.simulation.config import SharedControlConfig, blend_for, config_for
from drake_shared.simulation.faults import Faults
from drake_shared.simulation.lockstep.engine import Lockstep
from drake_shared.simulation.lockstep.noise import is_drakes
from drake_shared.simulation.trial import Simulation, TrialSettings

pytestmark = pytest.mark.skipif(not is_drakes(), reason="another C++ standard library draws other numbers")

# In [m], and for w. Where a rounding of a position in float64 changes it in float32, a difference may grow.
WITHIN, GROWN = 1e-9, 1e-5
# The largest difference of each trial compared.
_differences: list[float] = []


def learner_of(scenario: str, preset: str = "default"):
    return load_learner(models_directory() / "learners" / f"{scenario}_{preset}.safetensors")


def operator_settings(scenario, name: str, *, seed: int = 0, **changes) -> TrialSettings:
    """A trial of a named operator; routes, or changes of route, alternate with the seed."""
    named = OPERATORS[name]
    routes = changes_of_route(scenario) if named.switches else [(route, None) for route in scenario.routes]
    route, then = routes[seed % len(routes)]
    return TrialSettings(
        seed=seed,
        route=route.name,
        then=None if then is None else then.name,
        behaviour=named.behaviour_in(scenario),
        **changes,
    )


def check_equal(simulation: Simulation, settings, learners=None) -> list:
    """Compares the trials of both engines, and returns those of Drake."""
    together = list(Lockstep(simulation).run(settings, learners=learners))
    alone = [
        simulation.run(item, learner=learner)
        for item, learner in zip(settings, learners or [None] * len(settings), strict=True)
    ]
    for ours, drakes in zip(together, alone, strict=True):
        assert {**drakes.metadata, "engine": "lockstep"} == ours.metadata
        assert list(ours.columns) == list(drakes.columns)
        assert (ours["t"] == drakes["t"]).all()
        assert (ours["contact"] == drakes["contact"]).all()
        difference = max(abs(ours[name] - drakes[name]).max() for name in ("x", "y", "human_weight"))
        assert difference <= GROWN
        _differences.append(difference)
        # A rounding in float32 changes the agent's command, and hardly the path.
        tolerance = max(1e4 * difference, 1e-4)
        for name in drakes.columns:
            assert np.allclose(ours[name], drakes[name], rtol=0.0, atol=tolerance, equal_nan=True), name
    return alone


@pytest.mark.parametrize(("seed", "name"), list(enumerate(OPERATORS)), ids=OPERATORS)
def test_every_named_operator(seed, name):
    scenario = load_scenario("two_obstacles")
    # Under fusion the loop of an operator who yields amplifies rounding.
    simulation = Simulation(scenario, learner=learner_of("two_obstacles"), config=blend_for("default"))
    check_equal(simulation, [operator_settings(scenario, name, seed=seed)])


def test_a_calibrated_confidence():
    scenario, learner = load_scenario("two_obstacles"), learner_of("two_obstacles")
    calibration = CalibratedConfidence(
        log_ratio=(0.0, 1.0, 2.0),
        probability=(1.0, 0.9, 0.2),
        open_ways=((), (OpenWay(until=6.3, alike=1),), ()),
    )
    calibrated = dataclasses.replace(
        learner, metadata={**learner.metadata, CALIBRATION_KEY: calibration.to_json()}
    )
    settings = [operator_settings(scenario, "unskilled", seed=seed) for seed in range(2)]
    trials = check_equal(Simulation(scenario, learner=calibrated), settings)
    # On the second route a way was never demonstrated: the confidence is at most that of the other one.
    assert trials[1]["confidence"][40:80].max() == pytest.approx(1.0 / 1.3)


ARBITERS = [
    "blend",
    "halves",
    "traded:threshold=0.6,margin=0.1,least_clearance=0.2",
    "leader-follower:share=0.3",
    "leader-follower:leader=agent",
    "fusion",
    "hindsight",
]


@pytest.mark.parametrize("arbitration", ARBITERS)
def test_every_arbiter_in_all_scenarios(arbitration):
    for place, name in enumerate(("two_obstacles", "three_obstacles", "doorway")):
        end = ("reached", "duration")[(place + ARBITERS.index(arbitration)) % 2]
        scenario = load_scenario(name)
        if place != ARBITERS.index(arbitration) % 3:
            # The first obstacle is passed in this time. Each arbiter drives one of the scenarios to its end.
            scenario = dataclasses.replace(scenario, duration=5.0)
        config = SharedControlConfig(arbitration=arbitration, end=end, confidence_gain=100.0)
        simulation = Simulation(scenario, learner=learner_of(name), config=config)
        check_equal(simulation, [operator_settings(scenario, "unskilled", seed=7)])


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_confidence_alone_decides_without_authority(preset):
    scenario = load_scenario("three_obstacles")
    simulation = Simulation(
        scenario, learner=learner_of("three_obstacles", preset), config=config_for("paper")
    )
    check_equal(simulation, [operator_settings(scenario, "primary", seed=seed) for seed in range(2)])


@pytest.mark.parametrize("authority", [{"floor": 0.3, "weight_rate": None}, {"command_rate": None}])
def test_parts_of_the_authority_are_off(authority):
    scenario = load_scenario("two_obstacles")
    config = SharedControlConfig.from_json({"authority": {**authority, "conflict_time": None}})
    simulation = Simulation(scenario, learner=learner_of("two_obstacles"), config=config)
    check_equal(simulation, [operator_settings(scenario, "resting", seed=5)])


def test_human_agent_and_both_with_and_without_a_learner_in_one_block():
    scenario = load_scenario("two_obstacles")
    learners = [learner_of("two_obstacles"), learner_of("two_obstacles", "paper"), None, None]
    drivers = ["agent", "shared", None, "human"]
    settings = [
        operator_settings(scenario, "noisy", seed=seed, driver=who) for seed, who in enumerate(drivers)
    ]
    settings[1] = TrialSettings(seed=3, route="left_left", confidence_gain=50.0)
    check_equal(Simulation(scenario), settings, learners)


def made_of(cnmp, kind: str):
    """A learner of another kind that consists of CNMPs, without training."""
    first = dataclasses.replace(cnmp, demonstrations=cnmp.demonstrations[:1], weights=np.ones(1))
    rest = dataclasses.replace(
        learner_of("doorway"),
        demonstrations=cnmp.demonstrations[1:],
        weights=np.full(2, 0.5),
        reference=cnmp.reference,
    )
    shared = {"confidence_gain": cnmp.confidence_gain, "metadata": cnmp.metadata, "preset": "default"}
    if kind == "ensemble":
        return EnsembleLearner(members=(cnmp, rest), **shared)
    shares, leanings = np.array([0.4, 0.6]), np.array([1.3, 0.8])
    return MixtureLearner(experts=(first, rest), shares=shares, leanings=leanings, noise=0.1, **shared)


@pytest.mark.parametrize("kind", ["mixture", "ensemble"])
def test_learners_made_of_several_networks(kind):
    scenario = load_scenario("two_obstacles")
    simulation = Simulation(scenario, learner=made_of(learner_of("two_obstacles"), kind))
    operators = ("primary", "switching", "unskilled")
    check_equal(
        simulation, [operator_settings(scenario, name, seed=seed) for seed, name in enumerate(operators)]
    )


def test_a_command_as_evidence_on_the_clock_of_time():
    scenario = dataclasses.replace(load_scenario("two_obstacles"), duration=5.0)
    learner = learner_of("two_obstacles")
    timed = dataclasses.replace(learner, metadata={**learner.metadata, "clock": "time"})
    (trial,) = check_equal(
        Simulation(scenario, learner=timed, config=blend_for("default")),
        [operator_settings(scenario, "unskilled")],
    )
    assert trial["moved_by_command"].any()


def test_an_echo_state_network():
    scenario = load_scenario("two_obstacles")
    demonstrations = read_demonstrations(models_directory() / "demonstrations" / "two_obstacles.parquet")
    simulation = Simulation(scenario, learner=train(demonstrations, learner="cesn"))
    check_equal(simulation, [operator_settings(scenario, "unskilled", seed=seed) for seed in range(2)])


def test_a_learner_of_its_own_for_each_trial():
    scenario = load_scenario("two_obstacles")
    cnmp = learner_of("two_obstacles")
    learners = [cnmp, made_of(cnmp, "mixture"), learner_of("two_obstacles", "paper"), cnmp]
    settings = [operator_settings(scenario, "signal-noise", seed=seed) for seed in range(4)]
    check_equal(Simulation(scenario, config=SharedControlConfig()), settings, learners)


def test_an_arbiter_whose_rule_depends_on_the_learner():
    scenario = load_scenario("two_obstacles")
    cnmp = learner_of("two_obstacles")
    config = SharedControlConfig(arbitration="fusion", faults=Faults(human_nan=0.2))
    learners = [cnmp, dataclasses.replace(cnmp, demonstrations=cnmp.demonstrations[:1])]
    settings = [operator_settings(scenario, "unskilled", seed=seed) for seed in range(2)]
    trials = check_equal(Simulation(scenario, config=config), settings, learners)
    assert any((trial["human_weight"] < 0.9).any() for trial in trials)


def test_collisions():
    scenario = load_scenario("doorway")
    simulation = Simulation(scenario, config=SharedControlConfig(driver="human", end="duration"))
    clumsy = [
        TrialSettings(seed=seed, route=route.name, behaviour=Behaviour(noise=2.5, skill=0.3, noise_time=1.0))
        for seed in range(4)
        for route in scenario.routes
    ]
    trials = check_equal(simulation, clumsy)
    assert sum(trial["contact"].any() for trial in trials) > len(trials) / 2


def test_the_trial_ends_at_any_of_several_goals():
    scenario = copy.deepcopy(load_scenario("two_obstacles"))
    scenario.goals = [Goal(name="near", x=2.5, y=0.0), Goal(name="side", x=3.6, y=0.9)]
    trials = check_equal(
        Simulation(scenario), [TrialSettings(route=name) for name in ("left_right", "left_left")]
    )
    assert [trial.status for trial in trials] == ["reached", "reached"]


def test_another_robot_and_period():
    scenario = copy.deepcopy(load_scenario("two_obstacles"))
    scenario.robot.max_speed, scenario.robot.track = 0.8, 0.4
    scenario.control_period, scenario.duration = 0.04, 8.0
    simulation = Simulation(scenario, learner=learner_of("two_obstacles"))
    check_equal(simulation, [TrialSettings(seed=1, behaviour=Behaviour(delay=0.03, speed_factor=2.0))])


@pytest.mark.parametrize("arbitration", ["blend", "fusion"])
def test_a_trial_does_not_depend_on_the_others(arbitration):
    # The first obstacle is passed in this time.
    scenario = dataclasses.replace(load_scenario("two_obstacles"), duration=5.0)
    config = SharedControlConfig(arbitration=arbitration)
    engine = Lockstep(Simulation(scenario, learner=learner_of("two_obstacles"), config=config))
    settings = [operator_settings(scenario, "unskilled", seed=seed) for seed in range(70)]
    together = list(engine.run(settings))
    for index in (0, 33, 69):
        (alone,) = engine.run(settings[index : index + 1])
        for name, values in alone.columns.items():
            assert np.array_equal(values, together[index][name], equal_nan=True), name


@pytest.mark.parametrize(
    "faults",
    [
        {"delay": 0.2, "jitter": 0.15, "loss": 0.3},
        {"freeze_time": 3.0, "freeze": 1.0, "human_nan": 0.2},
        {"loss": 0.7},
    ],
)
def test_faults_of_the_human_channel(faults):
    scenario = load_scenario("two_obstacles")
    config = SharedControlConfig.from_json({"faults": faults})
    simulation = Simulation(scenario, learner=learner_of("two_obstacles"), config=config)
    check_equal(simulation, [operator_settings(scenario, "noisy", seed=seed) for seed in range(2)])


@pytest.mark.parametrize("name", ["two_obstacles", "three_obstacles", "doorway"])
def test_the_safety_filter(name):
    scenario = load_scenario(name)
    config = SharedControlConfig(driver="human", safety_clearance=0.05, end="duration")
    behaviour = Behaviour(noise=1.5, skill=0.3)
    settings = [
        TrialSettings(seed=seed, route=route.name, behaviour=behaviour)
        for seed, route in enumerate(scenario.routes)
    ]
    trials = check_equal(Simulation(scenario, config=config), settings)
    assert any((trial["safe_left"] != trial["shared_left"]).any() for trial in trials)


@settings(max_examples=4, deadline=None, derandomize=True)
@given(
    name=strategies.sampled_from(["two_obstacles", "three_obstacles", "doorway"]),
    operator=strategies.sampled_from(sorted(OPERATORS)),
    arbitration=strategies.sampled_from(["blend", "halves", "traded", "fusion", "human", "agent"]),
    authority=strategies.booleans(),
    clearance=strategies.sampled_from([None, 0.05]),
    gain=strategies.floats(20.0, 500.0),
    seed=strategies.integers(0, 2**32 - 1),
)
def test_any_operator_with_any_arbiter_in_any_scenario(
    name, operator, arbitration, authority, clearance, gain, seed
):
    scenario = load_scenario(name)
    config = SharedControlConfig(
        arbitration=arbitration,
        authority=Authority(enabled=authority),
        safety_clearance=clearance,
        confidence_gain=gain,
    )
    simulation = Simulation(scenario, learner=learner_of(name), config=config)
    check_equal(simulation, [operator_settings(scenario, operator, seed=seed)])


def test_hardly_any_difference_grew():
    grown = sum(difference > WITHIN for difference in _differences)
    assert grown <= max(1.0, 0.01 * len(_differences))
