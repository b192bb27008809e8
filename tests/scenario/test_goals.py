"""Several goals in a scenario: which routes lead to which, and tasks that cannot be driven."""

import copy
import dataclasses
import json

import pytest

from drake_shared.common.errors import InputError
from drake_shared.operators.named import changes_of_route
from drake_shared.scenario import Circle, Goal, Scenario, load_scenario, scenario_from_dict
from drake_shared.scenario.passages import widest_passage
from drake_shared.scenario.route_planner import plan_routes

TASK = """\
name: two_goals
goals:
- {name: shelf, x: 5.0, y: 1.0}
- {name: dock, x: 5.0, y: -1.0, radius: 0.3}
workspace: {x_min: -0.7, x_max: 5.7, y_min: -1.6, y_max: 1.6}
obstacles:
- !Circle {name: pillar, x: 2.5, y: 0.0, radius: 0.25}
routes:
- name: to_shelf
  waypoints: [[0.0, 0.0], [2.5, 0.9], [5.0, 1.0]]
  sides: {pillar: left}
- name: to_dock
  waypoints: [[0.0, 0.0], [2.5, -0.9], [5.0, -1.0]]
  sides: {pillar: right}
- name: round_to_dock
  waypoints: [[0.0, 0.0], [2.5, 0.8], [5.0, -1.0]]
  sides: {pillar: left}
"""


@pytest.fixture
def load(tmp_path):
    """Reads the task with one thing changed."""

    def apply(old: str = "", new: str = "") -> Scenario:
        assert old in TASK
        file = tmp_path / "task.yaml"
        file.write_text(TASK.replace(old, new, 1))
        return load_scenario(file)

    return apply


def test_a_route_leads_to_the_goal_at_its_last_waypoint(load):
    scenario = load()
    assert [scenario.goal_of(route).name for route in scenario.routes] == ["shelf", "dock", "dock"]
    assert scenario.goal == scenario.all_goals[0]


def test_one_goal_is_a_list_of_one(scenario):
    assert scenario.all_goals == [scenario.goal]


def test_a_log_holds_all_goals(load):
    scenario = load()
    data = json.loads(json.dumps(dataclasses.asdict(scenario)))
    assert scenario_from_dict(data) == scenario


def test_a_log_written_before_there_were_several_goals_is_read(scenario):
    data = dataclasses.asdict(scenario)
    del data["goals"], data["goal"]["name"]
    assert scenario_from_dict(data) == scenario


def test_routes_are_planned_to_every_goal(load):
    planned = plan_routes(load())
    assert {(route.goal.name, route.passes["pillar"]) for route in planned} == {
        (goal, left) for goal in ("shelf", "dock") for left in (True, False)
    }
    for route in planned:
        assert route.points[-1] == pytest.approx([route.goal.x, route.goal.y])


def test_an_operator_may_change_to_another_goal_past_the_same_sides(load):
    changes = [(route.name, then.name) for route, then in changes_of_route(load())]
    assert ("to_shelf", "round_to_dock") in changes


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("x: 5.0, y: 1.0}", "x: 5.0}", "goals[0].y"),
        ("radius: 0.3", "radius: 0.0", "goals: dock.radius"),
        ("name: dock, ", "", "goals"),
        ("name: dock", "name: shelf", "goals"),
        ("goals:", "goal: {x: 4.0, y: 0.0}\ngoals:", "goal"),
        ("x: 5.0, y: -1.0", "x: 2.5, y: -0.5", "goals: dock"),
        ("x: 5.0, y: -1.0", "x: 6.5, y: -1.0", "goals: dock"),
        # Nothing leads to a goal; a route ends beside its goal; a route leads through another goal.
        ("- {name: dock", "- {name: bay, x: 4.0, y: 0.5}\n- {name: dock", "goals: bay"),
        ("[2.5, 0.9], [5.0, 1.0]", "[2.5, 0.9], [5.0, 1.1]", "routes: to_shelf"),
        ("[5.0, 1.0]]", "[4.9, -0.9], [5.0, 1.0]]", "routes: to_shelf"),
    ],
)
def test_bad_goals_are_refused(load, old, new, field):
    with pytest.raises(InputError) as caught:
        load(old, new)
    assert caught.value.field == field


def test_no_way_between_obstacles_is_told_with_its_width_and_that_of_the_robot(load):
    walls = "".join(
        f"- !Box {{name: wall_{name}, x: 4.0, y: {y}, length: 0.2, width: 1.4}}\n"
        for name, y in (("above", 0.9), ("below", -0.9))
    )
    with pytest.raises(InputError) as caught:
        load("obstacles:\n", f"obstacles:\n{walls}")
    assert caught.value.field == "goals: shelf"
    assert "0.534 m" in str(caught.value)
    assert "0.4" in str(caught.value).split("about")[1]


def test_the_widest_passage_is_the_gap_between_two_pillars(open_floor):
    scenario = copy.deepcopy(open_floor)
    assert widest_passage(scenario, scenario.goal) == float("inf")
    scenario.obstacles = [Circle(name=f"p{y}", x=2.0, y=y, radius=0.2) for y in (-2.0, -1.0, 0.6, 2.0)]
    assert widest_passage(scenario, scenario.goal) == pytest.approx(1.6 - 0.4, abs=0.03)
    assert widest_passage(scenario, Goal(x=2.0, y=0.9)) == pytest.approx(2 * 0.1, abs=0.03)
