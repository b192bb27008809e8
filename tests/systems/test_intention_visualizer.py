"""IntentionVisualizer, with a stand-in for Meshcat that records its calls."""

import math

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource

from drake_shared.learners import Modes
from drake_shared.robots import Arm, DiffDrive, Robot
from drake_shared.robots.motion import motion
from drake_shared.systems.intention import Intention, empty_intention
from drake_shared.systems.intention_visualizer import IntentionVisualizer

ROBOT = DiffDrive()


class FakeMeshcat:
    def __init__(self):
        self.objects, self.places, self.properties, self.meshes = {}, {}, {}, {}
        self.colors, self.drawings = {}, 0

    def SetObject(self, path, shape, rgba):
        self.objects[path], self.colors[path] = shape, rgba

    def SetTriangleColorMesh(self, path, vertices, faces, colors):
        self.meshes[path], self.colors[path] = vertices, colors

    def SetTransform(self, path, X):
        self.places[path] = X.translation()
        self.drawings += path == "intention/halo"

    def SetProperty(self, path, name, value):
        self.properties[path, name] = value

    def visible(self, path: str) -> bool:
        return self.properties.get((path, "visible"), True)

    def center(self, path: str) -> np.ndarray:
        """The middle line of a strip, shape (n, 3), in the world frame."""
        return self.places[path] + self.meshes[path].T.reshape(-1, 2, 3).mean(axis=1)

    def width(self, path: str) -> np.ndarray:
        """The width of a strip, shape (n,), in [m]."""
        left, right = self.meshes[path].T.reshape(-1, 2, 3).swapaxes(0, 1)
        return np.linalg.norm(left - right, axis=1)


def expecting(variance=1e-4, first: int = 1) -> Intention:
    times = np.arange(0.0, 15.05, 0.1)
    mean = np.stack([0.3 * times, 0.1 * times], axis=-1)
    mean[:first] = math.nan
    spread = np.broadcast_to(variance, mean.shape).astype(float)
    return Intention(time=times[first - 1], times=times, mean=mean, variance=spread, first=first)


class Bench:
    def __init__(self, robot: Robot = ROBOT):
        self.meshcat, self.robot = FakeMeshcat(), robot
        self.dut = IntentionVisualizer(meshcat=self.meshcat, robot=robot)
        self.context = self.dut.CreateDefaultContext()
        self.draw()

    def draw(self, **values) -> FakeMeshcat:
        nothing = np.zeros(len(self.robot.command_names))
        shown = {
            "pose": np.zeros(len(self.robot.configuration_names)),
            "intention": Value(empty_intention(len(self.robot.position_names))),
            "human_weight": [1.0],
            "human_command": nothing,
            "autonomous_command": nothing,
            "shared_command": nothing,
        } | values
        for name, value in shown.items():
            self.dut.GetInputPort(name).FixValue(self.context, value)
        self.dut.ForcedPublish(self.context)
        return self.meshcat


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_the_ribbon_lies_on_the_expected_path_from_the_robot_to_the_end(bench):
    meshcat = bench.draw(intention=Value(expecting(first=31)), pose=[0.9, 0.3, 0.0])
    line = meshcat.center("intention/route/0")
    np.testing.assert_allclose(line[:, 1], line[:, 0] / 3, atol=1e-6)
    np.testing.assert_allclose(line[[0, -1], 0], [0.9, 4.5])
    assert not meshcat.visible("intention/route/1")


def test_vertices_are_relative_to_the_start_of_a_strip(bench):
    """They are single precision, which is 3 cm at 500 km from the origin."""
    far = expecting()
    far.mean += [500_000.0, 4_400_000.0]
    meshcat = bench.draw(intention=Value(far), pose=[500_000.0, 4_400_000.0, 0.0])
    assert np.abs(meshcat.meshes["intention/route/0"]).max() < 10.0
    np.testing.assert_allclose(meshcat.places["intention/route/0"][:2], [500_000.0, 4_400_000.0])


def test_each_mode_is_a_ribbon_as_opaque_as_it_is_probable(bench):
    intention = expecting()
    mean, variance = intention.mean[1:], intention.variance[1:]
    modes = Modes(
        probability=np.array([0.3, 0.7]),
        mean=np.stack([mean, mean * [1.0, -1.0]]),
        variance=np.stack([variance, variance]),
        aim=1,
    )
    meshcat = bench.draw(intention=Value(intention), modes=Value[object](modes))
    opacity = [meshcat.properties[f"intention/route/{slot}", "modulated_opacity"] for slot in (0, 1)]
    assert opacity == pytest.approx([0.7, 0.3])
    assert meshcat.center("intention/route/0")[-1, 1] < 0 < meshcat.center("intention/route/1")[-1, 1]


def test_without_a_prediction_no_route_is_shown(bench):
    assert not bench.meshcat.visible("intention/route/0")
    assert bench.draw(intention=Value(expecting())).visible("intention/route/0")
    for variance in (math.nan, 4.0):
        assert not bench.draw(intention=Value(expecting(variance=variance))).visible("intention/route/0")


@pytest.mark.parametrize("weight", [1.0, 0.25, 0.0])
def test_the_humans_share_of_the_disc_is_the_human_weight(bench, weight):
    meshcat = bench.draw(human_weight=[weight], pose=[1.0, 2.0, 0.5])
    x, y, z = meshcat.properties["intention/halo/human", "scale"]
    assert x * y == pytest.approx(weight, abs=1e-5)
    assert min(x, y) > 0.0  # Scaled by 0 an object has no inverse transform.
    assert z == 1.0
    np.testing.assert_allclose(meshcat.places["intention/halo"][:2], [1.0, 2.0])


def test_the_humans_disc_lies_on_the_agents_and_both_show_beside_the_body(bench):
    agent, human = (bench.meshcat.objects[f"intention/halo/{who}"] for who in ("agent", "human"))
    assert agent.radius() == human.radius() == pytest.approx(ROBOT.footprint_radius + 0.06)
    low, high = (bench.meshcat.places[f"intention/halo/{who}"][2] for who in ("agent", "human"))
    assert high - low == pytest.approx(0.5 * (agent.length() + human.length()))
    assert agent.length() < 0.01
    # On the floor, below the lowest route.
    assert 0.5 * agent.length() < bench.draw().places["intention/halo"][2] + low < 0.02


def test_routes_lie_on_the_floor_and_commands_above_the_robot_one_over_the_other(bench):
    command = [2.0, 3.0]
    meshcat = bench.draw(
        intention=Value(expecting()),
        human_command=command,
        autonomous_command=command,
        shared_command=command,
    )
    names = ("route/0", "human", "autonomous", "shared")
    heights = [meshcat.center(f"intention/{name}")[:, 2] for name in names]
    for height, expected in zip(heights, (0.02, 0.30, 0.33, 0.36), strict=True):
        np.testing.assert_allclose(height, expected)
    for name in names[1:]:
        np.testing.assert_allclose(meshcat.width(f"intention/{name}"), 0.03)
    colors = [meshcat.colors[f"intention/{name}"] for name in names]
    assert all(((color >= 0.0) & (color <= 1.0)).all() for color in colors)
    np.testing.assert_array_equal(colors[0][:, 0], colors[2][:, 0])  # The route is the agent's.


def test_at_most_five_routes_are_drawn(bench):
    intention = expecting()
    count = 7
    modes = Modes(
        probability=np.full(count, 1 / count),
        mean=intention.mean[1:] + np.arange(count)[:, None, None] * [0.0, 1.0],
        variance=np.stack([intention.variance[1:]] * count),
        aim=0,
    )
    meshcat = bench.draw(intention=Value(intention), modes=Value[object](modes))
    drawn = [path for path in meshcat.meshes if path.startswith("intention/route/")]
    assert len(drawn) == 5
    assert all(map(meshcat.visible, drawn))


def test_the_motion_of_an_arm_is_drawn_in_space():
    bench = Bench(Arm())
    tip = np.array([0.4, -0.1, 0.3])
    pose = [*tip, *Arm().home]
    command = np.array([0.1, 0.05, -0.2])
    times = np.arange(0.0, 2.05, 0.1)
    path = tip + times[:, None] * [0.05, 0.1, 0.1]
    expected = Intention(time=0.0, times=times, mean=path, variance=np.full_like(path, 1e-5), first=1)
    meshcat = bench.draw(pose=pose, intention=Value(expected), human_command=command)
    line = meshcat.center("intention/human")
    np.testing.assert_allclose(line, tip + np.linspace(0.0, 1.0, len(line))[:, None] * command, atol=1e-9)
    np.testing.assert_allclose(meshcat.center("intention/route/0")[[0, -1]], path[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(meshcat.places["intention/halo"], tip)


def test_what_is_scaled_is_never_moved(bench):
    """A transform puts the scale of what it moves back to 1."""
    before = tuple(bench.meshcat.places["intention/halo/human"])
    bench.draw(pose=[1.0, 0.5, 0.3], human_weight=[0.4])
    assert tuple(bench.meshcat.places["intention/halo/human"]) == before


@pytest.mark.parametrize("name", ["human", "autonomous", "shared"])
@pytest.mark.parametrize("wheels", [(4.0, 6.0), (5.0, 5.0), (-2.0, -1.0)])
def test_each_command_is_the_arc_on_which_it_leads_in_the_next_second(bench, name, wheels):
    pose = (1.0, -1.0, 2.0)
    line = bench.draw(pose=pose, **{f"{name}_command": wheels}).center(f"intention/{name}")
    np.testing.assert_allclose(line[0, :2], pose[:2])
    for at, time in zip(line[1:], np.linspace(0.0, 1.0, len(line))[1:], strict=True):
        *_, (x, y, _) = motion(ROBOT, pose, wheels, wheels, time)
        np.testing.assert_allclose(at[:2], [x, y], atol=1e-6)


def test_a_command_that_is_nan_or_zero_is_hidden(bench):
    assert not bench.draw(autonomous_command=[math.nan, math.nan]).visible("intention/autonomous")
    assert not bench.meshcat.visible("intention/human")
    assert bench.draw(autonomous_command=[1.0, 1.0]).visible("intention/autonomous")


def test_ports_but_pose_and_intention_may_be_left_open():
    meshcat = FakeMeshcat()
    dut = IntentionVisualizer(meshcat=meshcat, robot=ROBOT)
    context = dut.CreateDefaultContext()
    dut.get_pose_input_port().FixValue(context, [0.0, 0.0, 0.0])
    dut.get_intention_input_port().FixValue(context, Value(expecting()))
    dut.ForcedPublish(context)
    assert meshcat.visible("intention/route/0")
    for name in ("halo", "human", "autonomous", "shared"):
        assert not meshcat.visible(f"intention/{name}")


def test_it_is_added_to_a_builder_with_its_connections():
    builder, meshcat = DiagramBuilder(), FakeMeshcat()
    pose = builder.AddSystem(ConstantVectorSource([1.0, 2.0, 0.0]))
    intention = builder.AddSystem(ConstantValueSource(Value(expecting())))
    weight = builder.AddSystem(ConstantVectorSource([0.25]))
    dut = IntentionVisualizer.AddToBuilder(
        builder,
        pose_port=pose.get_output_port(),
        intention_port=intention.get_output_port(),
        human_weight=weight.get_output_port(),
        meshcat=meshcat,
        robot=ROBOT,
    )
    diagram = builder.Build()
    assert diagram.GetSubsystemByName("intention_visualizer") is dut
    Simulator(diagram).AdvanceTo(0.95)
    assert meshcat.drawings == 10
    assert meshcat.visible("intention/halo")
    np.testing.assert_allclose(meshcat.places["intention/halo"][:2], [1.0, 2.0])


def test_what_is_drawn_scales_with_the_robot():
    small = FakeMeshcat()
    robot = DiffDrive(footprint_radius=0.0267, wheel_radius=0.00975, track=0.033)
    IntentionVisualizer(meshcat=small, robot=robot)
    large = FakeMeshcat()
    IntentionVisualizer(meshcat=large, robot=ROBOT)
    for path, shape in large.objects.items():
        assert small.objects[path].radius() == pytest.approx(0.1 * shape.radius())


def test_by_default_it_draws_ten_times_a_second(bench):
    bench.draw()
    before = bench.meshcat.drawings
    Simulator(bench.dut, bench.context).AdvanceTo(0.95)
    assert bench.meshcat.drawings - before == 10
