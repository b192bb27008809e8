"""The safety filters of many trials do what the barrier does for each of them, with Drake's distances."""

import numpy as np
import pytest
from pydrake.geometry import SceneGraph

from drake_shared.arbitration.safety.barrier import safe_command
from drake_shared.scenario import load_scenario
from drake_shared.scenario.obstacles import least_distance, register_obstacles
from drake_shared.scenario.planar_distance import PlanarDistance
from drake_shared.simulation.lockstep.safety import SafetyFilters

CLEARANCE = 0.05


@pytest.mark.parametrize("name", ["two_obstacles", "doorway"])
def test_any_command_in_any_state_is_filtered_as_by_the_barrier(name):
    scenario = load_scenario(name)
    robot, period, count = scenario.diff_drive, scenario.control_period, 600
    scene_graph = SceneGraph()
    register_obstacles(scene_graph, scenario.obstacles)
    context = scene_graph.CreateDefaultContext()
    query = scene_graph.get_query_output_port().Eval(context)
    random = np.random.default_rng(3)
    places = np.array([[obstacle.x, obstacle.y] for obstacle in scenario.obstacles])
    x, y = places[random.integers(len(places), size=count)].T + random.uniform(-1.0, 1.0, (2, count))
    distance, gradient = PlanarDistance(scenario.obstacles).nearest(x, y)
    np.testing.assert_allclose(distance, [least_distance(query, *place) for place in zip(x, y, strict=True)])
    # Robots that drive, forward or backward, more or less toward an obstacle.
    speed = random.uniform(-robot.max_wheel_speed, robot.max_wheel_speed, count)
    yaw = np.arctan2(*(-np.sign(speed) * gradient.T)[::-1]) + random.uniform(-0.7, 0.7, count)
    clear = distance - robot.footprint_radius > CLEARANCE
    pose, clearance = np.stack([x, y, yaw])[:, clear], (distance - robot.footprint_radius)[clear]
    wheels = (speed + random.uniform(-1.0, 1.0, (2, count)))[:, clear]
    command = random.uniform(-robot.max_wheel_speed, robot.max_wheel_speed, (2, clear.sum()))
    safe = SafetyFilters(scenario, CLEARANCE).apply(pose, wheels, command, clearance)
    expected = [
        safe_command(
            robot,
            tuple(pose[:, row]),
            tuple(wheels[:, row]),
            tuple(command[:, row]),
            clearance=CLEARANCE,
            query=lambda x, y, most: query.ComputeSignedDistanceToPoint(np.array([x, y, 0.0]), most),
            period=period,
        )
        for row in range(pose.shape[1])
    ]
    np.testing.assert_allclose(safe.T, expected, rtol=0.0, atol=1e-6)
    changed = (safe != command).any(axis=0)
    assert 20 < changed.sum() < 0.5 * len(changed)


def test_a_command_that_is_not_finite_counts_as_zero():
    scenario = load_scenario("two_obstacles")
    filters = SafetyFilters(scenario, CLEARANCE)
    command = np.array([[np.nan, 3.0], [2.0, np.inf]])
    pose, wheels = np.zeros((3, 2)), np.zeros((2, 2))
    safe = filters.apply(pose, wheels, command, np.full(2, 1.0))
    np.testing.assert_array_equal(safe, [[0.0, 3.0], [2.0, 0.0]])
