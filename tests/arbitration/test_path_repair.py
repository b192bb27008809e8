"""Repaired paths: never through a known obstacle, never a jump, on the side on which they passed."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from drake_shared.arbitration.path_repair import PathRepair
from drake_shared.scenario import Box, Circle, Goal, Scenario, Workspace
from drake_shared.scenario.planar_distance import PlanarDistance

AHEAD = 0.1 * np.arange(1, 101)
LOOK_AHEAD = 0.6


def world(*obstacles) -> Scenario:
    return Scenario(
        goal=Goal(x=5.0, y=0.0),
        workspace=Workspace(x_min=-1.0, x_max=6.0, y_min=-3.0, y_max=3.0),
        obstacles=list(obstacles),
    )


def repair(scenario, path, *, pose=(0.0, 0.0, 0.0), now=0.0):
    """The path (100, 2) and how far its points were moved."""
    repairs = PathRepair(scenario, look_ahead=LOOK_AHEAD)
    found, moved = repairs(np.array([pose]), path[None], now + AHEAD[None], np.array([now]))
    return found[0], moved[0]


def straight(y=0.0, end=5.0) -> np.ndarray:
    return np.stack([np.linspace(0.05, end, 100), np.full(100, y)], axis=-1)


def dense(pose, path) -> np.ndarray:
    points = np.concatenate([[pose[:2]], path])
    share = np.linspace(0.0, 1.0, 10, endpoint=False)[:, None, None]
    return (points[:-1] + share * np.diff(points, axis=0)).reshape(-1, 2)


def clearance(scenario, pose, path) -> float:
    distance = PlanarDistance(scenario.obstacles).least(*dense(pose, path).T).min()
    return distance - scenario.robot.footprint_radius


coordinates = st.floats(0.6, 4.4), st.floats(-1.5, 1.5)
circles = st.builds(lambda x, y, r: Circle(name="c", x=x, y=y, radius=r), *coordinates, st.floats(0.05, 0.4))
boxes = st.builds(
    lambda x, y, a, b, yaw: Box(name="b", x=x, y=y, length=a, width=b, yaw=yaw),
    *coordinates,
    st.floats(0.1, 1.0),
    st.floats(0.1, 1.0),
    st.floats(-3.0, 3.0),
)
waves = st.tuples(*[st.floats(-1.0, 1.0)] * 3, st.floats(0.0, 1.0))


@settings(max_examples=150, deadline=None)
@given(st.lists(circles | boxes, min_size=1, max_size=5), waves, st.floats(-1.5, 1.5))
def test_no_path_leads_through_an_obstacle_or_jumps(obstacles, wave, yaw):
    scenario, pose = world(*obstacles), (0.0, 0.0, yaw)
    assume(clearance(scenario, pose, np.zeros((1, 2))) > 0.0)
    share = np.linspace(0.01, 1.0, 100)
    height = wave[3] * sum(a * np.sin((k + 1) * math.pi * share) for k, a in enumerate(wave[:3]))
    raw = np.stack([5.0 * share, height], axis=-1)
    path, moved = repair(scenario, raw, pose=pose)
    if not moved.any():
        assert np.array_equal(path, raw)
        return
    assert clearance(scenario, pose, path) > 0.0
    steps = np.hypot(*np.diff(np.concatenate([[pose[:2]], path]), axis=0).T)
    assert steps.max() <= 0.1 * scenario.robot.max_speed + 1e-9
    np.testing.assert_allclose(moved, np.hypot(*(path - raw).T))


def test_a_path_that_is_clear_keeps_its_bits():
    path, moved = repair(world(Circle(name="far", x=2.0, y=1.5, radius=0.3)), straight())
    assert np.array_equal(path, straight())
    assert not moved.any()


@pytest.mark.parametrize("y", [0.05, -0.05, 0.3, -0.3])
def test_an_obstacle_is_passed_on_the_side_of_its_centre_where_the_path_passes(y):
    path, moved = repair(world(Circle(name="pillar", x=2.5, y=0.0, radius=0.3)), straight(y))
    beside = path[np.abs(path[:, 0] - 2.5).argmin(), 1]
    assert beside * y > 0.0
    assert abs(beside) == pytest.approx(0.3 + 0.267 + 0.1, abs=0.02)
    assert path[-1] == pytest.approx(straight(y)[-1], abs=1e-6)
    assert moved.max() == pytest.approx(abs(beside - y), abs=0.05)


@pytest.mark.parametrize(
    "obstacles",
    [
        [Circle(name="left", x=1.4, y=0.1, radius=0.3), Circle(name="right", x=3.2, y=-0.1, radius=0.3)],
        [Box(name="crate", x=2.5, y=0.2, length=0.8, width=0.5, yaw=0.4)],
    ],
)
def test_where_there_is_room_the_margin_is_kept_in_a_smooth_bend_and_the_end_is_reached(obstacles):
    path, _ = repair(world(*obstacles), straight())
    assert clearance(world(*obstacles), (0.0, 0.0), path) == pytest.approx(0.1, abs=0.01)
    assert path[-1] == pytest.approx(straight()[-1], abs=1e-3)
    turns = np.abs(np.diff(np.unwrap(np.arctan2(*np.diff(path, axis=0).T[::-1]))))
    assert turns.max() < 0.25


def test_a_path_is_not_moved_out_of_the_workspace():
    pillar = Circle(name="pillar", x=2.5, y=-2.4, radius=0.3)
    path, _ = repair(world(pillar), straight(-2.5), pose=(0.0, -2.5, 0.0))
    assert path[:, 1] == pytest.approx(-2.5)
    assert 1.5 < path[-1, 0] < 2.2
    # With half a metre more there is room between the pillar and the edge.
    further = dataclasses.replace(pillar, y=-1.9)
    assert repair(world(further), straight(-2.0), pose=(0.0, -2.0, 0.0))[0][-1, 0] == pytest.approx(5.0)


def test_a_path_ends_before_a_wall_without_a_way_beside_it():
    scenario = world(Box(name="wall", x=2.5, y=0.0, length=0.1, width=7.0))
    path, moved = repair(scenario, straight())
    assert path[:, 0].max() <= 2.45 - scenario.robot.footprint_radius
    assert path[-1, 0] > 1.9
    assert moved[-1] > 2.5


def test_a_gap_narrower_than_the_robot_is_not_passed_and_a_wider_one_is():
    def gap(width):
        pillars = [Circle(name=f"p{side}", x=2.5, y=side * (0.3 + width / 2), radius=0.3) for side in (1, -1)]
        scenario = world(*pillars)
        path, _ = repair(scenario, straight())
        assert clearance(scenario, (0.0, 0.0), path) > 0.0
        return path

    assert abs(gap(0.60)[:, 1]).max() < 0.05
    assert gap(0.60)[-1, 0] == pytest.approx(5.0, abs=0.1)
    crossing = gap(0.40)
    assert not ((np.abs(crossing[:, 0] - 2.5) < 0.1) & (np.abs(crossing[:, 1]) < 0.3)).any()


def test_an_obstacle_that_crosses_is_passed_where_it_will_be():
    # It is far away now, and on the path when the robot arrives.
    cart = Circle(
        name="cart", x=2.5, y=2.5, radius=0.2, path=[[0.0, 2.5, 2.5], [5.0, 2.5, 0.0], [9.0, 2.5, 0.0]]
    )
    scenario = world(cart)
    path, moved = repair(scenario, straight())
    assert moved.max() > 0.3
    y = np.interp(AHEAD, [0.0, 5.0], [2.5, 0.0])
    distance = np.hypot(path[:, 0] - 2.5, path[:, 1] - y) - 0.2
    assert distance.min() > scenario.robot.footprint_radius
    # The same path at another time leaves before the obstacle comes.
    assert not repair(
        world(dataclasses.replace(cart, path=[[20.0, 2.5, 2.5], [25.0, 2.5, 0.0]])), straight()
    )[1].any()


def test_an_obstacle_that_came_and_stands_is_like_one_that_always_stood():
    pillar = Circle(name="pillar", x=0.7, y=0.0, radius=0.3)
    cart = dataclasses.replace(pillar, path=[[0.0, 0.7, 2.5], [20.0, 0.7, 0.0], [60.0, 0.7, 0.0]])
    pose = (0.0, 0.0, 0.0)
    path, _ = repair(world(cart), straight(0.2), pose=pose, now=20.0)
    assert path == pytest.approx(repair(world(pillar), straight(0.2), pose=pose)[0])


@pytest.mark.parametrize(
    ("pose", "drives"), [((0.1, 0.0, 0.0), False), ((0.0, 0.0, 0.0), True), ((0.0, 0.0, 0.5), True)]
)
def test_a_robot_that_faces_an_obstacle_is_not_led_against_it(pose, drives):
    # The path begins beside the robot, at which it arrives on an arc: at first straight toward the obstacle.
    scenario = world(Circle(name="pillar", x=0.7, y=0.0, radius=0.3))
    path, _ = repair(scenario, straight(0.2), pose=pose)
    target = path[round(LOOK_AHEAD / 0.1) - 1]
    command = scenario.robot.command_toward(pose, target, LOOK_AHEAD)
    arc = [scenario.robot.rollout(pose, command, time) for time in np.linspace(0.0, LOOK_AHEAD, 13)]
    gaps = PlanarDistance(scenario.obstacles).least(*np.array(arc).T) - scenario.robot.footprint_radius
    assert gaps.min() >= min(gaps[0], 0.03) - 1e-9
    assert (np.hypot(*(target - pose[:2])) > 0.1) == drives


def test_a_path_that_begins_beyond_an_obstacle_does_not_jump_over_it():
    # The cart stands between the robot and its path only now.
    cart = Circle(name="cart", x=0.0, y=0.9, radius=0.1, path=[[0.0, 0.0, 0.9], [3.0, -0.9, -2.5]])
    path, moved = repair(world(cart), straight(1.8), pose=(0.0, 0.0, 1.6))
    assert moved.any()
    assert np.hypot(*path[0]) <= 0.1 * world(cart).robot.max_speed + 1e-9


def test_rows_do_not_depend_on_each_other():
    scenario = world(Circle(name="pillar", x=2.5, y=0.0, radius=0.3))
    paths = np.stack([straight(y) for y in (-0.3, 0.1, 1.5)])
    poses, now = np.zeros((3, 3)), np.zeros(3)
    times = np.repeat(AHEAD[None], 3, axis=0)
    together, _ = PathRepair(scenario, look_ahead=LOOK_AHEAD)(poses, paths, times, now)
    for row, path in enumerate(paths):
        assert np.array_equal(together[row], repair(scenario, path)[0])


def test_an_unknown_path_stays_unknown():
    path, moved = repair(world(Circle(name="pillar", x=2.5, y=0.0, radius=0.3)), np.full((100, 2), math.nan))
    assert np.isnan(path).all()
    assert not moved.any()
