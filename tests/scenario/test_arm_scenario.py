"""Scenarios of an arm: what it can do, and what a file may get wrong."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.robots import Arm, DiffDrive
from drake_shared.robots.arm_model import ArmModel
from drake_shared.scenario import clearance_scorer, load_scenario, scenario_from_dict
from drake_shared.scenario.arm_checks import distance_to_reach
from drake_shared.scenario.space_path import SpacePath

CUPS = load_scenario("table_three_cups")
TEXT = (models_directory() / "scenarios" / "table_three_cups.yaml").read_text(encoding="utf-8")


def test_the_three_cups_have_a_route_each():
    assert isinstance(CUPS.robot, Arm)
    assert [CUPS.goal_of(route).name for route in CUPS.routes] == ["left_cup", "middle_cup", "right_cup"]


def test_the_routes_part_below_the_start():
    """The first 19 cm lead straight down, so that nobody can tell them apart."""
    paths = np.stack([SpacePath(route.waypoints).points for route in CUPS.routes])
    high = paths[..., 2] > 0.45
    assert (np.linalg.norm(paths[..., :2] - [0.4, 0.0], axis=-1)[high] < 0.03).all()
    assert all(clearance_scorer(CUPS)(path) > 0.03 for path in paths)


def test_the_dictionary_of_a_log_gives_the_scenario_back():
    assert scenario_from_dict(json.loads(json.dumps(dataclasses.asdict(CUPS)))) == CUPS


def test_an_obstacle_with_a_height_can_be_passed_above():
    above = clearance_scorer(CUPS)(np.array([[0.54, 0.0, 0.35]]))
    assert above == pytest.approx(0.05, abs=1e-9)


def test_a_distance_out_of_reach_is_that_of_a_straight_arm():
    """Beyond its reach an arm that may turn its tip would miss a target by its distance less the reach."""
    model = ArmModel(Arm())
    assert distance_to_reach(model, np.array([0.66, 0.27, 0.15])) < 1e-3
    assert distance_to_reach(model, np.array([2.0, 0.0, 0.3])) > 2.0 - 0.9


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("robot: !Arm {}", "robot: !Arm {tip: hand}", "robot.tip"),
        ("robot: !Arm {}", "robot: !Arm {home: [0, 1.9, 0, 0, 0, 0, 0]}", "robot.home"),
        ("robot: !Arm {}", "robot: !Arm {home: [0, 0, 0, -3.0, 0, 1.8, 0]}", "robot.home"),
        ("robot: !Arm {}", "robot: !Arm {max_speed: 0.0}", "robot.max_speed"),
        ("robot: !Arm {}", "robot: !Leg {}", "robot"),
        ("z_max: 0.8", "z_max: 0.0", "workspace.z_max"),
        ("z_max: 0.8", "z_max: 0.5", "robot.home"),
        ("x_max: 0.85", "x_max: 0.7", "goals: middle_cup"),
        ("z: 0.15, radius: 0.03}\nroutes", "z: 0.79, radius: 0.03}\nroutes", "goals: right_cup"),
        ("[0.54, 0.0, 0.42]", "[0.54, 0.0]", "routes: over"),
        ("[0.54, 0.0, 0.42]", "[0.54, 0.0, 0.2]", "routes: over"),
        (
            "[[0.4, 0.0, 0.62], [0.4, 0.0, 0.43], [0.54",
            "[[0.4, 0.0, 0.5], [0.4, 0.0, 0.43], [0.54",
            "routes: over",
        ),
        ("[0.5, 0.25, 0.3], ", "[0.66, -0.27, 0.15], ", "routes: left"),
        ("height: 0.3", "height: -0.3", "obstacles[1].height"),
    ],
)
def test_a_task_that_the_arm_cannot_do_is_refused(tmp_path, old, new, field):
    assert old in TEXT
    file = tmp_path / "cups.yaml"
    file.write_text(TEXT.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_scenario(file)
    assert caught.value.field == field
    assert Path(caught.value.source) == file
    assert "\n" not in str(caught.value)


def test_the_targets_of_fitts_are_at_three_distances_and_of_two_sizes():
    scenario = load_scenario("table_fitts")
    start = np.array(scenario.routes[0].waypoints[0])
    targets = [scenario.goal_of(route) for route in scenario.routes]
    difficulties = [
        np.log2(np.linalg.norm(start - [goal.x, goal.y, goal.z]) / (2 * goal.radius) + 1) for goal in targets
    ]
    assert len({goal.radius for goal in targets}) == 2
    assert len(targets) == len(set(np.round(difficulties, 2))) == 6
    assert max(difficulties) > 2 * min(difficulties)


def test_what_needs_wheels_says_so():
    with pytest.raises(InputError) as caught:
        CUPS.path_of(CUPS.routes[0])
    assert caught.value.field == "robot"
    assert isinstance(load_scenario().diff_drive, DiffDrive)
