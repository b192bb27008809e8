"""Lower bounds of gaps along braking paths, compared with the gaps along the exact motion."""

import math

import numpy as np
import pytest

from drake_shared.arbitration.safety.braking_paths import BrakingPaths
from drake_shared.arbitration.safety.gap_bounds import GapBounds
from drake_shared.arbitration.safety.obstacle_motion import ObstacleMotion
from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import motion

ROBOT = DiffDrive()
RADIUS = ROBOT.footprint_radius
PERIOD = 0.05
REACH = 2.0
ORIGIN = (0.0, 0.0, 0.0)
AHEAD = (8.0, 8.0)


def exact_path(pose, wheels, command, until: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Times and positions (complex) every 5 ms in the period, and then while the robot brakes and stands."""
    times, points = [0.0], [complex(*pose[:2])]
    for target, duration in ((command, PERIOD), ((0.0, 0.0), max(1.0, until))):
        for step in np.arange(0.005, duration + 1e-9, 0.005):
            times.append(step if target is command else PERIOD + step)
            points.append(complex(*motion(ROBOT, pose, wheels, target, step)[-1][:2]))
        pose, wheels = motion(ROBOT, pose, wheels, target, duration)[-1], target
    return np.array(times), np.array(points)


def random_case(rng):
    """Four circles beside the path of one command from a random pose: circles, pose, wheels, command."""
    pose = *rng.uniform(-1.0, 1.0, 2), rng.uniform(-math.pi, math.pi)
    wheels = rng.uniform(-8.0, 8.0, 2)
    command = tuple((wheels + rng.uniform(-0.5, 0.5, 2)).tolist())
    circles = []
    while len(circles) < 4:
        center, radius = complex(*rng.uniform(-2.0, 2.0, 2)), rng.uniform(0.1, 0.4)
        if abs(center - complex(*pose[:2])) > radius + RADIUS:
            circles.append((center, radius))
    return circles, pose, tuple(wheels.tolist()), command


def gaps_of(points, circles) -> np.ndarray:
    """Gaps (4, t) of the body at ``points`` (t,) to circles."""
    return np.array([abs(points - center) - radius - RADIUS for center, radius in circles])


def random_bounds(make_query, *, seed: int, count: int):
    """Bounds among circles, the braking path of one command, and the exact gaps along it: shape (4, t)."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        circles, pose, wheels, command = random_case(rng)
        bounds = GapBounds(make_query(circles), RADIUS, pose, 10.0, {})
        paths = BrakingPaths(ROBOT, pose, wheels, [command], PERIOD)
        yield bounds, paths, gaps_of(exact_path(pose, wheels, command)[1], circles)


def test_a_wall_ahead_is_as_near_as_at_the_end_of_the_path(make_query):
    bounds = GapBounds(make_query(wall=1.0), RADIUS, ORIGIN, REACH, {})
    paths = BrakingPaths(ROBOT, ORIGIN, AHEAD, [AHEAD, (7.6, 7.6)], PERIOD)
    assert bounds.count == 1
    assert bounds.at_start() == pytest.approx(1.0 - RADIUS)
    np.testing.assert_allclose(bounds.least(paths)[:, 0], 1.0 - RADIUS - paths.points[:, -1].real, atol=1e-12)


def test_obstacles_beyond_the_reach_are_left_out(make_query):
    query = make_query([(1.0 + 0.0j, 0.2), (5.0 + 0.0j, 0.2)], wall=1.5)
    assert GapBounds(query, RADIUS, ORIGIN, REACH, {}).count == 2
    assert GapBounds(query, RADIUS, ORIGIN, 0.6, {}).count == 1
    nothing = GapBounds(query, RADIUS, ORIGIN, 0.1, {})
    assert nothing.count == 0
    assert nothing.at_start() == math.inf


def test_bounds_lie_below_the_gaps_and_touch_them_where_they_were_measured(make_query):
    for bounds, paths, gaps in random_bounds(make_query, seed=1, count=60):
        assert bounds.at_start() == pytest.approx(gaps[:, 0].min())
        loose = bounds.least(paths)[0]
        assert (loose <= gaps.min(axis=1) + 2e-6).all()
        # What is measured along the path makes the bounds higher, and those of other paths as well.
        kept = bounds.gaps_kept(paths, 10.0)
        tight = bounds.least(paths)[0]
        assert (tight >= loose - 5e-6).all()
        np.testing.assert_allclose(tight, gaps.min(axis=1), atol=3e-3)
        assert (tight <= gaps.min(axis=1) + 2e-6).all()
        np.testing.assert_allclose(kept, gaps.min(axis=1), atol=2e-3)


def test_a_path_violates_what_its_gaps_do_not_reach(make_query):
    for bounds, paths, gaps in random_bounds(make_query, seed=2, count=40):
        least = gaps.min(axis=1)
        assert bounds.find_violation(paths, least - 5e-3) is None
        for index in range(4):
            required = least - 0.1
            required[index] = least[index] + 1e-3
            found = bounds.find_violation(paths, required)
            assert found is not None
            assert found[index] < required[index]
            assert (found <= least + 2e-6).all()


def test_the_gaps_that_a_path_keeps_are_at_most_the_clearance(make_query):
    circles = [(0.9 + 0.0j, 0.3), (-3.0 + 0.0j, 0.3)]
    bounds = GapBounds(make_query(circles), RADIUS, ORIGIN, 10.0, {})
    paths = BrakingPaths(ROBOT, ORIGIN, AHEAD, [AHEAD], PERIOD)
    end = paths.points[0, -1]
    ahead = 0.6 - RADIUS - end.real
    np.testing.assert_allclose(bounds.gaps_kept(paths, 5.0), [ahead, 2.7 - RADIUS], atol=1e-6)
    np.testing.assert_allclose(bounds.gaps_kept(paths, 0.5), [ahead, 0.5], atol=1e-6)
    np.testing.assert_array_equal(bounds.gaps_kept(paths, ahead - 1e-4), np.full(2, ahead - 1e-4))


def moving(start: complex, velocity: complex, *, horizon: float = 1.0) -> ObstacleMotion:
    times = np.array([-1.0, 9.0])
    return ObstacleMotion(times, start + velocity * times, period=PERIOD, horizon=horizon)


def test_a_moving_obstacle_is_as_near_as_its_motion_brings_it(make_query):
    """A driving robot and a circle that passes, at many speeds; a period ago counts as well."""
    rng = np.random.default_rng(3)
    for _ in range(40):
        circles, pose, wheels, command = random_case(rng)
        velocity = rng.uniform(0.1, 0.6) * np.exp(1j * rng.uniform(-math.pi, math.pi))
        moves = {0: moving(circles[0][0], velocity)}
        bounds = GapBounds(make_query(circles), RADIUS, pose, 10.0, moves)
        paths = BrakingPaths(ROBOT, pose, wheels, [command], PERIOD)
        times, points = exact_path(pose, wheels, command)
        within = times <= 1.0
        times, points = times[within], points[within]
        now = gaps_of(points - velocity * times, circles[:1])[0].min()
        earlier = gaps_of(points - velocity * np.maximum(times - PERIOD, 0.0), circles[:1])[0].min()
        static = gaps_of(points, circles)[1:].min(axis=1)
        assert bounds.at_start() == pytest.approx(gaps_of(points[:1], circles)[1:].min())
        least = np.array([min(now, earlier), *static])
        assert (bounds.least(paths)[0] <= least + 2e-6).all()
        required = least - 0.02
        assert bounds.find_violation(paths, required) is None
        required[0] = least[0] + 1e-3
        assert bounds.find_violation(paths, required) is not None


def test_the_robot_at_rest_keeps_to_an_obstacle_what_the_horizon_leaves(make_query):
    still = BrakingPaths(ROBOT, ORIGIN, (0.0, 0.0), [(0.0, 0.0)], PERIOD)
    for speed, kept in ((0.0, 0.5), (0.2, 0.3), (0.4, 0.1)):
        motions = {0: moving(0.7 + RADIUS, -speed)}
        bounds = GapBounds(make_query([(0.7 + RADIUS, 0.2)]), RADIUS, ORIGIN, 10.0, motions)
        np.testing.assert_allclose(bounds.gaps_kept(still, 0.5), kept, atol=1e-9)
        np.testing.assert_allclose(bounds.gaps_kept(still, 0.05), 0.05)


def test_an_obstacle_that_hits_a_braking_robot_is_taken_to_stop_there(make_query):
    still = BrakingPaths(ROBOT, ORIGIN, (0.0, 0.0), [(0.0, 0.0)], PERIOD)
    motion_of = moving(0.7 + RADIUS, -1.0)
    bounds = GapBounds(make_query([(0.7 + RADIUS, 0.2)]), RADIUS, ORIGIN, 10.0, {0: motion_of})
    np.testing.assert_allclose(bounds.gaps_kept(still, 0.05), 0.0, atol=1e-9)
    # It would touch the robot after 0.5 s, and goes no farther.
    np.testing.assert_allclose(motion_of.displacement([0.4, 0.5, 0.9]), [-0.4, -0.5, -0.5], atol=1e-9)


def test_into_an_obstacle_that_stopped_at_the_contact_the_robot_goes_on_braking(make_query):
    paths = BrakingPaths(ROBOT, ORIGIN, AHEAD, [AHEAD], PERIOD)
    motion_of = moving(0.35 + 0.2 + RADIUS, -0.5)
    bounds = GapBounds(make_query([(0.35 + 0.2 + RADIUS, 0.2)]), RADIUS, ORIGIN, 10.0, {0: motion_of})
    kept = bounds.gaps_kept(paths, 0.05)
    times, points = exact_path(ORIGIN, AHEAD, AHEAD)
    contact = times[np.argmax(points.real + 0.5 * times >= 0.35)]
    assert motion_of.displacement(0.99).real == pytest.approx(-0.5 * contact, abs=5e-3)
    np.testing.assert_allclose(kept, 0.35 - 0.5 * contact - points[-1].real, atol=5e-3)
