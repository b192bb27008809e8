"""IntentionVisualizer, with a stand-in for Meshcat that records its calls."""

import math
import re

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource

from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import motion
from drake_shared.systems.intention import EMPTY_INTENTION, Intention
from drake_shared.systems.intention_visualizer import IntentionVisualizer

ROBOT = DiffDrive()


DOT = re.compile(r"intention/path/\d+")


class FakeMeshcat:
    def __init__(self):
        self.objects, self.places, self.properties = {}, {}, {}

    def SetObject(self, path, shape, rgba):
        self.objects[path] = shape

    def SetTransform(self, path, X, time=None):
        self.places[path] = X.translation()

    def SetProperty(self, path, name, value, time=None):
        self.properties[path, name] = value

    def visible(self, path: str) -> bool:
        return self.properties.get((path, "visible"), True)


def expecting(variance=0.04, first: int = 1) -> Intention:
    times = np.arange(0.0, 15.05, 0.1)
    mean = np.stack([0.3 * times, 0.1 * times], axis=-1)
    mean[:first] = math.nan
    spread = np.broadcast_to(variance, mean.shape).astype(float)
    return Intention(time=times[first - 1], times=times, mean=mean, variance=spread, first=first)


class Bench:
    def __init__(self):
        self.meshcat = FakeMeshcat()
        self.dut = IntentionVisualizer(meshcat=self.meshcat, robot=ROBOT)
        self.context = self.dut.CreateDefaultContext()
        self.draw()

    def draw(self, **values) -> FakeMeshcat:
        shown = {
            "pose": [0.0, 0.0, 0.0],
            "intention": Value(EMPTY_INTENTION),
            "human_weight": [1.0],
            "human_command": [0.0, 0.0],
            "autonomous_command": [0.0, 0.0],
            "shared_command": [0.0, 0.0],
        } | values
        for name, value in shown.items():
            self.dut.GetInputPort(name).FixValue(self.context, value)
        self.dut.ForcedPublish(self.context)
        return self.meshcat


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_makes_all_objects_at_the_start_and_then_only_moves_them(bench):
    made = dict(bench.meshcat.objects)
    for first in (1, 40, 150):
        bench.draw(intention=Value(expecting(first=first)), pose=[1.0, 0.0, 0.3], human_weight=[0.4])
    assert bench.meshcat.objects == made


def test_dots_lie_on_the_expected_path_from_now_to_the_end(bench):
    meshcat = bench.draw(intention=Value(expecting(first=31)))
    dots = np.array([place for path, place in meshcat.places.items() if DOT.fullmatch(path)])
    np.testing.assert_allclose(dots[:, 1], dots[:, 0] / 3, atol=1e-12)
    assert dots[:, 0].min() == pytest.approx(0.93)
    assert dots[:, 0].max() == pytest.approx(4.5)


def test_the_spread_is_drawn_by_its_standard_deviations(bench):
    meshcat = bench.draw(intention=Value(expecting(variance=[0.04, 0.09])))
    radius = meshcat.objects["intention/path/3/spread"].radius()
    wide, tall, _ = meshcat.properties["intention/path/3/spread", "scale"]
    assert [wide * radius, tall * radius] == pytest.approx([0.2, 0.3])
    # It moves with the dot of the mean, whose parent is its own.
    np.testing.assert_array_equal(meshcat.places["intention/path/3/spread"], 0)


def test_what_is_scaled_is_never_moved(bench):
    """A transform puts the scale of what it moves back to 1."""
    meshcat = bench.meshcat
    moved_before = {path: tuple(place) for path, place in meshcat.places.items()}
    bench.draw(intention=Value(expecting(first=40)), pose=[1.0, 0.5, 0.3], human_weight=[0.4])
    scaled = {path for path, name in meshcat.properties if name == "scale"}
    assert scaled
    assert all(tuple(meshcat.places[path]) == moved_before[path] for path in scaled)


def test_without_a_prediction_no_path_is_shown(bench):
    assert not bench.meshcat.visible("intention/path/0")
    assert not bench.meshcat.visible("intention/path/29")
    assert bench.draw(intention=Value(expecting())).visible("intention/path/0")
    assert not bench.draw(intention=Value(expecting(variance=math.nan))).visible("intention/path/0")


@pytest.mark.parametrize("weight", [1.0, 0.25, 0.0])
def test_the_humans_share_of_the_disc_is_the_human_weight(bench, weight):
    meshcat = bench.draw(human_weight=[weight], pose=[1.0, 2.0, 0.5])
    x, y, _ = meshcat.properties["intention/halo/human", "scale"]
    assert x * y == pytest.approx(weight, abs=1e-5)
    np.testing.assert_allclose(meshcat.places["intention/halo"][:2], [1.0, 2.0])


@pytest.mark.parametrize("name", ["human", "autonomous", "shared"])
@pytest.mark.parametrize("wheels", [(4.0, 6.0), (5.0, 5.0), (-2.0, 2.0)])
def test_each_command_is_the_arc_on_which_it_leads_in_the_next_second(bench, name, wheels):
    pose = (1.0, -1.0, 2.0)
    meshcat = bench.draw(pose=pose, **{f"{name}_command": wheels})
    for index in range(5):
        *_, (x, y, _) = motion(ROBOT, pose, wheels, wheels, 0.2 * (index + 1))
        np.testing.assert_allclose(meshcat.places[f"intention/{name}/{index}"][:2], [x, y], atol=1e-12)


def test_a_command_of_nan_is_hidden(bench):
    assert not bench.draw(autonomous_command=[math.nan, math.nan]).visible("intention/autonomous")
    assert bench.meshcat.visible("intention/human")
    assert bench.draw(autonomous_command=[1.0, 1.0]).visible("intention/autonomous")


def test_ports_but_pose_and_intention_may_be_left_open():
    meshcat = FakeMeshcat()
    dut = IntentionVisualizer(meshcat=meshcat, robot=ROBOT)
    context = dut.CreateDefaultContext()
    dut.get_pose_input_port().FixValue(context, [1.0, 2.0, 0.0])
    dut.get_intention_input_port().FixValue(context, Value(expecting()))
    dut.ForcedPublish(context)
    assert meshcat.visible("intention/path/0")
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
    diagram.ForcedPublish(diagram.CreateDefaultContext())
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
