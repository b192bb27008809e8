"""Whole trials of an arm: the same loop, with tip velocities."""

import dataclasses

import numpy as np
import pytest

from drake_shared.analysis.metrics import metrics
from drake_shared.arbitration.authority import Authority
from drake_shared.common.files import models_directory
from drake_shared.demonstrations import read_demonstrations
from drake_shared.learners import load_learner
from drake_shared.operators.named import ARM_OPERATORS, OPERATORS, operators_for
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import SharedControlConfig, config_for_robot
from drake_shared.simulation.log import read_log, write_log
from drake_shared.simulation.trial import Simulation, TrialSettings

CUPS = load_scenario("table_three_cups")


@pytest.fixture(scope="module")
def alone() -> Simulation:
    return Simulation(CUPS)


@pytest.mark.parametrize("route", [route.name for route in CUPS.routes])
def test_a_steady_operator_reaches_the_cup_that_is_meant(alone, route):
    trial = alone.run(TrialSettings(route=route))
    found = metrics(trial)
    assert found["intent_success"]
    assert found["wrong_goal"] is False
    assert trial["clearance"].min() > 0.02
    assert np.linalg.norm(trial.commands("human"), axis=1).max() <= CUPS.robot.max_speed + 1e-9


def test_the_cup_that_is_not_meant_is_the_wrong_goal(alone):
    trial = alone.run(TrialSettings(route="left"))
    meant = dataclasses.replace(trial, metadata={**trial.metadata, "route": "right"})
    found = metrics(meant)
    assert (found["success"], found["wrong_goal"], found["intent_success"]) == (True, True, False)


def test_a_log_holds_tip_joints_and_planes_and_is_read_back(alone, tmp_path):
    trial = alone.run(TrialSettings(route="over"))
    write_log(trial, tmp_path / "log.parquet")
    read = read_log(tmp_path / "log.parquet")
    assert read.robot == trial.robot
    assert read.positions.shape == (len(trial["t"]), 3)
    np.testing.assert_array_equal(read["joint_4"], trial["joint_4"])
    assert not read["plane_switches"].any()


def test_an_operator_who_switches_planes_moves_one_at_a_time(alone):
    behaviour = dataclasses.replace(ARM_OPERATORS["switches-planes"].behaviour, noise=0.01)
    trial = alone.run(TrialSettings(route="left", behaviour=behaviour))
    assert trial.status == "reached"
    assert metrics(trial)["plane_switches"] == trial["plane_switches"][-1] >= 1
    across = np.where(trial["plane"] == 0.0, trial["human_vz"], trial["human_vx"])
    # A command is that of the plane in which it began.
    assert not across[np.flatnonzero(np.diff(trial["plane"], prepend=0.0) == 0.0)].any()


def test_the_unsteady_operator_touches_nothing_with_a_clearance():
    careful = Simulation(CUPS, config=SharedControlConfig(driver="human", safety_clearance=0.015))
    trial = careful.run(TrialSettings(route="over", seed=1, behaviour=ARM_OPERATORS["unsteady"].behaviour))
    assert not trial["contact"].any()
    assert trial["clearance"].min() >= 0.0145


def test_the_same_seed_gives_the_same_trial(alone):
    settings = TrialSettings(route="right", seed=3)
    one, other = alone.run(settings), alone.run(settings)
    np.testing.assert_array_equal(one.positions, other.positions)


def test_each_robot_has_operators_of_its_own():
    assert operators_for(CUPS.robot) is ARM_OPERATORS
    assert operators_for(load_scenario().robot) is OPERATORS
    assert not set(ARM_OPERATORS) & set(OPERATORS)


@pytest.mark.parametrize("route", ["left", "right"])
def test_the_shipped_learner_is_sure_after_the_fork_alone(route):
    """Standard deviations above the fork are at least five times those below it."""
    learner = load_learner("table_three_cups")
    demonstrations = read_demonstrations(models_directory() / "demonstrations" / "table_three_cups.parquet")
    item = next(item for item in demonstrations if item.provenance["route"] == route)

    def sigma(height: float) -> float:
        row = int(np.argmax(item.positions[:, 2] < height))
        later = learner.grid[learner.grid > item.times[row]]
        _, variance = learner.predict(item.times[row : row + 1], item.positions[row : row + 1], later)
        return float(np.sqrt(variance.mean()))

    assert min(map(sigma, (0.58, 0.52, 0.46))) > 5.0 * max(map(sigma, (0.33, 0.28, 0.22)))


def test_shared_control_brings_an_unsteady_operator_to_the_right_cup():
    shared = Simulation(CUPS, learner=load_learner("table_three_cups"))
    assert shared.config.authority.conflict_angle > 1.0
    behaviour = ARM_OPERATORS["unsteady"].behaviour
    for index, route in enumerate(("left", "over", "right")):
        trial = shared.run(TrialSettings(route=route, seed=100 + index, behaviour=behaviour))
        assert metrics(trial)["intent_success"]
        assert trial.metadata["config"]["authority"]["conflict_angle"] > 1.0


def test_an_authority_that_is_given_is_kept():
    config = SharedControlConfig(authority=Authority(conflict_angle=0.7))
    assert config_for_robot(config, CUPS.robot) == config
    assert config_for_robot(SharedControlConfig(), load_scenario().robot) == SharedControlConfig()
