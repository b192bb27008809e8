"""DynamicPlant compared with the kinematic plant, with obstacles, and in a whole trial."""

import copy
import dataclasses
import math

import numpy as np
import pytest
from pydrake.geometry import SceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_shared.analysis.replay import write_replay
from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.learners import load_learner
from drake_shared.robots import DiffDrive
from drake_shared.scenario import Start, load_scenario
from drake_shared.scenario.obstacles import Box, Circle, position_at, register_obstacles
from drake_shared.simulation.trial import Simulation, TrialSettings, read_log, write_log
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.dynamic_plant import DynamicPlant

ROBOT = DiffDrive()
FOOTPRINT = ROBOT.footprint_radius
PILLAR = Circle(name="pillar", x=1.0, y=0.0, radius=0.25)
WALL = Box(name="wall", x=1.0, y=0.0, length=0.2, width=3.0)


class Bench:
    """A plant, obstacles, and the plant's Context."""

    def __init__(self, obstacles=(), **options):
        builder = DiagramBuilder()
        scene_graph = builder.AddSystem(SceneGraph())
        register_obstacles(scene_graph, list(obstacles))
        self.dut = builder.AddSystem(DynamicPlant(robot=ROBOT, obstacles=obstacles, **options))
        builder.Connect(scene_graph.get_query_output_port(), self.dut.GetInputPort("geometry_query"))
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.dut.GetMyMutableContextFromRoot(self.root)

    def step(self, command, *, count: int = 1) -> "Bench":
        drive(self.dut, self.context, np.tile(command, (count, 1)))
        return self

    def __getattr__(self, port: str) -> np.ndarray:
        return self.dut.GetOutputPort(port).Eval(self.context).copy()


def drive(dut, context, commands: np.ndarray) -> np.ndarray:
    """Poses (n, 3) after each of the ``commands`` (n, 2), one per period."""
    poses = []
    for command in commands:
        dut.GetInputPort("wheel_command").FixValue(context, command)
        context.get_mutable_discrete_state().SetFrom(dut.EvalUniquePeriodicDiscreteUpdate(context))
        poses.append(dut.GetOutputPort("pose").Eval(context).copy())
    return np.array(poses)


def both_paths(start: Start, commands: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses (n, 3) of the kinematic and the dynamic robot for the same commands."""
    plants = (DiffDrivePlant(robot=ROBOT, start=start), DynamicPlant(robot=ROBOT, start=start))
    kinematic, dynamic = (drive(dut, dut.CreateDefaultContext(), commands) for dut in plants)
    return kinematic, dynamic


def test_has_the_ports_of_the_kinematic_plant():
    kinematic, dynamic = DiffDrivePlant(robot=ROBOT), DynamicPlant(robot=ROBOT)
    for count, port in (("num_input_ports", "get_input_port"), ("num_output_ports", "get_output_port")):
        ports = [
            [(getattr(dut, port)(i).get_name(), getattr(dut, port)(i).get_data_type()) for i in range(n)]
            for dut, n in ((kinematic, getattr(kinematic, count)()), (dynamic, getattr(dynamic, count)()))
        ]
        assert ports[0] == ports[1]


@pytest.mark.parametrize("wheels", [(7.0, 7.0), (12.3, 12.3), (4.1, 6.1), (-5.0, -4.0), (-2.0, 2.0)])
def test_the_position_stays_within_2_cm_of_the_kinematic_robot_over_15_s(wheels):
    commands = np.tile(wheels, (300, 1))
    commands[280:] = 0.0
    kinematic, dynamic = both_paths(Start(x=0.3, y=-0.2, yaw=0.7), commands)
    assert np.hypot(*(kinematic - dynamic)[:, :2].T).max() < 0.02
    np.testing.assert_allclose(dynamic[:, 2], kinematic[:, 2], rtol=0, atol=0.02)


@pytest.mark.parametrize("task", ["two_obstacles", "three_obstacles", "doorway"])
def test_the_position_stays_within_2_cm_of_the_kinematic_robot_for_an_operators_commands(task):
    scenario = load_scenario(task)
    simulation = Simulation(scenario)
    for route in scenario.routes:
        trial = simulation.run(TrialSettings(route=route.name, seed=1))
        kinematic, dynamic = both_paths(scenario.start, trial.commands("human")[:-1])
        np.testing.assert_allclose(kinematic[:, :2], trial.positions[1:], rtol=0, atol=1e-9)
        assert np.hypot(*(kinematic - dynamic)[:, :2].T).max() < 0.02, route.name


def test_wheels_slip_if_the_command_needs_more_than_friction():
    """Friction of 0.8 limits the acceleration to 0.8 g."""
    sudden = DiffDrive(max_acceleration=1e6)
    dut = DynamicPlant(robot=sudden)
    pose = drive(dut, context := dut.CreateDefaultContext(), np.full((2, 2), 12.0))[-1]
    assert 0 < pose[0] < 0.5 * 0.8 * 9.81 * 0.1**2
    assert dut.GetOutputPort("wheel_speed").Eval(context)[0] > 4.0


def test_stands_still_without_a_finite_command():
    bench = Bench(start=Start(x=0.4, y=-0.3, yaw=2.0)).step([math.nan, 0.0], count=40)
    np.testing.assert_allclose(bench.pose, [0.4, -0.3, 2.0], rtol=0, atol=1e-5)
    np.testing.assert_allclose(bench.wheel_speed, 0, atol=1e-5)


def test_yaw_is_not_wrapped():
    assert Bench().step([-4.0, 4.0], count=200).pose[2] > 4 * math.pi


@pytest.mark.parametrize("obstacle", [PILLAR, WALL], ids=["pillar", "wall"])
def test_an_obstacle_stops_the_robot_which_can_back_away(obstacle):
    bench = Bench([obstacle]).step([5.0, 5.0], count=60)
    assert bench.contact == 1
    assert abs(bench.clearance[0]) < 1e-3
    bench.step([0.0, 0.0], count=10)
    # At rest the contact force does not push the robot away.
    assert abs(bench.clearance[0]) < 1e-3
    bench.step([-5.0, -5.0], count=20)
    assert bench.contact == 0
    assert bench.clearance > 0.2


def test_contact_is_reported_where_clearance_reaches_zero():
    bench = Bench([WALL], start=Start(yaw=0.3))
    seen = 0
    for _ in range(60):
        bench.step([4.0, 4.0])
        assert bench.clearance[0] > -2e-3
        if bench.contact:
            seen += 1
            assert bench.clearance[0] < 0.02
        else:
            assert bench.clearance[0] > -1e-4
    assert seen > 5


@pytest.mark.parametrize(
    ("shape", "reach"),
    [
        (Circle(name="cart", radius=0.2), 0.2),
        (Box(name="cart", length=0.3, width=0.3, yaw=math.pi / 4), 0.15 * math.sqrt(2)),
    ],
    ids=["pillar", "edge of a box"],
)
def test_an_obstacle_that_comes_head_on_pushes_the_robot_straight_back_at_its_own_speed(shape, reach):
    cart = dataclasses.replace(shape, x=0.8, y=0.0, path=[[0.0, 0.8, 0.0], [2.0, -0.2, 0.0]])
    dut = DynamicPlant(robot=ROBOT, obstacles=[cart])
    context = dut.CreateDefaultContext()
    for step in range(40):
        context.SetTime(0.05 * step)
        (pose,) = drive(dut, context, np.zeros((1, 2)))
        pushed_to = position_at(cart, 0.05 * (step + 1))[0] - reach - FOOTPRINT
        np.testing.assert_allclose(pose, [min(0.0, pushed_to), 0.0, 0.0], rtol=0, atol=2e-3)
        assert (dut.GetOutputPort("contact").Eval(context).item() > 0.5) == (pushed_to < 1e-4)


def test_a_turned_box_is_met_where_its_edge_is():
    box = Box(name="box", x=1.0, y=0.0, length=0.4, width=0.4, yaw=math.pi / 4)
    bench = Bench([box]).step([5.0, 5.0], count=40)
    np.testing.assert_allclose(
        bench.pose, [1.0 - 0.2 * math.sqrt(2) - FOOTPRINT, 0.0, 0.0], rtol=0, atol=2e-3
    )


def test_without_obstacles_clearance_is_infinite():
    dut = DynamicPlant(robot=ROBOT)
    assert dut.GetOutputPort("clearance").Eval(dut.CreateDefaultContext()) == math.inf


def test_the_motion_depends_on_the_context_alone():
    bench = Bench([WALL])
    commands = np.random.default_rng(4).uniform(-3.0, 9.0, (30, 2))
    first = drive(bench.dut, bench.context, commands[:10])
    kept = bench.root.Clone()
    rest = drive(bench.dut, bench.context, commands[10:])
    again = drive(bench.dut, bench.dut.GetMyMutableContextFromRoot(kept), commands[10:])
    np.testing.assert_array_equal(again, rest)
    bench.dut.SetPose(bench.context, [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(drive(bench.dut, bench.context, commands[:10]), first)


@pytest.mark.parametrize("period", [0.02, 0.007, 0.004])
def test_every_period_gives_the_same_path(period):
    commands = np.tile([6.0, 7.0], (round(2 / period), 1))
    dynamic = DynamicPlant(robot=ROBOT, period=period)
    kinematic = DiffDrivePlant(robot=ROBOT, period=period)
    ends = [drive(dut, dut.CreateDefaultContext(), commands)[-1] for dut in (dynamic, kinematic)]
    np.testing.assert_allclose(*ends, rtol=0, atol=0.01)


@pytest.fixture(scope="module")
def dynamic_simulation() -> Simulation:
    scenario = copy.deepcopy(load_scenario("two_obstacles"))
    scenario.plant = "dynamic"
    learner = load_learner(models_directory() / "learners" / "two_obstacles_default.safetensors")
    return Simulation(scenario, learner=learner)


@pytest.mark.parametrize("route", ["left_right", "right_left", "left_left"])
def test_the_shipped_learner_shares_the_control(dynamic_simulation, route):
    trial = dynamic_simulation.run(TrialSettings(route=route, seed=2))
    assert trial.status == "reached"
    assert not trial["contact"].any()
    assert trial["clearance"].min() > 0.05
    assert trial["human_weight"].min() < 0.9


def test_a_log_names_the_plant_and_can_be_replayed(dynamic_simulation, tmp_path):
    assert isinstance(dynamic_simulation.parts.plant, DynamicPlant)
    assert not dynamic_simulation.diagram.HasAnyDirectFeedthrough()
    running = dynamic_simulation.begin(TrialSettings(route="left_right"))
    running.advance(1.0)
    write_log(running.finish(), tmp_path / "log.parquet")
    trial = read_log(tmp_path / "log.parquet")
    assert trial.metadata["scenario"]["plant"] == "dynamic"
    write_replay(trial, tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size > 1e5


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"left_axle"', '"larboard"', "must have its wheels on revolute joints left_axle and right_axle"),
        ('"right_axle" type="revolute"', '"right_axle" type="fixed"', "must have its wheels on revolute"),
        ("0 0.165 0.0975", "0 0.2 0.0975", "left_axle must lie at [0.000, 0.165, 0.098]"),
        ("<effort>5", "<effort>0", "left_axle must have an effort limit above 0"),
        ("</model>", "", "must be an SDF file with one model"),
    ],
)
def test_an_sdf_file_without_its_wheels_is_refused(tmp_path, old, new, message):
    text = (models_directory() / "robots" / "pioneer_p3dx.sdf").read_text()
    assert old in text
    (tmp_path / "robot.sdf").write_text(text.replace(old, new))
    with pytest.raises(InputError) as caught:
        DynamicPlant(robot=DiffDrive(model=str(tmp_path / "robot.sdf")))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
