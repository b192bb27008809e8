"""Routes round known obstacles: clear of them all, and one for each way of passing them."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from drake_shared.scenario import Circle, Goal, Scenario, Workspace, load_scenario
from drake_shared.scenario.paths import passing_side
from drake_shared.scenario.planar_distance import PlanarDistance
from drake_shared.scenario.route_planner import equidistant, plan_routes

SHIPPED = ("two_obstacles", "three_obstacles", "doorway")


def clearance(scenario, points) -> float:
    fine = equidistant(points, 1_000)
    return PlanarDistance(scenario.static_obstacles).least(*fine.T).min() - scenario.robot.footprint_radius


def ways(routes) -> list[tuple]:
    return [tuple(sorted(route.passes.items())) for route in routes]


@pytest.fixture(scope="module", params=SHIPPED)
def planned(request):
    scenario = load_scenario(request.param)
    return scenario, plan_routes(scenario)


def test_every_route_leads_from_start_to_goal_clear_of_obstacles(planned):
    scenario, routes = planned
    for route in routes:
        np.testing.assert_allclose(route.points[0], [scenario.start.x, scenario.start.y])
        np.testing.assert_allclose(route.points[-1], [scenario.goal.x, scenario.goal.y])
        assert clearance(scenario, route.points) > 0.1


def test_every_way_of_a_scenario_that_people_are_shown_is_found_once(planned):
    scenario, routes = planned
    found = ways(routes)
    assert len(set(found)) == len(found)
    for route in scenario.routes:
        passes = {name: side == "left" for name, side in route.sides.items()}
        assert tuple(sorted(passes.items())) in found


def test_a_route_passes_each_obstacle_on_the_side_that_it_names(planned):
    scenario, routes = planned
    for route in routes:
        for obstacle in scenario.obstacles:
            side = passing_side(route.points, (obstacle.x, obstacle.y))
            assert route.passes[obstacle.name] == (side == "left")


def test_routes_are_sorted_by_cost_and_limited():
    scenario = load_scenario("two_obstacles")
    costs = [route.cost for route in plan_routes(scenario, longest=10.0)]
    assert costs == sorted(costs)
    assert len(costs) == 4  # Two obstacles, each passed on either side.
    assert [route.cost for route in plan_routes(scenario, most=1)] == costs[:1]
    assert [route.cost for route in plan_routes(scenario, longest=1.2)] == costs[:2]


def test_the_routes_scale_with_the_scenario():
    small, large = (
        Scenario(
            goal=Goal(x=4.0 * scale, y=0.0),
            workspace=Workspace(x_min=-0.5 * scale, x_max=4.5 * scale, y_min=-1.5 * scale, y_max=1.5 * scale),
            obstacles=[Circle(name="pillar", x=2.0 * scale, y=0.1 * scale, radius=0.3 * scale)],
            robot=dataclasses.replace(load_scenario("two_obstacles").robot, footprint_radius=0.267 * scale),
        )
        for scale in (1.0, 10.0)
    )
    for one, other in zip(plan_routes(small), plan_routes(large), strict=True):
        np.testing.assert_allclose(10.0 * one.points, other.points, atol=0.05)


def test_there_is_no_route_through_a_wall():
    walled = Scenario(
        goal=Goal(x=4.0, y=0.0),
        workspace=Workspace(x_min=-0.5, x_max=4.5, y_min=-0.5, y_max=0.5),
        obstacles=[Circle(name="plug", x=2.0, y=0.0, radius=0.45)],
    )
    assert plan_routes(walled) == []


@pytest.mark.parametrize("tree", [-2.0, 2.0, 0.1])
def test_a_workspace_too_large_to_search_has_the_straight_line_alone_if_it_is_clear(tree):
    road = Scenario(
        goal=Goal(x=20_000.0, y=0.0),
        workspace=Workspace(x_min=-1.0, x_max=20_001.0, y_min=-5.0, y_max=5.0),
        obstacles=[Circle(name="tree", x=7_000.0, y=tree, radius=1.0)],
    )
    found = plan_routes(road)
    if tree == 0.1:
        assert found == []
        return
    (route,) = found
    assert not route.points[:, 1].any()
    assert (route.points[-1, 0], route.cost) == (20_000.0, 20_000.0)
    assert route.passes == {"tree": passing_side(route.points, (7_000.0, tree)) == "left"}


@settings(max_examples=12, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0.8, 4.2), st.floats(-1.0, 1.0), st.floats(0.1, 0.4)), min_size=1, max_size=4
    )
)
def test_no_route_of_a_random_world_touches_an_obstacle(circles):
    world = Scenario(
        goal=Goal(x=5.0, y=0.0),
        workspace=Workspace(x_min=-0.7, x_max=5.7, y_min=-1.9, y_max=1.9),
        obstacles=[Circle(name=f"o{k}", x=x, y=y, radius=r) for k, (x, y, r) in enumerate(circles)],
    )
    routes = plan_routes(world)
    assert len(set(ways(routes))) == len(routes)
    for route in routes:
        # The ends may lie beside an obstacle; the planner chooses what lies between.
        inner = route.points[2:-2]
        near = [
            np.hypot(*(np.array(end) - [x, y])) - r - world.robot.footprint_radius
            for end in ((0.0, 0.0), (5.0, 0.0))
            for x, y, r in circles
        ]
        if min(near) > 0.1:
            assert clearance(world, inner) > 0.0
