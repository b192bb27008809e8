"""Exact motion, against closed forms and against a fine integration of another kind."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import motion, motion_end, ramps, speeds_after

ROBOT = DiffDrive()
LIMIT = ROBOT.max_wheel_acceleration


def end(pose, wheels, command, duration, robot=ROBOT):
    *_, last = motion(robot, pose, wheels, command, duration)
    return last


def integrated(pose, wheels, command, duration, robot=ROBOT):
    """The same step by a Runge-Kutta method that knows nothing of arcs; ramps written out anew."""

    def wheel(now, wish, time):
        change = robot.max_wheel_acceleration * time
        return max(wish, now - change) if wish < now else min(wish, now + change)

    def derivative(time, state):
        left, right = (wheel(now, wish, time) for now, wish in zip(wheels, command, strict=True))
        speed = robot.wheel_radius * (left + right) / 2
        return [
            speed * math.cos(state[2]),
            speed * math.sin(state[2]),
            robot.wheel_radius * (right - left) / robot.track,
        ]

    return solve_ivp(
        derivative, (0, duration), pose, method="DOP853", rtol=1e-11, atol=1e-12, max_step=duration / 50
    ).y[:, -1]


def test_straight_ahead_goes_as_far_as_the_wheels_roll():
    x, y, yaw = end((1.0, 2.0, 0.5), (6.0, 6.0), (6.0, 6.0), 2.0)
    rolled = 6.0 * 2.0 * ROBOT.wheel_radius
    assert (x, y, yaw) == pytest.approx((1 + rolled * math.cos(0.5), 2 + rolled * math.sin(0.5), 0.5))


def test_a_circle_closes_after_one_turn():
    wheels = (4.0, 6.0)
    _, yaw_rate = ROBOT.twist(*wheels)
    x, y, yaw = end((0.3, -0.2, 1.0), wheels, wheels, 2 * math.pi / yaw_rate)
    assert (x, y, yaw) == pytest.approx((0.3, -0.2, 1.0 + 2 * math.pi), abs=1e-12)


def test_turning_on_the_spot_stays_on_the_spot():
    x, y, yaw = end((0.3, -0.2, 0.0), (0.0, 0.0), (-5.0, 5.0), 3.0)
    assert (x, y) == pytest.approx((0.3, -0.2), abs=1e-15)
    # Ramped up, then held.
    up = 5.0 / LIMIT
    assert yaw == pytest.approx(ROBOT.twist(-5.0, 5.0)[1] * (3.0 - up / 2))


def test_braking_distance_is_half_the_square_of_the_speed_over_the_deceleration():
    x, _, _ = end((0.0, 0.0, 0.0), (10.0, 10.0), (0.0, 0.0), 5.0)
    speed = 10.0 * ROBOT.wheel_radius
    assert x == pytest.approx(speed**2 / (2 * ROBOT.max_acceleration))


@pytest.mark.parametrize("seed", range(8))
def test_ramps_agree_with_a_fine_integration(seed):
    rng = np.random.default_rng(seed)
    fastest = ROBOT.max_wheel_speed
    pose, duration = tuple(rng.uniform(-2, 2, 3)), rng.uniform(0.05, 2.0)
    wheels, command = tuple(rng.uniform(-fastest, fastest, 2)), tuple(rng.uniform(-fastest, fastest, 2))
    np.testing.assert_allclose(
        end(pose, wheels, command, duration), integrated(pose, wheels, command, duration), atol=1e-8
    )


def test_many_short_steps_end_where_one_long_step_does():
    rng = np.random.default_rng(7)
    for _ in range(10):
        wheels, command = tuple(rng.uniform(-12, 12, 2)), tuple(rng.uniform(-12, 12, 2))
        pose, speeds = (0.0, 0.0, 0.3), wheels
        for _ in range(30):
            pose = end(pose, speeds, command, 0.05)
            speeds = speeds_after(ROBOT, speeds, command, 0.05)
        np.testing.assert_allclose(pose, end((0.0, 0.0, 0.3), wheels, command, 1.5), atol=1e-11)


def test_driving_a_step_backwards_in_time_comes_back():
    wheels = (7.0, 3.0)
    pose = end((1.0, 1.0, 1.0), wheels, wheels, 1.3)
    assert end(pose, (-7.0, -3.0), (-7.0, -3.0), 1.3) == pytest.approx((1.0, 1.0, 1.0), abs=1e-12)


def test_wheels_change_no_faster_than_they_may():
    assert speeds_after(ROBOT, (0.0, 0.0), (9.0, -9.0), 0.1) == pytest.approx((0.1 * LIMIT, -0.1 * LIMIT))
    assert speeds_after(ROBOT, (1.0, 2.0), (1.1, 1.9), 0.1) == (1.1, 1.9)


def test_parts_of_a_step_fill_it_and_each_starts_where_the_last_ended():
    parts = list(ramps(ROBOT, (0.0, 3.0), (4.0, -1.0), 0.5))
    assert sum(duration for duration, _, _ in parts) == pytest.approx(0.5)
    assert parts[0][1] == (0.0, 3.0)
    for (duration, speeds, rates), (_, following, _) in itertools.pairwise(parts):
        assert following == pytest.approx([s + r * duration for s, r in zip(speeds, rates, strict=True)])
    assert parts[-1][1] == (4.0, -1.0)
    assert parts[-1][2] == (0.0, 0.0)


def test_no_piece_turns_by_more_than_a_tenth_of_a_radian():
    yaws = [0.0, *(yaw for *_, yaw in motion(ROBOT, (0.0, 0.0, 0.0), (-12.0, 12.0), (12.0, -9.0), 3.0))]
    assert np.abs(np.diff(yaws)).max() <= 0.1 + 1e-12


def test_where_the_robot_turns_back_a_piece_ends():
    """Else the way there and back would be cut short, and what lies at its end never touched."""
    xs = [x for x, *_ in motion(ROBOT, (0.0, 0.0, 0.0), (10.0, 10.0), (-10.0, -10.0), 3.0)]
    speed = 10.0 * ROBOT.wheel_radius
    assert max(xs) == pytest.approx(speed**2 / (2 * ROBOT.max_acceleration))


def test_the_ends_of_many_steps_are_those_of_each():
    rng = np.random.default_rng(3)
    robot, count = DiffDrive(), 400
    pose = rng.uniform(-3.0, 3.0, (3, count))
    wheels, command = rng.uniform(-robot.max_wheel_speed, robot.max_wheel_speed, (2, 2, count))
    # Some wheels hold their speeds.
    command[:, ::5] = wheels[:, ::5]
    command[0, 1::5] = wheels[0, 1::5]
    for duration in (0.05, 0.7):
        ends = np.stack(motion_end(robot, tuple(pose), tuple(wheels), tuple(command), duration))
        for row in range(count):
            own = (tuple(part[:, row].tolist()) for part in (pose, wheels, command))
            np.testing.assert_allclose(ends[:, row], motion(robot, *own, duration)[-1], rtol=0.0, atol=1e-9)
