"""Distances to obstacles, against geometry done by hand."""

import math

import numpy as np
import pytest
from pydrake.geometry import Role, SceneGraph

from drake_shared.scenario.obstacles import Box, Circle, ObstacleDistance, least_distance, register_obstacles

CIRCLE = Circle(name="pillar", x=1.4, y=-0.3, radius=0.25)
WALL = Box(name="wall", x=2.0, y=1.0, length=1.0, width=0.2, yaw=math.radians(30))


def distance_to_box(box: Box, x: float, y: float) -> float:
    cos, sin = math.cos(box.yaw), math.sin(box.yaw)
    along = abs(cos * (x - box.x) + sin * (y - box.y)) - box.length / 2
    across = abs(cos * (y - box.y) - sin * (x - box.x)) - box.width / 2
    return math.hypot(max(along, 0.0), max(across, 0.0)) + min(max(along, across), 0.0)


def test_distance_to_a_circle_is_exact():
    rng = np.random.default_rng(1)
    points = rng.uniform(-1, 4, (300, 2))
    expected = np.hypot(points[:, 0] - 1.4, points[:, 1] + 0.3) - 0.25
    np.testing.assert_allclose(ObstacleDistance([CIRCLE])(points), expected, atol=1e-12)


def test_distance_to_a_turned_box_is_exact_outside_and_in():
    rng = np.random.default_rng(2)
    points = rng.uniform(0, 3, (300, 2))
    expected = [distance_to_box(WALL, x, y) for x, y in points]
    assert min(expected) < 0
    np.testing.assert_allclose(ObstacleDistance([WALL])(points), expected, atol=1e-12)


def test_obstacles_have_no_top_to_be_near_to():
    pillar = Circle(name="pillar", x=1.0, y=2.0, radius=5.0)
    np.testing.assert_allclose(ObstacleDistance([pillar])([[1.0, 2.5]]), [-4.5], atol=1e-12)


def test_the_nearest_obstacle_counts():
    points = np.array([[1.4, -0.9], [2.0, 2.0]])
    together = ObstacleDistance([CIRCLE, WALL])(points)
    np.testing.assert_allclose(together[0], ObstacleDistance([CIRCLE])(points[:1])[0])
    np.testing.assert_allclose(together[1], ObstacleDistance([WALL])(points[1:])[0])


def test_without_obstacles_everything_is_infinitely_far():
    np.testing.assert_array_equal(ObstacleDistance([])([[0.0, 0.0]]), [math.inf])


def test_one_point_and_many_agree():
    points = np.array([[0.0, 0.0], [1.0, 0.5]])
    distance = ObstacleDistance([CIRCLE, WALL])
    np.testing.assert_array_equal(distance(points), [distance(point)[0] for point in points])


def test_each_obstacle_is_felt_once_and_drawn_once():
    scene_graph = SceneGraph()
    felt = register_obstacles(scene_graph, [CIRCLE, WALL])
    inspector = scene_graph.model_inspector()
    assert len(felt) == len(set(felt)) == 2
    assert inspector.NumGeometriesWithRole(Role.kProximity) == 2
    assert inspector.NumGeometriesWithRole(Role.kIllustration) == 2
    assert all(inspector.GetProximityProperties(item) is not None for item in felt)
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())
    assert least_distance(query, 1.4, -0.8) == pytest.approx(0.25, abs=1e-12)


def test_the_bounding_circle_holds_every_corner():
    assert CIRCLE.bounding_radius() == 0.25
    assert WALL.bounding_radius() == pytest.approx(math.hypot(0.5, 0.1))
    assert distance_to_box(WALL, WALL.x + 0.5 * math.cos(WALL.yaw), WALL.y + 0.5 * math.sin(WALL.yaw)) == (
        pytest.approx(0.0, abs=1e-12)
    )
