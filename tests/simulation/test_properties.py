"""What holds for whatever comes: properties, each tried on many cases that hypothesis thinks of."""

import copy
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings, strategies as st

from drake_shared.cli.main import main
from drake_shared.common.files import models_directory
from drake_shared.demonstrations import (
    Demonstration,
    Demonstrations,
    read_demonstrations,
    write_demonstrations,
)
from drake_shared.learners import confidence
from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import motion, speeds_after
from drake_shared.scenario.obstacles import Box, Circle, ObstacleDistance
from drake_shared.systems.confidence_blender import blend

# The same cases in every run, and none judged by the clock.
quick = settings(
    derandomize=True,
    deadline=None,
    max_examples=60,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
ROBOT = DiffDrive()
FASTEST = ROBOT.max_wheel_speed
wheels = st.tuples(*[st.floats(-FASTEST, FASTEST)] * 2)
share = st.floats(0.0, 1.0)


@quick
@given(human=wheels, agent=wheels, weight=share)
def test_the_blend_is_a_convex_combination(human, agent, weight):
    shared = blend(weight, human, agent)
    for one, other, both in zip(human, agent, shared, strict=True):
        rounding = 1e-12 * (1.0 + abs(one) + abs(other))
        assert min(one, other) - rounding <= both <= max(one, other) + rounding
    # On the line between both, at the share that the weight says.
    offset = np.subtract(shared, agent)
    np.testing.assert_allclose(offset, weight * np.subtract(human, agent), atol=1e-12 * FASTEST)


@quick
@given(command=wheels, weight=share)
def test_what_both_agree_on_is_done(command, weight):
    shared = blend(weight, command, command)
    np.testing.assert_allclose(shared, command, rtol=1e-15, atol=1e-15)


positive = st.floats(1e-300, 1e300)


@quick
@given(gain=positive, one=positive, other=positive)
def test_confidence_falls_as_variance_rises_and_stays_a_share(gain, one, other):
    low, high = (confidence(variance, gain) for variance in sorted((one, other)))
    assert 0.0 <= high <= low <= 1.0


@quick
@given(start=wheels, command=wheels, cuts=st.lists(st.floats(0.01, 0.99), max_size=4), yaw=st.floats(-3, 3))
def test_where_the_robot_gets_does_not_depend_on_how_the_step_is_cut(start, command, cuts, yaw):
    duration = 0.4
    whole = motion(ROBOT, (0.0, 0.0, yaw), start, command, duration)[-1]
    pose, speeds = (0.0, 0.0, yaw), start
    moments = [0.0, *sorted(cuts), 1.0]
    for begin, end in itertools.pairwise(moments):
        part = duration * (end - begin)
        if part > 0.0:
            pose = motion(ROBOT, pose, speeds, command, part)[-1]
            speeds = speeds_after(ROBOT, speeds, command, part)
    np.testing.assert_allclose(pose, whole, atol=1e-9)
    np.testing.assert_allclose(speeds, speeds_after(ROBOT, start, command, duration), atol=1e-9)


place = st.floats(-5.0, 5.0)
size = st.floats(0.05, 2.0)


@quick
@given(x=place, y=place, other_x=place, other_y=place, radius=size, other_radius=size)
def test_clearance_is_symmetric_and_zero_at_touch(x, y, other_x, other_y, radius, other_radius):
    """Of two discs each may be the obstacle; moved together until they touch, nothing is left."""
    one = ObstacleDistance([Circle(name="one", x=x, y=y, radius=radius)])([[other_x, other_y]])[0]
    other = ObstacleDistance([Circle(name="other", x=other_x, y=other_y, radius=other_radius)])([[x, y]])[0]
    assert one - other_radius == pytest.approx(other - radius, abs=1e-9)
    away = math.hypot(other_x - x, other_y - y)
    if away > 1e-3:
        reach = (radius + other_radius) / away
        touching = [x + reach * (other_x - x), y + reach * (other_y - y)]
        gap = ObstacleDistance([Circle(name="one", x=x, y=y, radius=radius)])([touching])[0] - other_radius
        assert gap == pytest.approx(0.0, abs=1e-9)


@quick
@given(x=place, y=place, length=size, width=size, yaw=st.floats(-3.0, 3.0), along=share)
def test_at_the_side_of_a_box_there_is_nothing_left(x, y, length, width, yaw, along):
    box = Box(name="box", x=x, y=y, length=length, width=width, yaw=yaw)
    in_box = np.array([(along - 0.5) * length, 0.5 * width])
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    assert ObstacleDistance([box])([turn @ in_box + (x, y)])[0] == pytest.approx(0.0, abs=1e-9)


finite = st.floats(-1e6, 1e6)


@st.composite
def demonstration_sets(draw) -> Demonstrations:
    scored = draw(st.booleans())
    items = []
    for _ in range(draw(st.integers(1, 3))):
        steps = draw(st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=6))
        times = np.cumsum([draw(st.floats(0.0, 10.0)), *steps])
        positions = draw(st.lists(st.tuples(finite, finite), min_size=len(times), max_size=len(times)))
        items.append(Demonstration(times=times, positions=positions, score=draw(finite) if scored else None))
    return Demonstrations(items=tuple(items), metadata={"scenario": draw(st.text(max_size=20))})


@quick
@given(demonstrations=demonstration_sets())
def test_demonstrations_come_back_from_their_file_as_they_were(demonstrations, tmp_path):
    path = tmp_path / "demonstrations.parquet"
    write_demonstrations(path, demonstrations)
    read = read_demonstrations([path])
    assert len(read) == len(demonstrations)
    for one, other in zip(demonstrations, read, strict=True):
        np.testing.assert_array_equal(one.times, other.times)
        np.testing.assert_array_equal(one.positions, other.positions)
        assert one.score == other.score


GOOD = yaml.safe_load(
    (models_directory() / "scenarios" / "two_obstacles.yaml").read_text().replace("!Circle", "")
)
wrong = st.one_of(
    st.none(),
    st.just(math.nan),
    st.just(math.inf),
    st.just(-1.0),
    st.just("far"),
    st.just([]),
    st.just({"nonsense": 1}),
)


@st.composite
def broken_scenarios(draw) -> str:
    """The shipped scenario with one value replaced by what none of its fields may hold."""
    data = copy.deepcopy(GOOD)
    name = draw(
        st.sampled_from(["duration", "control_period", "start", "goal", "workspace", "obstacles", "routes"])
    )
    data[name] = draw(wrong.filter(lambda value: not (name == "obstacles" and value == [])))
    return yaml.safe_dump(data)


@quick
@given(text=broken_scenarios())
def test_an_invalid_scenario_is_refused_in_one_line(text, tmp_path, capsys):
    path = Path(tmp_path) / "broken.yaml"
    path.write_text(text)
    assert main(["simulate", "--scenario", str(path), "--driver", "human"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.strip().splitlines()) == 1
    assert str(path) in said.err
