"""Arms as robots: the contract, and kinematics against Drake's."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from drake_shared.common.errors import InputError
from drake_shared.robots import Arm, check_robot
from drake_shared.robots.arm_model import ArmModel, rotation_vector

ARM = Arm()
MODEL = ArmModel(ARM)
velocities = st.tuples(*[st.floats(-1, 1)] * 3)


def test_an_arm_is_a_robot_of_three_positions_and_three_commands():
    check_robot(ARM)
    assert len(ARM.position_names) == len(ARM.command_names) == 3
    assert ARM.configuration_names == ("x", "y", "z", *(f"joint_{n}" for n in range(1, 8)))
    assert len(ARM.speed_names) == 7


@given(velocities, velocities)
def test_a_command_toward_a_target_is_within_the_limit_and_points_there(tip, target):
    command = np.array(ARM.command_toward((*tip, *ARM.home), target, 0.6))
    assert np.linalg.norm(command) <= ARM.max_speed + 1e-12
    offset = np.subtract(target, tip)
    assert command @ offset >= 0.0
    assert np.linalg.norm(np.cross(command, offset)) <= 1e-9


def test_a_target_is_reached_in_the_time_given():
    command = ARM.command_toward((0.4, 0.0, 0.6, *ARM.home), (0.4, 0.05, 0.6), 0.5)
    assert ARM.rollout((0.4, 0.0, 0.6, *ARM.home), command, 0.5) == pytest.approx((0.4, 0.05, 0.6))
    assert ARM.command_toward((0.4, 0.0, 0.6, *ARM.home), (0.4, 0.0, 0.6), 0.5) == (0.0, 0.0, 0.0)
    assert np.isnan(ARM.command_toward((0.4, 0.0, 0.6, *ARM.home), (math.nan, 0.0, 0.6), 0.5)).all()


def test_commands_conflict_by_the_angle_between_them():
    assert ARM.conflict_angle((0.1, 0.0, 0.0), (0.0, 0.0, 0.2)) == pytest.approx(math.pi / 2)
    assert ARM.conflict_angle((0.1, 0.0, 0.0), (-0.2, 0.0, 0.0)) == pytest.approx(math.pi)
    assert math.isnan(ARM.conflict_angle((0.1, 0.0, 0.0), (0.0, 0.0, 0.0)))


@pytest.mark.parametrize("field", ["max_speed", "max_joint_acceleration", "link_radius"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_limits_must_be_positive_and_finite(field, value):
    with pytest.raises(InputError) as caught:
        Arm(**{field: value})
    assert caught.value.field == field


@pytest.mark.parametrize("which", ["shipped", "six"])
def test_the_tip_is_where_drake_says_for_six_joints_and_for_seven(which, six_joint_arm):
    arm = ARM if which == "shipped" else six_joint_arm
    model = ArmModel(arm)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(arm.model_path()))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(arm.base))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    random = np.random.default_rng(0)
    for _ in range(20):
        joints = random.uniform(model.lower, model.upper)
        plant.SetPositions(context, joints)
        expected = plant.GetFrameByName(arm.tip).CalcPoseInWorld(context)
        assert model.tip_pose(joints).IsNearlyEqualTo(expected, 1e-12)


def test_the_joints_are_those_of_the_iiwa14():
    """Reach and limits of the data sheet: 820 mm from shoulder to wrist, 135 and 170 degrees and so on."""
    straight = MODEL.tip_pose(np.zeros(7)).translation()
    assert straight == pytest.approx([0.0, 0.0, 0.36 + 0.42 + 0.4 + 0.081 + 0.2], abs=1e-9)
    assert np.degrees(MODEL.upper) == pytest.approx([170, 120, 170, 120, 170, 120, 175], abs=1e-3)
    assert np.degrees(MODEL.max_speed) == pytest.approx([85, 85, 100, 75, 130, 135, 135], abs=1e-3)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_the_jacobian_is_the_derivative_of_the_tips_pose(seed):
    random = np.random.default_rng(seed)
    joints, speeds = random.uniform(MODEL.lower, MODEL.upper), random.normal(size=7)
    step = 1e-6
    before, after = (MODEL.tip_pose(joints + sign * step * speeds) for sign in (-1, 1))
    MODEL.tip_pose(joints)
    turned, moved = np.split(MODEL.jacobian() @ speeds, 2)
    assert (after.translation() - before.translation()) / (2 * step) == pytest.approx(moved, abs=1e-7)
    turn = rotation_vector(after.rotation().matrix() @ before.rotation().matrix().T)
    assert turn / (2 * step) == pytest.approx(turned, abs=1e-6)


def test_the_tip_at_home_is_the_start_of_the_cups():
    assert MODEL.tip_pose(MODEL.home).translation() == pytest.approx([0.4, 0.0, 0.62], abs=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "changes", "field"),
    [
        ("", "", {"tip": "hand"}, "tip"),
        ("", "", {"base": "foot"}, "base"),
        ("", "", {"base": "link3"}, "model"),
        ("", "", {"home": [0.0] * 6}, "home"),
        ("", "", {"home": [0.0] * 6 + [9.0]}, "home"),
        ("", "", {"model": "none.urdf"}, "model"),
        (' lower="-2.96706" upper="2.96706"', "", {}, "model"),
        (' velocity="1.48353"', "", {}, "model"),
        ('type="revolute"', 'type="prismatic"', {}, "model"),
        ('<sphere radius="0.015"/>', '<mesh filename="package://shop/tip.obj"/>', {}, "model"),
        ('<sphere radius="0.015"/>', '<mesh filename="missing.obj"/>', {}, "model"),
        ("</robot>", "", {}, "model"),
        ("", "", {"tip": "link3", "home": [0.0] * 3}, "model"),
    ],
)
def test_a_model_that_cannot_be_driven_is_refused(tmp_path, old, new, changes, field):
    text = ARM.model_path().read_text(encoding="utf-8").replace(old or "\0", new)
    file = tmp_path / "arm.urdf"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        ArmModel(dataclasses.replace(ARM, **{"model": str(file), **changes}))
    assert caught.value.field == f"robot.{field}"
    assert "\n" not in str(caught.value)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_no_point_of_the_arm_is_faster_than_its_levers_say(seed):
    random = np.random.default_rng(seed)
    joints, speeds = random.uniform(MODEL.lower, MODEL.upper), random.normal(size=7)
    plant, context = MODEL.plant, MODEL.plant.CreateDefaultContext()
    plant.SetPositions(context, joints)
    plant.SetVelocities(context, speeds)
    fastest = max(
        np.linalg.norm(plant.EvalBodySpatialVelocityInWorld(context, plant.get_body(index)).translational())
        for index in plant.GetBodyIndices(plant.GetModelInstanceByName("arm7"))
    )
    assert fastest <= MODEL.levers @ np.abs(speeds)
