"""Distances in closed form are those that a SceneGraph measures."""

import math

import numpy as np
import pytest

from drake_shared.scenario.obstacles import Box, Circle, ObstacleDistance
from drake_shared.scenario.planar_distance import PlanarDistance

OBSTACLES = {
    "circle": Circle(name="circle", x=1.0, y=-0.5, radius=0.3),
    "box": Box(name="box", x=-0.4, y=0.2, length=0.8, width=0.3),
    "turned": Box(name="turned", x=0.1, y=0.9, length=0.5, width=0.5, yaw=0.7),
}


@pytest.mark.parametrize("name", OBSTACLES)
def test_distances_inside_and_outside_are_those_of_the_scene_graph(name):
    points = np.random.default_rng(1).uniform(-2.0, 2.0, (500, 2))
    theirs = ObstacleDistance([OBSTACLES[name]])(points)
    ours = PlanarDistance([OBSTACLES[name]])
    np.testing.assert_allclose(ours.least(*points.T), theirs, rtol=0.0, atol=1e-12)
    assert theirs.min() < 0.0
    single = [ours.within(x, y, math.inf)[0][0] for x, y in points]
    np.testing.assert_allclose(single, theirs, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", OBSTACLES)
def test_the_gradient_is_the_change_of_the_distance(name):
    distance, step = PlanarDistance([OBSTACLES[name]]), 1e-7
    for x, y in np.random.default_rng(2).uniform(-2.0, 2.0, (100, 2)):
        ((value, gradient_x, gradient_y),) = distance.within(x, y, math.inf)
        assert (distance.within(x + step, y, math.inf)[0][0] - value) / step == pytest.approx(
            gradient_x, abs=1e-5
        )
        assert (distance.within(x, y + step, math.inf)[0][0] - value) / step == pytest.approx(
            gradient_y, abs=1e-5
        )


def test_without_obstacles_the_distance_is_infinite():
    assert PlanarDistance([]).least(np.zeros(2), np.zeros(2)).tolist() == [math.inf, math.inf]
