"""Lengths of paths, and distances between obstacles that may move, by hand."""

import math

import numpy as np
import pytest

from drake_shared.arbitration.path_geometry import (
    arc_lengths,
    displacements,
    gap_between,
    joined,
    obstacle_distance,
)
from drake_shared.scenario import Box, Circle
from drake_shared.scenario.planar_distance import PlanarDistance

PILLAR = Circle(name="pillar", x=1.0, y=0.0, radius=0.2)
CRATE = Box(name="crate", x=2.0, y=1.0, length=1.0, width=0.4, yaw=0.3)
CART = Circle(name="cart", x=1.0, y=0.0, radius=0.2, path=[[0.0, 1.0, 0.0], [2.0, 3.0, -1.0]])


def test_the_length_of_a_path_is_the_sum_of_its_pieces():
    paths = np.array([[[0.0, 0.0], [3.0, 4.0], [3.0, 5.0]], [[1.0, 1.0], [1.0, 1.0], [0.0, 1.0]]])
    np.testing.assert_allclose(arc_lengths(paths), [[0.0, 5.0, 6.0], [0.0, 0.0, 1.0]])


def test_a_path_that_begins_behind_the_robot_is_joined_straight_at_the_point_nearest_to_it():
    path = np.stack([0.1 * np.arange(1.0, 21.0), np.full(20, 0.5)], axis=-1)
    robots = np.array([[0.4, 0.1], [0.0, 0.5], [5.0, 0.5]])
    found = joined(robots, np.stack([path] * 3))
    # The first robot is beside the fourth point.
    np.testing.assert_allclose(found[0, :4], robots[0] + 0.25 * np.arange(1, 5)[:, None] * [0.0, 0.4])
    np.testing.assert_array_equal(found[0, 4:], path[4:])
    np.testing.assert_array_equal(found[1], path)
    # A path is not cut short by a robot that is far ahead of it: only its beginning counts.
    np.testing.assert_array_equal(found[2, 12:], path[12:])
    assert (np.diff(found[2, :12, 0]) < 0.0).all()


@pytest.mark.parametrize("obstacle", [PILLAR, CRATE])
def test_the_distance_to_an_obstacle_is_that_of_the_scene(obstacle):
    points = np.random.default_rng(0).uniform(-1.0, 3.0, (3, 40, 2))
    expected = PlanarDistance([obstacle]).least(points[..., 0], points[..., 1])
    np.testing.assert_allclose(obstacle_distance(obstacle, points), expected)


def test_an_obstacle_is_displaced_by_its_path_since_the_start():
    times = np.array([[0.0, 1.0, 2.0, 9.0]])
    np.testing.assert_allclose(displacements(CART, times), [[[0, 0], [1, -0.5], [2, -1], [2, -1]]])
    assert not displacements(PILLAR, times).any()


def test_the_gap_between_static_obstacles_is_the_shortest_way_from_one_to_the_other():
    other = Circle(name="other", x=1.0, y=2.0, radius=0.5)
    assert gap_between(PILLAR, other) == pytest.approx(1.3)
    # A corner of a box, and one of its sides.
    corner = Box(name="corner", x=2.5, y=1.5, length=1.0, width=1.0)
    assert gap_between(PILLAR, corner) == pytest.approx(math.hypot(1.0, 1.0) - 0.2)
    side = Box(name="side", x=1.0, y=-1.0, length=1.0, width=0.4)
    assert gap_between(side, PILLAR) == pytest.approx(0.6)
    assert gap_between(CRATE, Circle(name="inside", x=2.0, y=1.0, radius=0.1)) == 0.0
    assert gap_between(CART, PILLAR) == gap_between(PILLAR, CART) == math.inf
