"""What is left to the human whatever the confidence does: its numbers, and the loop that heeds them."""

import dataclasses
import json
import math

import numpy as np
import pytest
from pydrake.systems.framework import LeafSystem

from drake_shared.analysis.metrics import metrics
from drake_shared.arbitration.authority import Authority
from drake_shared.cli.main import main
from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.learners import load_learner
from drake_shared.simulation.config import SharedControlConfig, config_for
from drake_shared.simulation.trial import Simulation, TrialSettings, read_log
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.surrogate_operator import Behaviour

PERIOD = 0.05
# Straight on, and to the left and right with the same speed, as wheel speeds in [rad/s].
AHEAD, LEFT, RIGHT = [6.0, 6.0], [2.0, 10.0], [10.0, 2.0]
FREE = {
    "floor": 0.0,
    "conflict_time": None,
    "hands_off_time": None,
    "weight_rate": None,
    "command_rate": None,
}


class Bench:
    """A ConfidenceBlender whose inputs the test sets, step by step."""

    def __init__(self, step, **authority):
        self.dut = ConfidenceBlender(authority=Authority(**authority), period=PERIOD, initial_idle_time=0.0)
        self.context = self.dut.CreateDefaultContext()
        self._step = step

    def run(self, human, agent, confidence, count=1, idle=None) -> tuple[np.ndarray, np.ndarray]:
        """Weights (count,) and shared commands (count, 2) that are applied in as many steps."""
        values = {"human_command": human, "autonomous_command": agent, "confidence": [confidence]}
        if idle is not None:
            values["idle_time"] = [idle]
        for name, value in values.items():
            self.dut.GetInputPort(name).FixValue(self.context, value)
        weights, commands = [], []
        for _ in range(count):
            weights.append(self.dut.GetOutputPort("human_weight").Eval(self.context).item())
            commands.append(self.dut.GetOutputPort("shared_command").Eval(self.context).copy())
            self._step(self.dut, self.context)
        return np.array(weights), np.array(commands)


@pytest.fixture
def bench(step):
    return lambda **authority: Bench(step, **authority)


def test_with_every_part_off_it_is_equation_2(bench):
    dut = bench(**FREE)
    rng = np.random.default_rng(3)
    for _ in range(30):
        human, agent = rng.uniform(-12, 12, (2, 2))
        confidence = rng.uniform()
        (weight,), (command,) = dut.run(human, agent, confidence)
        assert weight == 1.0 - confidence
        np.testing.assert_array_equal(command, weight * human + (1 - weight) * agent)


def test_under_the_floor_no_confidence_takes_the_human(bench):
    weights, commands = bench(**FREE | {"floor": 0.25}).run(LEFT, AHEAD, 1.0, 3)
    np.testing.assert_array_equal(weights, 0.25)
    np.testing.assert_allclose(commands[0], [5.0, 7.0])


@pytest.mark.parametrize(("mode", "weight"), [("agent", 0.0), ("human", 1.0)])
def test_someone_alone_is_alone(bench, mode, weight):
    dut = bench()
    dut.dut.SetDriver(dut.context, mode)
    weights, commands = dut.run(LEFT, RIGHT, 0.5, 40)
    np.testing.assert_array_equal(weights, weight)
    np.testing.assert_array_equal(commands, np.tile(LEFT if mode == "human" else RIGHT, (40, 1)))


def test_commands_that_point_apart_for_long_give_the_human_the_control_until_they_agree(bench):
    dut = bench(
        **FREE | {"conflict_time": 0.3, "release_time": 0.25, "agreement_time": 0.2, "weight_rate": 4.0}
    )
    dut.run(AHEAD, AHEAD, 1.0, 10)
    weights, _ = dut.run(LEFT, RIGHT, 1.0, 12)
    # The sixth step is the one at which they have pointed apart for 0.3 s.
    np.testing.assert_allclose(weights, [0, 0, 0, 0, 0, 0.2, 0.4, 0.6, 0.8, 1, 1, 1], atol=1e-9)
    weights, _ = dut.run(LEFT, LEFT, 1.0, 9)
    np.testing.assert_allclose(weights, [1, 1, 1, 0.8, 0.6, 0.4, 0.2, 0, 0], atol=1e-9)


@pytest.mark.parametrize("interlude", [AHEAD, [0.0, 0.0]])
def test_a_conflict_that_is_interrupted_is_none(bench, interlude):
    dut = bench(**FREE | {"conflict_time": 0.3})
    for _ in range(4):
        assert dut.run(LEFT, RIGHT, 1.0, 5)[0].max() == 0.0
        assert dut.run(interlude, AHEAD, 1.0)[0].max() == 0.0


def test_driving_back_contradicts_driving_on(bench):
    weights, _ = bench(**FREE | {"conflict_time": 0.3}).run([-6.0, -6.0], AHEAD, 1.0, 20)
    assert weights[-1] == 1.0


def test_neither_w_nor_the_command_jumps_whatever_the_confidence_does(bench):
    authority = Authority()
    dut = bench()
    rng = np.random.default_rng(5)
    weights, commands = [1.0], [np.zeros(2)]
    for _ in range(300):
        confidence = rng.choice([0.0, 0.4, 1.0, math.nan])
        human, agent = rng.uniform(-12, 12, (2, 2))
        (weight,), (command,) = dut.run(human, agent, confidence)
        # Between the command before and both commands, each wheel: it goes beyond none of them.
        corners = np.stack([commands[-1], human, agent])
        assert np.all(command >= corners.min(axis=0) - 1e-9)
        assert np.all(command <= corners.max(axis=0) + 1e-9)
        weights.append(weight)
        commands.append(command)
    assert np.abs(np.diff(weights)).max() <= authority.weight_rate * PERIOD + 1e-12
    assert np.abs(np.diff(commands, axis=0)).max() <= authority.command_rate * PERIOD + 1e-9
    assert min(weights) >= authority.floor


def test_a_command_that_lasts_is_reached_and_then_is_the_blend_to_the_bit(bench):
    _, commands = bench(**FREE | {"command_rate": 40.0}).run([6.0, 3.0], [6.0, 3.0], 0.25, 5)
    np.testing.assert_allclose(commands[:2], [[2.0, 1.0], [4.0, 2.0]])
    np.testing.assert_array_equal(commands[3], 0.75 * np.array([6.0, 3.0]) + 0.25 * np.array([6.0, 3.0]))


def test_without_a_command_of_the_agent_the_human_drives_at_once_and_without_a_jump(bench):
    dut = bench()
    dut.run(AHEAD, AHEAD, 1.0, 20)
    (weight,), (command,) = dut.run([12.0, 12.0], [math.nan, 1.0], 1.0)
    assert weight == 1.0
    np.testing.assert_allclose(command, [8.0, 8.0])


def test_hands_off_brings_the_robot_to_rest(bench):
    dut = bench()
    dut.run(AHEAD, AHEAD, 1.0, 40)
    weights, commands = dut.run([0.0, 0.0], AHEAD, 1.0, 40)
    assert commands[18, 0] > 5.0  # 0.95 s
    np.testing.assert_array_equal(commands[19 + 14 :], 0.0)  # 1.0 s and 0.7 s
    assert np.all(np.diff(commands[19:, 0]) <= 0.0)
    assert np.all(np.diff(weights[19:]) <= PERIOD / 0.7 + 1e-12)


def test_where_events_are_known_a_hand_that_rests_on_the_controls_is_no_hand_off(bench):
    dut = bench()
    dut.run(AHEAD, AHEAD, 1.0, 40, idle=9.0)
    assert dut.run([0.0, 0.0], AHEAD, 1.0, 60, idle=0.2)[0][-1] == pytest.approx(0.1)
    assert dut.run(AHEAD, AHEAD, 1.0, 60, idle=9.0)[0][-1] == pytest.approx(0.1)
    assert dut.run([0.0, 0.0], AHEAD, 1.0, 60, idle=1.0)[0][-1] == 1.0


def test_nothing_lags_and_evaluation_changes_nothing(bench):
    dut = bench(floor=0.0)
    dut.run(AHEAD, AHEAD, 1.0, 10)
    for name, value in (("human_command", AHEAD), ("autonomous_command", AHEAD), ("confidence", [0.1])):
        dut.dut.GetInputPort(name).FixValue(dut.context, value)
    seen = [dut.dut.GetOutputPort("human_weight").Eval(dut.context).item() for _ in range(3)]
    assert seen == pytest.approx([0.2, 0.2, 0.2])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"floor": -0.1}, "floor"),
        ({"floor": 1.1}, "floor"),
        ({"floor": math.nan}, "floor"),
        ({"floor": None}, "floor"),
        ({"floor": True}, "floor"),
        ({"conflict_time": 0.0}, "conflict_time"),
        ({"conflict_time": math.inf}, "conflict_time"),
        ({"conflict_angle": 4.0}, "conflict_angle"),
        ({"conflict_angle": 0.3, "agreement_angle": 0.4}, "agreement_angle"),
        ({"release_time": 0.1}, "release_time"),
        ({"stop_time": 0.2}, "stop_time"),
        ({"weight_rate": "fast"}, "weight_rate"),
        ({"command_rate": -1.0}, "command_rate"),
    ],
)
def test_numbers_that_make_no_sense_are_refused(given, said):
    with pytest.raises(InputError, match=f"authority: {said}"):
        Authority(**given)


def test_a_log_holds_the_parameters_of_an_enabled_authority_and_none_of_a_disabled_one():
    kept = Authority(floor=0.3).to_json()
    assert kept is not None
    assert kept["floor"] == 0.3
    assert set(kept) == {field.name for field in dataclasses.fields(Authority)} - {"enabled"}
    assert Authority(enabled=False).to_json() is None


@pytest.mark.parametrize(
    "given",
    [
        {"floor": 0.0},
        {"floor": 1.0},
        {"conflict_angle": math.pi},
        {"conflict_angle": 0.5, "agreement_angle": 0.5},
        {"weight_rate": 2.0, "release_time": 0.5, "stop_time": 0.5},
    ],
)
def test_values_at_the_limits_are_accepted(given):
    assert dataclasses.asdict(Authority(**given)).items() >= given.items()


def test_the_preset_names_the_config(scenario):
    for preset, arbiter in (("default", "fusion"), ("paper", "blend")):
        learner = load_learner(models_directory() / "learners" / f"two_obstacles_{preset}.safetensors")
        parts = Simulation(scenario, learner=learner).parts
        assert parts.config == config_for(preset)
        assert parts.arbitration["name"] == arbiter
    assert parts.arbitration["configuration"] == {"authority": None}


@pytest.mark.parametrize(
    "arguments", [("--driver", "agent"), ("--arbitration", "traded"), ("--driver", "human")]
)
def test_a_floor_contradicts_someone_alone_and_other_arbiters(capsys, arguments):
    assert main(["simulate", "--authority.floor", "0.5", *arguments]) == 2
    assert "--authority " in capsys.readouterr().err


def test_simulate_writes_the_whole_configuration(capsys, tmp_path):
    arguments = ["simulate", "--authority.floor", "0.3", "--json", "--out", str(tmp_path)]
    assert main(arguments) == 0
    (row,) = json.loads(capsys.readouterr().out)["trials"]
    trial = read_log(row["log"])
    told = trial.metadata["arbitration"]["configuration"]["authority"]
    assert told == Authority(floor=0.3).to_json()
    assert trial["human_weight"].min() == pytest.approx(0.3)


@pytest.fixture(scope="module")
def shipped():
    return load_learner(models_directory() / "learners" / "two_obstacles_default.safetensors")


def test_someone_who_looks_away_and_comes_back_still_arrives(scenario, shipped):
    simulation = Simulation(scenario, learner=shipped)
    for seed, route in enumerate(scenario.routes):
        behaviour = Behaviour(pause_time=4.0, pause=2.5)
        trial = simulation.run(TrialSettings(seed=seed, route=route.name, behaviour=behaviour))
        assert metrics(trial)["intent_success"]
        speed = np.hypot(*np.diff(trial.positions, axis=0).T) / PERIOD
        assert speed[int(5.9 / PERIOD) : int(6.3 / PERIOD)].max() < 0.05


def test_nobody_at_the_controls_gets_nowhere(scenario, shipped):
    trial = Simulation(scenario, learner=shipped, operator=RecordedInput()).run(TrialSettings())
    assert trial.status == "timed_out"
    assert np.all(trial.commands("shared")[40:] == 0.0)


class RestingHand(LeafSystem):
    """Someone who gives nothing, and last touched the controls ``idle`` s ago."""

    def __init__(self, idle: float):
        super().__init__()
        self.DeclareStateOutputPort("human_command", self.DeclareDiscreteState(2))
        self.DeclareStateOutputPort("idle_time", self.DeclareDiscreteState([idle]))


@pytest.mark.parametrize(("idle", "status"), [(0.5, "reached"), (2.0, "timed_out")])
def test_an_operator_with_events_is_asked_for_them(scenario, route_learner, idle, status):
    learner = route_learner(scenario, variance=1e-5)
    simulation = Simulation(scenario, learner=learner, operator=RestingHand(idle))
    trial = simulation.run(TrialSettings())
    assert trial.status == status
    assert trial["human_weight"].min() == pytest.approx(0.1 if idle < 1.0 else 1.0)


def test_an_agent_sure_of_another_way_does_not_get_its_way(scenario, route_learner):
    """It expects the left side with all its heart, and the human means the right."""
    learner = route_learner(scenario, "left_left", variance=1e-5, clock="progress")
    results = {}
    for authority in (Authority(enabled=False), Authority()):
        simulation = Simulation(scenario, learner=learner, config=SharedControlConfig(authority=authority))
        results[authority.enabled] = metrics(simulation.run(TrialSettings(route="left_right", seed=2)))
    assert not results[False]["intent_success"]
    assert results[True]["intent_success"]
