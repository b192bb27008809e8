"""Scenarios: the shipped ones, what a robot can do, and everything that a file may get wrong."""

import copy
import dataclasses
import json
import math

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.scenario import (
    Scenario,
    check_scenario,
    clearance_scorer,
    load_scenario,
    scenario_from_dict,
)
from drake_shared.scenario.obstacles import Box, Circle

SHIPPED = ("two_obstacles", "three_obstacles", "doorway")

TASK = """\
name: task
duration: 15.0
control_period: 0.05
start: {x: 0.0, y: 0.0, yaw: 0.0}
goal: {x: 3.0, y: 0.0, radius: 0.2}
workspace: {x_min: -1.0, x_max: 4.0, y_min: -1.5, y_max: 1.5}
obstacles:
- !Circle {name: pillar, x: 1.5, y: 0.0, radius: 0.2}
- !Box {name: wall, x: 1.5, y: 1.4, length: 1.0, width: 0.1}
routes:
- name: below
  waypoints: [[0.0, 0.0], [1.5, -0.8], [3.0, 0.0]]
  sides: {pillar: right, wall: right}
- name: between
  waypoints: [[0.0, 0.0], [1.5, 0.75], [3.0, 0.0]]
  sides: {pillar: left, wall: right}
"""


@pytest.fixture
def write(tmp_path):
    """Writes the task with one thing changed."""

    def apply(old: str = "", new: str = ""):
        assert old in TASK
        file = tmp_path / "task.yaml"
        file.write_text(TASK.replace(old, new, 1))
        return file

    return apply


def refused(path) -> str:
    """The message of the error for a file, after the file's name."""
    with pytest.raises(InputError) as caught:
        load_scenario(path)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(str(path))
    return text.removeprefix(str(path)).removeprefix(": ").strip()


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenarios_can_be_run(name):
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.steps == 300
    assert len(scenario.routes) == 3
    assert clearance_scorer(scenario)(np.array([[scenario.goal.x, scenario.goal.y]])) > 0


def test_the_two_obstacle_task_is_the_default():
    assert load_scenario() == load_scenario("two_obstacles")


def test_the_default_is_the_task_of_the_paper():
    scenario = load_scenario()
    assert [(item.x, item.y, item.radius) for item in scenario.obstacles] == [
        (1.4, 0.0, 0.25),
        (3.6, 0.0, 0.25),
    ]
    assert (scenario.duration, scenario.control_period) == (15.0, 0.05)
    assert dataclasses.astuple(scenario.start) == (0.0, 0.0, 0.0)
    assert dataclasses.astuple(scenario.goal) == (5.0, 0.0, 0.0, 0.2, "")


def test_the_default_robot_is_the_p3dx():
    robot = load_scenario().robot
    assert (robot.footprint_radius, robot.wheel_radius, robot.track) == (0.267, 0.0975, 0.33)
    assert robot.max_wheel_speed == pytest.approx(12.3, abs=0.01)
    assert robot.model_path().is_file()


def test_the_shipped_scenarios_have_every_kind_of_obstacle():
    kinds = {type(item) for name in SHIPPED for item in load_scenario(name).obstacles}
    assert kinds == {Circle, Box}


def test_a_file_can_be_given_by_its_path(write):
    scenario = load_scenario(write())
    assert [item.name for item in scenario.obstacles] == ["pillar", "wall"]
    assert scenario.robot == DiffDrive()
    assert load_scenario(str(write())) == scenario


def test_integers_are_accepted_for_floats(write):
    assert load_scenario(write("duration: 15.0", "duration: 15")).duration == 15.0


def test_a_route_is_found_by_its_name():
    assert load_scenario().route("left_left").sides == {"first": "left", "second": "left"}
    with pytest.raises(InputError, match="left_right") as caught:
        load_scenario().route("up")
    assert caught.value.field == "routes"


def test_a_route_starts_in_the_direction_of_the_robot(write):
    scenario = load_scenario(write("yaw: 0.0}", "yaw: -0.4}"))
    *_, direction, _ = scenario.routes[0].path(scenario.start).frame(0.0)
    assert direction == pytest.approx(-0.4)


@pytest.mark.parametrize("name", SHIPPED)
def test_the_dictionary_of_a_log_gives_the_scenario_back(name):
    scenario = load_scenario(name)
    assert scenario_from_dict(json.loads(json.dumps(dataclasses.asdict(scenario)))) == scenario


def test_numpy_numbers_in_a_scenario_are_stored_as_plain_ones(open_floor):
    open_floor.goal.radius = np.float64(0.25)
    assert scenario_from_dict(dataclasses.asdict(open_floor)) == open_floor


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        # Unknown fields and wrong types.
        ("duration:", "duraton:", "duraton"),
        ("yaw: 0.0}", "yaw: 0.0, z: 1.0}", "start.z"),
        ("obstacles:", "robot: {wheels: 4}\nobstacles:", "robot.wheels"),
        ("radius: 0.2}\n- !Box", "radius: 0.2, colour: red}\n- !Box", "obstacles[0].colour"),
        ("duration: 15.0", "duration: soon", "duration"),
        ("duration: 15.0", "duration: [15.0]", "duration"),
        ("duration: 15.0", "duration:", "duration"),
        ("duration: 15.0", "duration: true", "duration"),
        ("name: task", "name: [a, b]", "name"),
        ("{x: 0.0, y: 0.0, yaw: 0.0}", "3", "start"),
        ("{x: 0.0, y: 0.0, yaw", "{x: left, y: 0.0, yaw", "start.x"),
        ("!Circle", "!Disc", "obstacles[0]"),
        ("!Box", "!box", "obstacles[1]"),
        ("[1.5, -0.8]", "[1.5, low]", "routes[0].waypoints[1][1]"),
        ("[1.5, -0.8]", "1.5", "routes[0].waypoints[1]"),
        ("obstacles:\n", "obstacles:\nx_obstacles:\n", "obstacles"),
        ("sides: {pillar: right, wall: right}", "sides: left", "routes[0].sides"),
        # Given twice, or by a key that is not text.
        ("duration: 15.0", "duration: 15.0\nduration: 20.0", "duration"),
        ("goal: {x: 3.0", "goal: {x: 3.0, x: 2.0", "goal.x"),
        ("{pillar: right, wall", "{pillar: right, pillar: right, wall", "routes[0].sides.pillar"),
        ("duration: 15.0", "duration: 15.0\noff: 1", "off"),
        ("{pillar: right, wall", "{no: left, pillar: right, wall", "routes[0].sides.no"),
        ("{pillar: right, wall", "{1: left, pillar: right, wall", "routes[0].sides.1"),
        ("duration: 15.0", "duration: 15.0\n[a, b]: 1", "must"),
        # What YAML reads as something else than is written.
        ("duration: 15.0", "duration: 1:30", "duration"),
        ("duration: 15.0", "duration: 017", "duration"),
        ("name: below", "name: off", "routes[0].name"),
        ("name: below", "name: 1_0", "routes[0].name"),
        # Names that are parts of paths.
        ("name: task", "name: ../task", "name"),
        ("name: task", "name: /tmp/task", "name"),
        ("name: task", "name: 'a\\b'", "name"),
        ("name: task", "name: .hidden", "name"),
        ("name: task", 'name: "ta\\0sk"', "name"),
        ("name: task", 'name: "ta\\nsk"', "name"),
        ("name: task", f"name: {'long' * 30}", "name"),
        ("name: between", 'name: "be\\0tween"', "routes"),
        # Angles in degrees.
        ("yaw: 0.0}", "yaw: -45}", "start.yaw"),
        ("width: 0.1", "width: 0.1, yaw: 30", "obstacles[1].yaw"),
        # NaN and infinite values.
        ("duration: 15.0", "duration: .nan", "duration"),
        ("control_period: 0.05", "control_period: .inf", "control_period"),
        ("yaw: 0.0", "yaw: -.inf", "start.yaw"),
        ("x: 1.5, y: 0.0, radius: 0.2", "x: .nan, y: 0.0, radius: 0.2", "obstacles[0].x"),
        ("width: 0.1", "width: .nan", "obstacles[1].width"),
        ("[1.5, -0.8]", "[1.5, .nan]", "routes[0].waypoints[1][1]"),
        ("obstacles:", "robot: {track: .nan}\nobstacles:", "robot.track"),
        # Missing fields.
        ("name: task\n", "", "name"),
        ("goal: {x: 3.0, ", "goal: {", "goal.x"),
        ("goal: {x: 3.0, y: 0.0, radius: 0.2}\n", "", "goal.x"),
        ("x_min: -1.0, ", "", "workspace.x_min"),
        ("0.0, radius: 0.2}\n- !Box", "0.0}\n- !Box", "obstacles[0].radius"),
        (", length: 1.0", "", "obstacles[1].length"),
        ("name: pillar, ", "", "obstacles"),
        ("name: below", "name: ' '", "routes"),
        # Values out of range.
        ("duration: 15.0", "duration: 0.0", "duration"),
        ("duration: 15.0", "duration: 15.01", "duration"),
        ("duration: 15.0", "duration: 0.01", "duration"),
        ("control_period: 0.05", "control_period: -0.05", "control_period"),
        ("radius: 0.2}\nwork", "radius: 0.0}\nwork", "goal.radius"),
        ("radius: 0.2}\n- !Box", "radius: -0.2}\n- !Box", "obstacles[0].radius"),
        ("length: 1.0", "length: 0.0", "obstacles[1].length"),
        ("obstacles:", "robot: {footprint_radius: -1.0}\nobstacles:", "robot.footprint_radius"),
        ("obstacles:", "robot: {wheel_radius: 0.0}\nobstacles:", "robot.wheel_radius"),
        ("obstacles:", "robot: {max_acceleration: 0.0}\nobstacles:", "robot.max_acceleration"),
        ("obstacles:", "travel_time: 0.0\nobstacles:", "travel_time"),
        ("control_period: 0.05", "control_period: 1.0e-9", "control_period"),
        ("x_max: 4.0", "x_max: -4.0", "workspace's width"),
        ("y_max: 1.5", "y_max: -1.5", "workspace's height"),
        ("name: wall", "name: pillar", "obstacles"),
        ("name: between", "name: below", "routes"),
        ("obstacles:", "robot: {model: tank.sdf}\nobstacles:", "robot.model"),
        ("obstacles:", "plant: wooden\nobstacles:", "plant"),
        # Places outside the workspace.
        ("start: {x: 0.0", "start: {x: -1.1", "start"),
        ("goal: {x: 3.0", "goal: {x: 4.1", "goal"),
        ("x: 1.5, y: 0.0, radius", "x: 9.5, y: 0.0, radius", "obstacles: pillar"),
        ("[1.5, -0.8]", "[1.5, -1.6]", "routes: below"),
        # Places closer to an obstacle than the footprint's radius.
        ("start: {x: 0.0", "start: {x: 1.5", "start"),
        ("start: {x: 0.0", "start: {x: 1.05", "start"),
        ("goal: {x: 3.0", "goal: {x: 1.95", "goal"),
        ("[1.5, -0.8]", "[1.5, -0.1]", "routes: below"),
        ("[1.5, -0.8]", "[1.5, -0.46]", "routes: below"),
        # Routes.
        ("[[0.0, 0.0], [1.5, -0.8], [3.0, 0.0]]", "[]", "routes: below"),
        ("[[0.0, 0.0], [1.5, -0.8], [3.0, 0.0]]", "[[0.0, 0.0]]", "routes: below"),
        ("[1.5, -0.8]", "[1.5, -0.8, 0.0]", "routes: below"),
        ("[1.5, -0.8]", "[1.5, -0.8], [1.5, -0.8]", "routes: below"),
        ("[[0.0, 0.0], [1.5, -0.8]", "[[0.1, 0.0], [1.5, -0.8]", "routes: below"),
        ("[1.5, -0.8], [3.0, 0.0]", "[1.5, -0.8], [2.9, 0.0]", "routes: below"),
        ("pillar: right", "pillar: left", "routes: below: sides: pillar"),
        ("pillar: right", "pillar: under", "routes: below: sides: pillar"),
        ("{pillar: right, wall: right}", "{pillar: right}", "routes: below: sides"),
        ("{pillar: right, ", "{tree: left, pillar: right, ", "routes: below: sides"),
    ],
)
def test_a_bad_scenario_is_refused_in_one_line_that_names_file_and_field(write, old, new, field):
    assert refused(write(old, new)).startswith(f"{field} ")


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("duration: 15.0", "duration: 15.0\nduration: 20.0", ("lines 2 and 3",)),
        ("radius: 0.2}\n- !Box", "raduis: 0.2}\n- !Box", ("'pillar'", "'radius'", "line 8")),
        ("!Box", "!box", ("!box", "'!Box'", "line 9")),
        ("duration:", "Duration:", ("'duration'", "line 2")),
        ("duration: 15.0", "duration: 15.0\noff: 1", ("'off'", "false", "line 3")),
        ("yaw: 0.0}", "yaw: 90}", ("radians", "1.5708")),
    ],
)
def test_the_message_helps_to_mend_the_file(write, old, new, parts):
    text = refused(write(old, new))
    assert all(part in text for part in parts)
    assert "class" not in text


def test_text_in_quotes_and_numbers_with_exponents_are_what_they_look_like(write):
    scenario = load_scenario(write("name: below", "name: 'off'"))
    assert scenario.routes[0].name == "off"
    assert load_scenario(write("duration: 15.0", "duration: 1.5e1")).duration == 15.0
    assert load_scenario(write("duration: 15.0", "duration: 15e0")).duration == 15.0


def test_names_may_have_spaces_and_letters_of_any_language(write):
    assert load_scenario(write("name: task", "name: Küche 2.b")).name == "Küche 2.b"


def test_anchors_merges_and_templates_are_still_read(write):
    scenario = load_scenario(
        write(
            "- !Circle {name: pillar, x: 1.5, y: 0.0, radius: 0.2}",
            "- !Circle {<<: {x: 1.0, y: 0.0, radius: 0.2}, name: pillar, x: 1.5}",
        )
    )
    assert (scenario.obstacles[0].x, scenario.obstacles[0].radius) == (1.5, 0.2)
    template = write("duration: 15.0", "_twelve: &twelve 12.0\nduration: *twelve")
    assert load_scenario(template).duration == 12.0


def test_the_robots_model_lies_beside_the_file_wherever_one_works(write, tmp_path, monkeypatch):
    model = load_scenario().robot.model_path()
    file = write("obstacles:", "robot: {model: mine/rover.sdf}\nobstacles:")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "rover.sdf").write_text(model.read_text())
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    scenario = load_scenario(file)
    assert scenario.robot.model_path() == tmp_path / "mine" / "rover.sdf"
    monkeypatch.chdir(tmp_path)
    relative = load_scenario(file.name)
    monkeypatch.chdir("/")
    # Read back from a log, in a third folder.
    assert (
        scenario_from_dict(dataclasses.asdict(relative))
        .robot.model_path()
        .samefile(tmp_path / "mine" / "rover.sdf")
    )


@pytest.mark.parametrize("routes", ["routes: []\n", ""])
def test_a_scenario_without_routes_is_refused(tmp_path, routes):
    file = tmp_path / "task.yaml"
    file.write_text(TASK[: TASK.index("routes:")] + routes)
    assert refused(file).startswith("routes ")


@pytest.mark.parametrize("content", [b"", b"3", b"- 1\n- 2\n", b"a: [", b"a: b: c", b"\x00", b"\xff\xfe\x00"])
def test_a_file_that_is_not_a_scenario_is_refused(tmp_path, content):
    file = tmp_path / "task.yaml"
    file.write_bytes(content)
    assert refused(file).startswith("cannot be read")


@pytest.mark.parametrize("name", ["nowhere/task.yaml", "four_obstacles", "", "../two_obstacles"])
def test_a_missing_file_is_refused_with_the_shipped_names(tmp_path, name):
    path = str(tmp_path / name) if "/" in name else name
    text = refused(path)
    assert all(shipped in text for shipped in SHIPPED)


def test_yaml_that_would_run_code_is_refused(write, tmp_path):
    trap = tmp_path / "trap"
    file = write("name: task", f"name: !!python/object/apply:os.mkdir ['{trap}']")
    assert refused(file).startswith(("name", "cannot"))
    assert not trap.exists()


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"duration": "soon"}, "duration"),
        ({"duration": None}, "duration"),
        ({"duration": math.nan}, "duration"),
        ({"goal": None}, "goal"),
        ({"goal": [1.0, 2.0]}, "goal"),
        ({"start": {"x": "left"}}, "start.x"),
        ({"weather": "sun"}, "weather"),
        ({"routes": [{"name": "a", "waypoints": [1, 2], "sides": {}}]}, "routes[0].waypoints[0]"),
        ({"routes": []}, "routes"),
        ({"obstacles": None}, ""),
        ({"obstacles": "none"}, ""),
        ({"obstacles": [3]}, ""),
        ({"name": object()}, ""),
    ],
)
def test_a_dictionary_that_is_not_a_scenario_is_refused(scenario, change, field):
    data = dataclasses.asdict(scenario) | change
    with pytest.raises(InputError) as caught:
        scenario_from_dict(data, source="a log")
    assert str(caught.value).startswith(f"a log: {field} " if field else "a log ")


@pytest.mark.parametrize("data", [None, 3, "scenario", [1, 2], {}])
def test_data_other_than_a_dictionary_is_refused(data):
    with pytest.raises(InputError, match="a log"):
        scenario_from_dict(data, source="a log")


def test_checking_does_not_change_a_scenario(scenario):
    before = copy.deepcopy(scenario)
    check_scenario(scenario)
    assert scenario == before


def test_clearance_is_the_least_distance_along_the_path_less_the_footprint(scenario):
    clearance = clearance_scorer(scenario)
    assert clearance(np.array([[1.4, 1.0]])) == pytest.approx(1.0 - 0.25 - 0.267)
    way = np.stack([np.linspace(0, 5, 101), np.full(101, 0.8)], axis=-1)
    assert clearance(way) == pytest.approx(0.8 - 0.25 - 0.267)


def test_without_obstacles_clearance_is_infinite(open_floor):
    check_scenario(open_floor)
    assert clearance_scorer(open_floor)(np.zeros((1, 2))) == math.inf


def test_wheel_speeds_and_twist_are_inverse():
    robot = DiffDrive()
    for speed, yaw_rate in [(0.5, 0.3), (-0.2, 1.0), (0.0, -2.0), (1.1, 0.0)]:
        assert robot.twist(*robot.wheel_speeds(speed, yaw_rate)) == pytest.approx((speed, yaw_rate))


def test_wheel_speeds_by_hand():
    robot = DiffDrive(wheel_radius=0.1, track=0.4)
    assert robot.wheel_speeds(0.5, 0.5) == pytest.approx(((0.5 - 0.1) / 0.1, (0.5 + 0.1) / 0.1))
    assert robot.twist(4.0, 6.0) == pytest.approx((0.05 * 10.0, 0.1 / 0.4 * 2.0))


def test_a_command_beyond_the_limits_keeps_its_curvature():
    robot = DiffDrive()
    left, right = robot.wheel_speeds(5.0, 4.0)
    assert max(abs(left), abs(right)) == pytest.approx(robot.max_wheel_speed)
    speed, yaw_rate = robot.twist(left, right)
    assert speed / yaw_rate == pytest.approx(5.0 / 4.0)


def test_the_number_of_steps_is_exact_despite_rounding():
    for period, duration, steps in [(0.1, 0.3, 3), (0.05, 15.0, 300), (0.03, 2.1, 70)]:
        assert Scenario(duration=duration, control_period=period).steps == steps
