"""The kinematic arm: limits, clearance, tilt and contact under random pushes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from pydrake.geometry import SceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_shared.robots import Arm
from drake_shared.scenario import load_scenario
from drake_shared.scenario.obstacles import register_obstacles
from drake_shared.systems.arm_plant import CONTACT, AddArmGeometry, ArmPlant
from drake_shared.systems.plant import plant_ports

PERIOD = 0.05
KEPT = 0.015
CUPS = load_scenario("table_three_cups")
CHANGE = PERIOD * CUPS.robot.max_joint_acceleration


class Bench:
    """An arm over the table with the three cups, stepped by hand."""

    def __init__(self, *, robot: Arm | None = None, clearance: float | None = None, bounded: bool = True):
        builder = DiagramBuilder()
        scene_graph = builder.AddSystem(SceneGraph())
        register_obstacles(scene_graph, CUPS.obstacles)
        self.robot = robot or Arm()
        workspace = CUPS.workspace if bounded else None
        self.plant = builder.AddSystem(
            ArmPlant(
                robot=self.robot,
                scene_graph=scene_graph,
                period=PERIOD,
                clearance=clearance,
                workspace=workspace,
            )
        )
        AddArmGeometry(builder, scene_graph, self.plant)
        ports = plant_ports(self.plant, self.robot)
        builder.Connect(scene_graph.get_query_output_port(), ports.geometry_query)
        builder.ExportInput(ports.command, "command")
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)
        self.model = self.plant.model

    def reset(self, joints=None) -> None:
        self.plant.SetJointPositions(self.context, self.model.home if joints is None else joints)

    def push(self, velocity, steps: int = 1) -> None:
        self.diagram.get_input_port().FixValue(self.root, np.asarray(velocity, dtype=float))
        for _ in range(steps):
            update = self.diagram.EvalUniquePeriodicDiscreteUpdate(self.root)
            self.root.get_mutable_discrete_state().SetFrom(update)

    def value(self, port: str) -> np.ndarray:
        return self.plant.GetOutputPort(port).Eval(self.context)

    @property
    def tip(self) -> np.ndarray:
        return self.value("pose")[:3]

    @property
    def tilt(self) -> float:
        home, now = (
            self.model.tip_pose(q).rotation() for q in (self.model.home, self.value("joint_positions"))
        )
        return home.InvertAndCompose(now).ToAngleAxis().angle()


@pytest.fixture(scope="module")
def careful() -> Bench:
    return Bench(clearance=KEPT)


@pytest.fixture(scope="module")
def bold() -> Bench:
    return Bench()


pushes = st.lists(st.tuples(*[st.floats(-0.5, 0.5)] * 3, st.integers(1, 15)), min_size=1, max_size=8)


@settings(max_examples=25, deadline=None)
@given(pushes)
def test_limits_clearance_and_orientation_hold_whatever_is_commanded(careful, pushes):
    careful.reset()
    before = careful.value("speed").copy()
    for *velocity, steps in pushes:
        for _ in range(steps):
            careful.push(velocity)
            speed, joints = careful.value("speed").copy(), careful.value("joint_positions")
            assert np.abs(speed - before).max() <= CHANGE + 1e-6
            assert (np.abs(speed) <= careful.model.max_speed + 1e-6).all()
            assert (joints >= careful.model.lower - 1e-6).all()
            assert (joints <= careful.model.upper + 1e-6).all()
            assert careful.value("clearance")[0] >= KEPT - 5e-4
            assert careful.value("contact")[0] == 0.0
            assert careful.tilt <= math.radians(3.0)
            before = speed


@settings(max_examples=15, deadline=None)
@given(pushes)
def test_without_a_clearance_the_arm_stops_at_contact_and_never_passes_through(bold, pushes):
    bold.reset()
    for *velocity, steps in pushes:
        for _ in range(steps):
            bold.push(velocity)
            assert bold.value("clearance")[0] > 0.0
            assert (bold.value("contact")[0] > 0.5) == (bold.value("clearance")[0] < CONTACT)
            assert bold.tilt <= math.radians(3.0)


def test_a_push_onto_the_table_is_contact_and_the_arm_can_leave_it(bold):
    bold.reset()
    bold.push([0.0, 0.0, -0.25], steps=80)
    assert bold.value("contact")[0] == 1.0
    assert bold.tip[2] == pytest.approx(0.015, abs=CONTACT)  # the radius of the tip
    bold.push([0.0, 0.0, 0.25], steps=5)
    assert bold.value("contact")[0] == 0.0


@pytest.mark.parametrize("velocity", [(0.1, 0.0, 0.0), (0.0, -0.15, -0.1), (0.0, 0.0, -0.2)])
def test_in_the_open_the_tip_follows_the_command(careful, velocity):
    careful.reset()
    careful.push(velocity, steps=4)  # the joints speed up
    start = careful.tip.copy()
    careful.push(velocity, steps=10)
    # Joints are integrated by steps, and turn by some degrees in each.
    assert (careful.tip - start) / (10 * PERIOD) == pytest.approx(velocity, abs=5e-3)
    careful.push([0.0, 0.0, 0.0], steps=4)
    start = careful.tip.copy()
    careful.push([0.0, 0.0, 0.0], steps=40)
    assert careful.tip == pytest.approx(start, abs=1e-3)


def test_a_command_beyond_the_limit_keeps_its_direction(careful):
    careful.reset()
    careful.push([0.0, 3.0, -4.0], steps=6)
    start = careful.tip.copy()
    careful.push([0.0, 3.0, -4.0], steps=2)
    moved = (careful.tip - start) / (2 * PERIOD)
    assert moved == pytest.approx([0.0, 0.6 * 0.25, -0.8 * 0.25], abs=5e-3)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_command_that_is_not_finite_stops_the_arm(careful, value):
    careful.reset()
    careful.push([0.0, value, 0.1], steps=3)
    assert careful.value("joint_positions") == pytest.approx(careful.model.home, abs=1e-9)


def test_the_posture_returns_while_the_tip_rests(careful):
    """A turn of the elbow that the tip does not feel is undone."""
    careful.reset()
    careful.model.tip_pose(careful.model.home)
    unfelt = np.linalg.svd(careful.model.jacobian())[2][6]
    turned = careful.model.home + 0.15 * unfelt
    careful.reset(turned)
    start = careful.tip.copy()
    careful.push([0.0, 0.0, 0.0], steps=150)
    away = careful.value("joint_positions") - careful.model.home
    assert np.linalg.norm(away) < 0.5 * np.linalg.norm(turned - careful.model.home)
    assert careful.tip == pytest.approx(start, abs=5e-3)


def test_the_tip_stays_in_the_workspace(careful):
    careful.reset()
    careful.push([0.0, 0.25, 0.25], steps=100)
    assert careful.tip[1] <= CUPS.workspace.y_max + 1e-3
    assert careful.tip[2] <= CUPS.workspace.z_max + 1e-3


def test_an_arm_of_six_joints_keeps_them_too(six_joint_arm):
    bench = Bench(robot=six_joint_arm, clearance=KEPT)
    bench.push([0.0, 0.1, -0.1], steps=10)
    assert bench.tip[1] > 0.02
    random = np.random.default_rng(0)
    for _ in range(15):
        bench.push(random.uniform(-0.4, 0.4, 3), steps=10)
        assert bench.value("clearance")[0] >= KEPT - 5e-4
        assert bench.tilt <= math.radians(3.0)


def test_clearance_counts_the_arm_itself():
    """The stylus turned back to the forearm is near it, with every obstacle far away."""
    bench = Bench()
    bench.reset([0.0, 0.0, 0.0, 0.0, 0.0, 2.05, 0.0])
    assert bench.value("clearance")[0] < 0.15
