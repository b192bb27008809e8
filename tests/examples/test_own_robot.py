"""A point robot with D = 3 and M = 3 in whole trials: every part takes names and sizes from the robot."""

import math
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from drake_shared.analysis.metrics import metrics
from drake_shared.arbitration.authority import Authority
from drake_shared.cli.main import main
from drake_shared.common.errors import InputError
from drake_shared.robots import check_robot
from drake_shared.scenario import Goal, Scenario, Workspace
from drake_shared.simulation import (
    Faults,
    SharedControlConfig,
    Simulation,
    TrialSettings,
    read_log,
)
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.robots import make_robot

AXES = ("x", "y", "z")


@pytest.fixture
def own_robot(example):
    return example("own_robot")


@pytest.fixture
def robot(own_robot):
    return own_robot.PointRobot()


def fly(own_robot, robot, operator, **options):
    """A trial with the operator, over the middle of the way."""
    simulation = own_robot.make_simulation(robot, "over")
    return Simulation(
        simulation.scenario,
        robot=robot,
        plant=own_robot.PointPlant([0.0, 0.0, 1.0]),
        operator=operator,
        learner=simulation.learner,
        **options,
    )


def test_the_robot_fulfils_its_contract(robot):
    check_robot(robot)


@pytest.mark.parametrize("route", ["over", "left"])
def test_shared_control_flies_the_route_that_the_operator_means(own_robot, robot, route):
    trial = own_robot.make_simulation(robot, route).run(TrialSettings())
    assert trial.status == "reached"
    assert trial.positions.shape == (len(trial["t"]), 3)
    assert trial.commands("shared").shape == (len(trial["t"]), 3)
    waypoint = own_robot.ROUTES[route][2]
    assert np.linalg.norm(trial.positions - waypoint, axis=1).min() < 0.3
    assert trial["human_weight"].min() < 0.5
    assert trial["moved_by_command"].max() > 0.0


def test_the_log_names_its_columns_after_the_robot_and_is_read_back(own_robot, tmp_path):
    file = tmp_path / "flight.parquet"
    trial = own_robot.main(str(file))
    back = read_log(file)
    assert set(back.columns) >= {
        *AXES,
        *[f"{who}_v{axis}" for who in ("human", "autonomous", "shared") for axis in AXES],
        *[f"speed_{axis}" for axis in AXES],
    }
    assert back.robot == trial.robot
    assert back.robot.command_units == ("m/s", "m/s", "m/s")
    np.testing.assert_array_equal(back.positions, trial.positions)
    result = metrics(back)
    assert result["success"]
    assert result["path_length"] > 4.0
    assert math.isfinite(result["completion_time"])


def test_recorded_commands_give_the_same_flight(own_robot, robot):
    # With an authority the agent waits until a live operator has given a command.
    config = SharedControlConfig(authority=Authority(enabled=False))
    operator = own_robot.PointOperator(robot, own_robot.ROUTES["over"])
    first = fly(own_robot, robot, operator, config=config).run(TrialSettings())
    settings = TrialSettings(recording=first.commands("human"))
    again = fly(own_robot, robot, RecordedInput(robot=robot), config=config).run(settings)
    np.testing.assert_array_equal(again.positions, first.positions)


def test_every_fault_and_arbiter_takes_the_robots_sizes(own_robot, robot):
    faults = Faults(
        delay=0.1, jitter=0.05, loss=0.1, pose_noise=0.01, pose_drift=0.01, pose_nan=0.05, late_learner=0.1,
        learner_nan=0.05, slip=0.1,
    )  # fmt: skip
    for arbitration in ("blend", "halves", "traded"):
        operator = own_robot.PointOperator(robot, own_robot.ROUTES["over"])
        config = SharedControlConfig(arbitration=arbitration, faults=faults)
        trial = fly(own_robot, robot, operator, config=config).run(TrialSettings(seed=1))
        assert np.isfinite(trial.commands("shared")).all()
        assert {"received_vx", "seen_z", "slipped_vy"} <= set(trial.columns)


@pytest.fixture
def registered(own_robot, monkeypatch):
    """The robot and its operator, as a package that is installed registers them."""
    points = [
        EntryPoint("point", "own_robot:make_robot", "drake_shared.robots"),
        EntryPoint("broken", "own_robot:path_positions", "drake_shared.robots"),
        EntryPoint("point-pilot", "own_robot:make_operator", "drake_shared.operators"),
    ]
    monkeypatch.setattr(
        "drake_shared.common.entry_points.entry_points",
        lambda *, group: [point for point in points if point.group == group],
    )


@pytest.mark.usefixtures("registered")
def test_a_registered_robot_flies_by_its_name(tmp_path):
    words = ["simulate", "--driver", "human", "--robot", "point", "--operator", "point-pilot"]
    assert main([*words, "--scenario", "two_obstacles", "--out", str(tmp_path)]) == 0
    (log,) = tmp_path.glob("*.parquet")
    trial = read_log(log)
    assert trial.robot.type == "PointRobot"
    assert np.linalg.norm(trial.positions[-1] - [4.0, 0.0, 1.0]) < 0.1


@pytest.mark.usefixtures("registered")
def test_a_registered_robot_that_cannot_fly_is_refused_by_name(scenario):
    for name in ("broken", "pint"):
        with pytest.raises(InputError, match=name):
            make_robot(name, scenario=scenario)
    with pytest.raises(InputError, match="operator"):
        Simulation(scenario, robot=make_robot("point", scenario=scenario)[0])


def test_without_a_learner_the_human_flies_alone(own_robot, robot):
    simulation = own_robot.make_simulation(robot, "over")
    operator = own_robot.PointOperator(robot, own_robot.ROUTES["over"])
    plant = own_robot.PointPlant([0.0, 0.0, 1.0])
    alone = Simulation(simulation.scenario, robot=robot, plant=plant, operator=operator)
    trial = alone.run(TrialSettings())
    assert trial.status == "reached"
    assert (trial["human_weight"] == 1.0).all()


def test_a_plant_or_an_operator_of_another_size_is_refused(own_robot, robot):
    scenario = Scenario(
        name="flight",
        goal=Goal(x=4.0, y=0.0),
        workspace=Workspace(x_min=-1.0, x_max=5.0, y_min=-2.0, y_max=2.0),
    )
    operator = own_robot.PointOperator(robot, own_robot.ROUTES["over"])
    with pytest.raises(InputError, match="PointOperator"):
        Simulation(scenario, operator=operator)
    with pytest.raises(InputError, match="PointPlant"):
        Simulation(scenario, operator=RecordedInput(), plant=own_robot.PointPlant([0.0, 0.0, 1.0]))
    with pytest.raises(InputError, match="PointRobot"):
        Simulation(scenario, robot=robot, operator=operator)
