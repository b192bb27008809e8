"""DiffDrivePlant alone, and with obstacles in a SceneGraph."""

import math

import numpy as np
import pytest
from pydrake.geometry import Box as BoxShape, GeometryInstance, ProximityProperties, Role, SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.framework import DiagramBuilder

from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.scenario import Start
from drake_shared.scenario.obstacles import Box, Circle, ObstacleDistance, register_obstacles
from drake_shared.systems.diff_drive_plant import DiffDrivePlant

ROBOT = DiffDrive()
FOOTPRINT = ROBOT.footprint_radius
# Its wheels reach the commanded speed immediately.
SUDDEN = DiffDrive(max_speed=1e3, max_acceleration=1e12)
TOUCHING = 2.1e-6


class Bench:
    """A plant, obstacles, and the plant's Context."""

    def __init__(self, obstacles=(), *, illustration=False, **options):
        builder = DiagramBuilder()
        self.scene_graph = builder.AddSystem(SceneGraph())
        register_obstacles(self.scene_graph, list(obstacles))
        scene_graph = self.scene_graph if illustration else None
        self.dut = builder.AddSystem(DiffDrivePlant(scene_graph=scene_graph, **options))
        builder.Connect(self.scene_graph.get_query_output_port(), self.dut.GetInputPort("geometry_query"))
        if illustration:
            builder.Connect(
                self.dut.GetOutputPort("geometry_pose"),
                self.scene_graph.get_source_pose_port(self.dut.source_id()),
            )
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.dut.GetMyMutableContextFromRoot(self.root)

    def step(self, command, *, count: int = 1) -> "Bench":
        self.dut.GetInputPort("wheel_command").FixValue(self.context, command)
        for _ in range(count):
            update = self.dut.EvalUniquePeriodicDiscreteUpdate(self.context)
            self.context.get_mutable_discrete_state().SetFrom(update)
        return self

    def at(self, *pose) -> "Bench":
        self.dut.SetPose(self.context, pose)
        return self

    def __getattr__(self, port: str) -> np.ndarray:
        return self.dut.GetOutputPort(port).Eval(self.context).copy()


def test_the_initial_state_is_the_start_at_rest():
    bench = Bench(robot=ROBOT, start=Start(x=1.0, y=-2.0, yaw=0.5))
    np.testing.assert_array_equal(bench.pose, [1.0, -2.0, 0.5])
    np.testing.assert_array_equal(bench.wheel_speed, [0, 0])
    assert bench.contact == 0


@pytest.mark.parametrize("wheels", [(5.0, 7.0), (8.0, 8.0), (-3.0, 3.0), (-6.0, -2.0), (12.0, 11.9999)])
def test_the_path_is_the_closed_form_arc_within_a_nanometre_over_15_s(wheels):
    bench = Bench(robot=SUDDEN, start=Start(x=0.2, y=-0.4, yaw=0.7), period=0.05).step(wheels, count=300)
    speed = 0.0975 * (wheels[0] + wheels[1]) / 2
    yaw_rate = 0.0975 * (wheels[1] - wheels[0]) / 0.33
    yaw = 0.7 + 15.0 * yaw_rate
    if yaw_rate == 0:
        x, y = 0.2 + 15 * speed * math.cos(0.7), -0.4 + 15 * speed * math.sin(0.7)
    else:
        radius = speed / yaw_rate
        x = 0.2 + radius * (math.sin(yaw) - math.sin(0.7))
        y = -0.4 - radius * (math.cos(yaw) - math.cos(0.7))
    np.testing.assert_allclose(bench.pose, [x, y, yaw], rtol=0, atol=1e-9)


def test_the_arc_does_not_depend_on_the_period():
    coarse = Bench(robot=ROBOT, period=0.5).step([7.0, 9.0], count=30)
    fine = Bench(robot=ROBOT, period=0.01).step([7.0, 9.0], count=1500)
    np.testing.assert_allclose(coarse.pose, fine.pose, rtol=0, atol=1e-9)


def test_wheel_acceleration_is_limited():
    bench = Bench(robot=ROBOT, period=0.05)
    change = 0.05 * ROBOT.max_wheel_acceleration
    for count in range(1, 6):
        np.testing.assert_allclose(bench.step([10.0, -10.0]).wheel_speed, [count * change, -count * change])


def test_wheel_speed_is_limited():
    bench = Bench(robot=ROBOT).step([1e6, -1e6], count=100)
    np.testing.assert_allclose(bench.wheel_speed, [ROBOT.max_wheel_speed, -ROBOT.max_wheel_speed])


def test_each_wheel_reaches_the_command_exactly():
    bench = Bench(robot=ROBOT).step([3.3, -1.7], count=20)
    np.testing.assert_array_equal(bench.wheel_speed, [3.3, -1.7])


@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_nan_or_infinite_counts_as_zero(nothing):
    bench = Bench(robot=ROBOT).step([nothing, 2.0], count=20)
    np.testing.assert_array_equal(bench.wheel_speed, [0.0, 2.0])
    assert np.isfinite(bench.pose).all()


def test_no_output_has_direct_feedthrough_from_the_command():
    dut = Bench(robot=ROBOT, illustration=True).dut
    command = dut.GetInputPort("wheel_command").get_index()
    for output in range(dut.num_output_ports()):
        assert not dut.HasDirectFeedthrough(command, output)


def test_geometry_pose_depends_on_no_input():
    dut = Bench(robot=ROBOT, illustration=True).dut
    assert not dut.HasDirectFeedthrough(dut.GetOutputPort("geometry_pose").get_index())
    lonely = dut.CreateDefaultContext()
    dut.SetPose(lonely, [1.0, 2.0, 0.5])
    X_WR = dut.GetOutputPort("geometry_pose").Eval(lonely).value(dut.frame_id())
    np.testing.assert_allclose(X_WR.translation(), [1.0, 2.0, 0.0])
    assert RollPitchYaw(X_WR.rotation()).yaw_angle() == pytest.approx(0.5)


def test_contexts_are_independent():
    bench = Bench(robot=ROBOT)
    other = bench.diagram.CreateDefaultContext()
    bench.step([5.0, 5.0], count=10)
    np.testing.assert_array_equal(
        bench.dut.GetOutputPort("pose").Eval(bench.dut.GetMyContextFromRoot(other)), [0, 0, 0]
    )


def test_without_obstacles_clearance_is_infinite():
    dut = DiffDrivePlant(robot=ROBOT)
    assert dut.GetOutputPort("clearance").Eval(dut.CreateDefaultContext()) == math.inf
    assert Bench(robot=ROBOT).clearance == math.inf


def test_clearance_to_a_circle_is_exact():
    bench = Bench([Circle(name="pillar", x=1.4, y=0.3, radius=0.25)], robot=ROBOT)
    for x, y in np.random.default_rng(3).uniform(-3, 3, (50, 2)):
        assert bench.at(x, y, 0.1).clearance == pytest.approx(
            math.hypot(x - 1.4, y - 0.3) - 0.25 - FOOTPRINT, abs=1e-12
        )


def test_clearance_to_a_box_is_exact_beside_its_faces_and_its_corners():
    bench = Bench([Box(name="crate", x=1.0, y=0.0, length=1.0, width=0.5)], robot=ROBOT)
    assert bench.at(-0.5, 0.1, 0).clearance == pytest.approx(1.0 - FOOTPRINT, abs=1e-12)
    assert bench.at(1.2, 1.25, 0).clearance == pytest.approx(1.0 - FOOTPRINT, abs=1e-12)
    assert bench.at(1.8, 0.65, 0).clearance == pytest.approx(0.5 - FOOTPRINT, abs=1e-12)


def test_clearance_is_the_distance_to_the_nearest_obstacle():
    circles = [Circle(name=str(y), x=0.0, y=y, radius=0.5) for y in (-3.0, 2.0)]
    assert Bench(circles, robot=ROBOT).clearance == pytest.approx(1.5 - FOOTPRINT)


WALL = Box(name="wall", x=1.0, y=0.0, length=0.2, width=4.0)


def at_the_wall(**options) -> Bench:
    return Bench([WALL], robot=ROBOT, **options).step([12.0, 12.0], count=60)


def test_a_wall_stops_the_robot_with_clearance_0():
    bench = at_the_wall()
    assert bench.contact == 1
    assert 0 <= bench.clearance <= TOUCHING
    assert bench.pose[0] == pytest.approx(0.9 - FOOTPRINT, abs=TOUCHING)
    np.testing.assert_array_equal(bench.wheel_speed, [0, 0])


def test_a_robot_at_a_wall_can_turn():
    bench = at_the_wall()
    x, y, yaw = bench.pose
    bench.step([-3.0, 3.0], count=20)
    assert bench.pose[2] > yaw + 0.5
    np.testing.assert_allclose(bench.pose[:2], [x, y], atol=1e-12)
    assert bench.contact == 1


def test_a_robot_at_a_wall_can_back_away():
    bench = at_the_wall().step([-5.0, -5.0], count=20)
    assert bench.pose[0] < 0.3
    assert bench.contact == 0


def test_a_robot_at_a_wall_can_turn_round_and_drive_away():
    bench = at_the_wall()
    while bench.pose[2] < 2.5:
        bench.step([-4.0, 4.0])
    bench.step([6.0, 6.0], count=30)
    assert bench.contact == 0
    assert bench.clearance > 0.2


def test_contact_stops_translation_but_not_rotation():
    bench = Bench([WALL], robot=SUDDEN, period=1.0).step([11.0, 12.0])
    assert bench.contact == 1
    assert bench.pose[2] == pytest.approx(0.0975 / 0.33)
    np.testing.assert_allclose(bench.wheel_speed, [-0.5, 0.5])


def test_passing_an_obstacle_closely_is_not_a_contact():
    bench = Bench([Circle(name="pillar", x=1.0, y=0.25 + FOOTPRINT + 1e-4, radius=0.25)], robot=ROBOT)
    contacts = [bench.step([10.0, 10.0]).contact[0] for _ in range(60)]
    assert bench.pose[0] > 2.0
    assert not any(contacts)


def test_a_contact_in_the_middle_of_a_step_counts():
    """While it brakes, the robot would roll 0.48 m, past the wall; it reverses before the end of the step."""
    wall = Box(name="wall", x=FOOTPRINT + 0.2 + 0.1, y=0.0, length=0.2, width=4.0)
    bench = Bench([wall], robot=DiffDrive(max_acceleration=1.5), period=3.0)
    bench.context.SetDiscreteState(1, [12.0, 12.0])
    assert bench.step([-12.0, -12.0]).contact == 1
    assert 0 <= bench.clearance <= TOUCHING


def test_a_gap_narrower_than_the_robot_stops_it():
    walls = [
        Box(name="upper", x=1.0, y=0.5, length=0.2, width=0.6),
        Box(name="lower", x=1.0, y=-0.5, length=0.2, width=0.6),
    ]
    bench = Bench(walls, robot=SUDDEN, period=3.0).step([900.0, 900.0])
    assert bench.contact == 1
    assert bench.pose[0] < 1.0


def random_scene(rng: np.random.Generator) -> list:
    obstacles = []
    for index in range(rng.integers(1, 6)):
        x, y = rng.uniform(-3, 3, 2)
        if rng.random() < 0.5:
            obstacles.append(Circle(name=f"o{index}", x=x, y=y, radius=rng.uniform(0.02, 0.8)))
        else:
            length, width = rng.uniform(0.02, 2.0, 2)
            yaw = rng.uniform(-4, 4)
            obstacles.append(Box(name=f"o{index}", x=x, y=y, length=length, width=width, yaw=yaw))
    return obstacles


def undisturbed(robot: DiffDrive, pose, wheels, command, period: float) -> np.ndarray:
    """Path of the robot's centre in a step without obstacles, by fine numerical integration."""
    time = np.linspace(0, period, 20_001)
    change = robot.max_wheel_acceleration * time
    command = np.clip(command, -robot.max_wheel_speed, robot.max_wheel_speed)
    left, right = (
        now + np.clip(wish - now, -change, change) for now, wish in zip(wheels, command, strict=True)
    )

    def integral(rate):
        return np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(time))])

    yaw = pose[2] + integral(robot.wheel_radius / robot.track * (right - left))
    speed = robot.wheel_radius * (left + right) / 2
    return pose[:2] + np.stack([integral(speed * np.cos(yaw)), integral(speed * np.sin(yaw))], axis=-1)


@pytest.mark.parametrize("seed", range(25))
def test_the_robot_never_penetrates_an_obstacle_at_any_speed_or_period(seed):
    """300 random starts, wheels to 1000 rad/s, steps to 3 s."""
    rng = np.random.default_rng(seed)
    obstacles = random_scene(rng)
    period = float(rng.choice([0.01, 0.05, 0.3, 3.0]))
    robot = DiffDrive(max_speed=97.5, max_acceleration=float(rng.choice([1.5, 30.0, 1e6])))
    bench = Bench(obstacles, robot=robot, period=period)
    for _ in range(12):
        while bench.at(*rng.uniform(-4, 4, 3)).clearance <= 0:
            pass
        command = 10 ** rng.uniform(0, 3) * rng.uniform(-1, 1, 2)
        for _ in range(3):
            bench.step(command)
            assert bench.clearance >= 0
            assert (bench.contact == 1) == (bench.clearance <= TOUCHING)


@pytest.mark.parametrize("seed", range(25))
def test_contact_is_reported_if_and_only_if_an_obstacle_is_on_the_path(seed):
    rng = np.random.default_rng(1000 + seed)
    obstacles = random_scene(rng)
    robot = DiffDrive(max_acceleration=float(rng.choice([1.5, 30.0])))
    period = float(rng.choice([0.05, 1.0, 3.0]))
    bench = Bench(obstacles, robot=robot, period=period)
    distance = ObstacleDistance(obstacles)
    for _ in range(4):
        while bench.at(*rng.uniform(-4, 4, 3)).clearance <= 0.01:
            pass
        wheels, command = rng.uniform(-12, 12, (2, 2))
        bench.context.SetDiscreteState(1, wheels)
        way = undisturbed(robot, bench.pose, wheels, command, period)
        clearance = distance(way[:: len(way) // 200]) - FOOTPRINT
        bench.step(command)
        # A chord of 0.1 rad runs this far inside of its arc.
        length = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
        grazing = 0.0125 * length + length / 200
        if bench.contact:
            assert clearance.min() < grazing
            assert np.linalg.norm(way - bench.pose[:2], axis=1).min() < 0.0125 * length + 1e-3
        else:
            assert clearance.min() > -grazing
            np.testing.assert_allclose(bench.pose[:2], way[-1], atol=1e-5)


def test_the_robot_never_penetrates_a_wall_however_long_it_pushes():
    bench = at_the_wall()
    rng = np.random.default_rng(4)
    for _ in range(150):
        bench.step(rng.uniform(-12, 12, 2) + 3.0)
        assert bench.clearance >= 0


def test_the_robot_has_illustration_geometry_and_no_proximity_geometry():
    bench = Bench([WALL], robot=ROBOT, illustration=True)
    inspector = bench.scene_graph.model_inspector()
    frame = bench.dut.frame_id()
    assert inspector.NumGeometriesForFrameWithRole(frame, Role.kIllustration) >= 4
    assert inspector.NumGeometriesForFrameWithRole(frame, Role.kProximity) == 0
    assert bench.clearance == pytest.approx(0.9 - FOOTPRINT)


def test_the_illustration_geometry_is_at_the_pose_of_the_robot():
    bench = Bench(robot=ROBOT, illustration=True).at(1.0, 2.0, 0.5)
    query = bench.scene_graph.get_query_output_port().Eval(bench.scene_graph.GetMyContextFromRoot(bench.root))
    X_WR = query.GetPoseInWorld(bench.dut.frame_id())
    np.testing.assert_allclose(X_WR.translation(), [1.0, 2.0, 0.0])


def test_a_file_that_is_not_a_model_is_refused(tmp_path):
    (tmp_path / "tank.sdf").write_text("<sdf version='1.9'><nothing/></sdf>")
    with pytest.raises(InputError, match=r"tank\.sdf must be an SDF file with one model"):
        Bench(robot=DiffDrive(model=str(tmp_path / "tank.sdf")), illustration=True)


@pytest.mark.parametrize("period", [0.0, -1.0, math.nan, math.inf])
def test_a_period_that_is_not_positive_and_finite_is_refused(period):
    with pytest.raises(ValueError, match="period must be positive and finite"):
        DiffDrivePlant(robot=ROBOT, period=period)


def test_only_the_given_geometries_are_obstacles():
    """A floor with a proximity role lies under every pose."""
    builder = DiagramBuilder()
    scene_graph = builder.AddSystem(SceneGraph())
    obstacles = register_obstacles(scene_graph, [Circle(name="pillar", x=1.0, y=0.0, radius=0.25)])
    floor = GeometryInstance(RigidTransform([0.0, 0.0, -0.5]), BoxShape(20.0, 20.0, 1.0), "floor")
    floor.set_proximity_properties(ProximityProperties())
    scene_graph.RegisterAnchoredGeometry(scene_graph.RegisterSource("floor"), floor)
    plants = [
        builder.AddNamedSystem(name, DiffDrivePlant(robot=SUDDEN, geometry_ids=ids))
        for name, ids in (("all", None), ("given", obstacles))
    ]
    for plant in plants:
        builder.Connect(scene_graph.get_query_output_port(), plant.get_geometry_query_input_port())
    root = builder.Build().CreateDefaultContext()
    clearances = [
        plant.get_clearance_output_port().Eval(plant.GetMyContextFromRoot(root)).item() for plant in plants
    ]
    assert clearances == pytest.approx([-FOOTPRINT, 1.0 - 0.25 - FOOTPRINT])
    context = plants[1].GetMyMutableContextFromRoot(root)
    plants[1].get_wheel_command_input_port().FixValue(context, [20.0, 20.0])
    for _ in range(20):
        context.get_mutable_discrete_state().SetFrom(plants[1].EvalUniquePeriodicDiscreteUpdate(context))
    # The robot drives over the floor and stops at the pillar.
    assert plants[1].get_pose_output_port().Eval(context)[0] == pytest.approx(
        1.0 - 0.25 - FOOTPRINT, abs=1e-5
    )
    assert plants[1].get_contact_output_port().Eval(context).item() == 1.0
