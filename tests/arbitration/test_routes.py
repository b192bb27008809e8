"""The routes that a driver may intend, and the points of them to which a robot steers."""

import dataclasses

import numpy as np
import pytest

from drake_shared.arbitration.route_guide import RouteGuide
from drake_shared.arbitration.route_pursuit import RoutePursuit
from drake_shared.arbitration.routes import POINTS, Routes, routes_of
from drake_shared.common.errors import InputError
from drake_shared.scenario import Circle, Goal, Workspace, load_scenario
from drake_shared.scenario.route_planner import plan_routes

SCENARIO = dataclasses.replace(load_scenario("two_obstacles"), obstacles=[], goal=Goal(x=5.0, y=1.0))
ROBOT = SCENARIO.robot
# Straight ahead, and a long way to the left, in 5 m and 4 m.
ROUTES = Routes(
    points=np.stack(
        [
            np.stack([np.linspace(0.0, 5.0, POINTS), np.zeros(POINTS)], axis=-1),
            np.stack([np.zeros(POINTS), np.linspace(0.0, 4.0, POINTS)], axis=-1),
        ]
    ),
    lengths=np.array([5.0, 4.0]),
    demonstrated=np.array([True, False]),
)
# In the travel time every route is taken as a whole.
AHEAD = 0.1 * SCENARIO.travel_time
POSES = np.array([[1.5, 0.1, 0.2], [4.9, -0.1, 0.0]]).T  # Of two robots: in the middle, and near the end.


def test_the_robot_steers_to_the_points_ahead_of_it_on_each_route_and_straight_to_the_goal():
    guide = RouteGuide(ROUTES, SCENARIO, ROBOT)
    progress = np.array([[60, 196], [4, 0]])
    left, right, target = guide.commands(progress, POSES, np.array([AHEAD, 2.0 * AHEAD]))
    expected = [[2.0, 5.0], [0.48j, 0.4j]]
    np.testing.assert_allclose(target[0, :2], expected)
    np.testing.assert_allclose(target[1, :2], [[2.5, 5.0], [0.88j, 0.8j]])
    # To the goal at the mean speed of the routes, but no further than the goal.
    to_goal = 5.0 + 1.0j - (POSES[0] + 1j * POSES[1])
    np.testing.assert_allclose(target[0, 2], POSES[0] + 1j * POSES[1] + 0.45 * to_goal / np.abs(to_goal))
    near = guide.commands(progress, np.array([[4.9, 0.9, 0.0]] * 2).T, np.array([AHEAD]))[2]
    np.testing.assert_allclose(near[0, 2], 5.0 + 1.0j)
    for row, column in np.ndindex(3, 2):
        x, y = target[0, row, column].real, target[0, row, column].imag
        command = ROBOT.command_toward(POSES[:, column].tolist(), (x, y), AHEAD)
        np.testing.assert_allclose([left[0, row, column], right[0, row, column]], command)
    pursuit = RoutePursuit(ROUTES, robot=ROBOT, look_ahead=AHEAD, travel_time=SCENARIO.travel_time)
    np.testing.assert_allclose(pursuit.commands(progress, POSES), np.stack([left[0, :2], right[0, :2]]))


def test_progress_on_a_route_is_the_nearest_point_and_never_goes_back():
    guide = RouteGuide(ROUTES, SCENARIO, ROBOT)
    start = guide.initial_progress(1)
    assert not start.any()
    first = guide.advance(start, np.array([[0.301], [0.2], [0.0]]))
    np.testing.assert_array_equal(first, [[12], [10]])
    np.testing.assert_array_equal(guide.advance(first, np.zeros((3, 1))), first)
    at_end = guide.advance(np.array([[195], [199]]), np.array([[7.0], [9.0], [0.0]]))
    np.testing.assert_array_equal(at_end, [[POINTS - 1], [POINTS - 1]])


def is_blocked(
    pillar_y: float, x: float, y: float, *, workspace: Workspace = SCENARIO.workspace
) -> list[bool]:
    """Of both routes and the goal, from a place beside a pillar at x = 3 m."""
    pillar = Circle(name="pillar", x=3.0, y=pillar_y, radius=0.2)
    scenario = dataclasses.replace(SCENARIO, obstacles=[pillar], workspace=workspace)
    guide = RouteGuide(ROUTES, scenario, ROBOT)
    pose = np.array([[x], [y], [0.0]])
    *_, target = guide.commands(np.array([[80], [0]]), pose, np.array([10 * AHEAD]))
    return guide.is_blocked(pose, target[0])[:, 0].tolist()


def test_a_line_that_leads_through_an_obstacle_is_blocked():
    assert is_blocked(0.5, 1.0, 0.0) == [False, False, True]  # The pillar stands in front of the goal,
    assert is_blocked(0.5, 1.0, 1.0) == [True, False, False]  # and in front of the end of the first route.
    # Half of the robot's radius is room enough beside it.
    radius = ROBOT.footprint_radius
    assert is_blocked(1.0 - 0.2 - 0.4 * radius, 2.0, 1.0)[2]
    assert not is_blocked(1.0 - 0.2 - 0.7 * radius, 2.0, 1.0)[2]


def test_a_workspace_of_kilometres_is_searched_in_larger_cells():
    large = Workspace(x_min=-1e4, x_max=1e4, y_min=-100.0, y_max=100.0)
    assert is_blocked(0.5, 1.0, 0.0, workspace=large)[2]
    assert not is_blocked(50.0, 1.0, 0.0, workspace=large)[2]


def test_a_position_is_projected_onto_a_route_wherever_the_search_begins():
    pursuit = RoutePursuit(ROUTES, robot=ROBOT, look_ahead=AHEAD, travel_time=SCENARIO.travel_time)
    for near in (0, 40, POINTS - 1):
        index, left, distance = pursuit.project(np.array([1.51 - 0.3j]), np.full((2, 1), near))
        assert index[0, 0] == 60
        np.testing.assert_allclose((left[0, 0], distance[0, 0]), (3.49, 0.3))
    # Beyond the end nothing is left, and the distance is that to the end.
    _, left, distance = pursuit.project(np.array([5.3 + 0.4j]), np.full((2, 1), POINTS - 1))
    assert left[0, 0] == 0.0
    assert 0.4 < distance[0, 0] <= 0.5
    assert not pursuit.initial(3).any()
    assert pursuit.initial(3).shape == (2, 3)


def test_a_demonstrated_route_is_kept_unless_an_obstacle_now_stands_on_it():
    scenario = load_scenario("two_obstacles")
    path = scenario.points_of(scenario.route("left_left"), 80)
    ways = plan_routes(scenario)
    planned = routes_of(scenario, [], planned=ways)
    routes = routes_of(scenario, [path], planned=ways)
    # It takes the place of the planned route on the same sides.
    assert routes.demonstrated.tolist() == [True] + [False] * (len(planned.lengths) - 1)
    assert routes.points.shape == (len(planned.lengths), POINTS, 2)
    np.testing.assert_allclose(routes.points[0][[0, -1]], path[[0, -1]])
    steps = np.hypot(*np.diff(routes.points, axis=1).transpose(2, 0, 1))
    np.testing.assert_allclose(steps.sum(axis=1), routes.lengths)
    np.testing.assert_allclose(steps[0], routes.lengths[0] / (POINTS - 1), rtol=0.01)
    x, y = path[40]
    crate = Circle(name="crate", x=x, y=y, radius=0.05)
    blocked = dataclasses.replace(scenario, obstacles=[*scenario.obstacles, crate])
    assert not routes_of(blocked, [path], planned=ways).demonstrated.any()


def test_without_a_route_there_is_nothing_to_choose_from():
    with pytest.raises(InputError) as caught:
        routes_of(SCENARIO, [], planned=[])
    assert caught.value.field == "obstacles"
