"""The contract of robots, their descriptions in logs, and how lengths scale."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.robots import (
    DiffDrive,
    Robot,
    check_robot,
    describe_robot,
    described_robot,
    scaled_length,
)
from drake_shared.robots.motion import motion
from drake_shared.robots.pose import pose_to_transform

ROBOT = DiffDrive()


def test_the_differential_drive_is_a_robot():
    assert isinstance(ROBOT, Robot)
    check_robot(ROBOT)


def test_lengths_scale_with_the_footprint():
    assert scaled_length(ROBOT, 0.05) == 0.05
    assert scaled_length(DiffDrive(footprint_radius=2.67), 0.05) == pytest.approx(0.5)


@pytest.mark.parametrize("field", ["track", "wheel_radius", "footprint_radius", "max_speed"])
@pytest.mark.parametrize("value", [-1.0, 0.0, float("nan"), float("inf")])
def test_a_size_out_of_range_is_refused(field, value):
    with pytest.raises(InputError) as caught:
        DiffDrive(**{field: value})
    assert caught.value.field == field


class Half(DiffDrive):
    command_units = ("rad/s",)


class Nameless(DiffDrive):
    position_names = ()


class Endless(DiffDrive):
    command_limits = (1.0, float("inf"))


@pytest.mark.parametrize(
    ("robot", "field"),
    [(None, ""), (3, ""), (Half(), "command_units"), (Nameless(), "position"), (Endless(), "command_limits")],
)
def test_what_breaks_the_contract_is_refused(robot, field):
    with pytest.raises(InputError) as caught:
        check_robot(robot)
    assert field in caught.value.field


@pytest.mark.parametrize(
    ("function", "result"),
    [
        ("position", (0.0, 0.0, 0.0)),
        ("position", (np.nan, 0.0)),
        ("rollout", (0.0,)),
        ("rollout", None),
        ("command_toward", (1.0, 1.0, 1.0)),
        ("stick_command", (1.0, np.inf)),
        ("speed", "fast"),
        ("conflict_angle", (0.1, 0.2)),
    ],
)
def test_a_function_that_returns_something_else_is_refused(function, result):
    kind = type("Other", (DiffDrive,), {function: lambda *_, **__: result})
    with pytest.raises(InputError) as caught:
        check_robot(kind())
    assert function in caught.value.field


@pytest.mark.parametrize("function", ["position", "speed", "conflict_angle"])
def test_a_function_that_fails_is_refused(function):
    kind = type("Failing", (DiffDrive,), {function: lambda *_: 1 / 0})
    with pytest.raises(InputError, match="ZeroDivisionError") as caught:
        check_robot(kind())
    assert function in caught.value.field


@pytest.mark.parametrize("command", [(4.0, 6.0), (5.0, 5.0), (-3.0, 1.0)])
def test_a_rollout_ends_where_the_robot_drives(command):
    pose = (1.0, -2.0, 0.4)
    *_, end = motion(ROBOT, pose, command, command, 0.8)
    assert ROBOT.rollout(pose, command, 0.8) == pytest.approx(end[:2], abs=1e-9)


def test_conflict_angles_by_hand():
    forward, back = ROBOT.wheel_speeds(0.5, 0.0), ROBOT.wheel_speeds(-0.5, 0.0)
    left = ROBOT.wheel_speeds(0.0, 1.0)
    assert ROBOT.conflict_angle(forward, forward) == pytest.approx(0.0)
    assert ROBOT.conflict_angle(forward, back) == pytest.approx(np.pi)
    assert ROBOT.conflict_angle(forward, left) == pytest.approx(np.pi / 2)
    assert np.isnan(ROBOT.conflict_angle(forward, (0.0, 0.0)))


def test_a_stick_forward_is_speed_and_to_the_left_is_yaw_rate():
    assert ROBOT.twist(*ROBOT.stick_command(0.5, 0.0, max_speed=0.8, max_yaw_rate=1.5)) == pytest.approx(
        (0.4, 0.0)
    )
    assert ROBOT.twist(*ROBOT.stick_command(0.0, -1.0, max_speed=0.8, max_yaw_rate=1.5)) == pytest.approx(
        (0.0, -1.5)
    )


def test_a_description_survives_its_json():
    description = describe_robot(ROBOT)
    assert described_robot({"robot": description.to_json()}) == description
    assert description.columns("human") == ("human_left", "human_right")


def test_a_log_without_a_description_is_that_of_a_differential_drive():
    slow = DiffDrive(max_speed=0.5)
    metadata = {"scenario": {"robot": dataclasses.asdict(slow)}}
    assert described_robot(metadata) == describe_robot(slow)


@pytest.mark.parametrize(
    ("metadata", "field"),
    [
        ({"scenario": 3}, "scenario.robot"),
        ({"scenario": {"robot": {"legs": 4}}}, "scenario.robot"),
        ({"robot": {"type": "PointRobot"}}, "robot"),
        ({"robot": 3}, "robot"),
    ],
)
def test_a_broken_description_is_refused(metadata, field):
    with pytest.raises(InputError) as caught:
        described_robot(metadata)
    assert caught.value.field == field


def test_a_pose_on_the_floor_as_a_transform():
    X_WB = pose_to_transform((1.0, 2.0, np.pi / 2))
    np.testing.assert_allclose(X_WB.multiply([1.0, 0.0, 0.5]), [1.0, 3.0, 0.5], atol=1e-12)
