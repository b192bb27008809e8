"""Exact motion of a differential-drive robot whose wheels ramp to their commands."""

from __future__ import annotations

import math

import numpy as np

from drake_shared.common.elementwise import ARRAYS, FLOATS, Elementwise, Real
from drake_shared.robots.diff_drive import DiffDrive, sine_ratio

# Largest turn of one piece of motion, in [rad]: the chord of a piece stays close to its arc, and three nodes
# integrate it to 1e-12 of its length.
_LARGEST_TURN = 0.1
_nodes, _weights = np.polynomial.legendre.leggauss(3)
# Pairs of node and weight, mapped from [-1, 1] to [0, 1].
_QUADRATURE: list[tuple[float, float]] = list(
    zip((0.5 * (_nodes + 1)).tolist(), (0.5 * _weights).tolist(), strict=True)
)

Pose = tuple[Real, Real, Real]
Wheels = tuple[Real, Real]


def ramps(
    robot: DiffDrive, wheels: Wheels, command: Wheels, duration: float
) -> list[tuple[float, Wheels, Wheels]]:
    """Divides a step into parts of constant wheel acceleration.

    Each wheel changes its speed toward the command at its largest acceleration and then holds it.

    Args:
        robot: Gives the acceleration limit.
        wheels: Speeds at the start, (left, right), in [rad/s].
        command: Desired speeds, (left, right), in [rad/s], within the limits of the wheels.
        duration: Of the step, in [s].

    Returns:
        Tuples (duration in [s], speeds at the start (left, right), accelerations (left, right)).
    """
    limit = robot.max_wheel_acceleration
    left, right = wheels
    left_goal, right_goal = command
    left_time, right_time = abs(left_goal - left) / limit, abs(right_goal - right) / limit
    left_rate, right_rate = math.copysign(limit, left_goal - left), math.copysign(limit, right_goal - right)
    parts = []
    begin = 0.0
    first, second = min(left_time, duration), min(right_time, duration)
    for end in (first, second, duration) if first < second else (second, first, duration):
        if end > begin:
            rates = (left_rate if begin < left_time else 0.0, right_rate if begin < right_time else 0.0)
            parts.append((end - begin, (left, right), rates))
            # A speed that is reached is set exactly, so that rounding leaves no remainder.
            left = left_goal if end >= left_time else left + rates[0] * (end - begin)
            right = right_goal if end >= right_time else right + rates[1] * (end - begin)
            begin = end
    return parts


def speeds_after(
    robot: DiffDrive, wheels: Wheels, command: Wheels, duration: float, xp: Elementwise = FLOATS
) -> Wheels:
    """Wheel speeds (left, right), in [rad/s], at the end of a step of ``duration`` s."""
    change = robot.max_wheel_acceleration * duration
    return _approached(wheels[0], command[0], change, xp), _approached(wheels[1], command[1], change, xp)


def _approached(now: Real, goal: Real, change: float, xp: Elementwise) -> Real:
    return xp.where(abs(goal - now) <= change, goal, now + xp.copysign(change, goal - now))


def motion(robot: DiffDrive, pose: Pose, wheels: Wheels, command: Wheels, duration: float) -> list[Pose]:
    """Poses along one step, each after a turn of at most 0.1 rad; the last one is that at its end.

    Positions are exact: an arc in closed form where the wheels hold their speeds, a Gauss-Legendre
    quadrature to 1e-12 of the length where they ramp.

    Args:
        robot: Sizes and limits.
        pose: x, y in [m] and yaw in [rad] at the start, world frame.
        wheels: Speeds (left, right) at the start, in [rad/s].
        command: Desired speeds, (left, right), in [rad/s].
        duration: Of the step, in [s].
    """
    x, y, yaw = pose
    poses = []
    for time, speed, acceleration, yaw_rate, yaw_acceleration in _monotonic(robot, wheels, command, duration):
        fastest = max(abs(yaw_rate), abs(yaw_rate + yaw_acceleration * time))
        pieces = max(1, math.ceil(fastest * time / _LARGEST_TURN))
        step = time / pieces
        for _ in range(pieces):
            if acceleration == 0.0 and yaw_acceleration == 0.0:
                x, y = _arc_end(x, y, yaw, speed, yaw_rate, step, FLOATS)
            else:
                x, y = _ramp_end(x, y, yaw, speed, acceleration, yaw_rate, yaw_acceleration, step, FLOATS)
            yaw += (yaw_rate + 0.5 * yaw_acceleration * step) * step
            speed += acceleration * step
            yaw_rate += yaw_acceleration * step
            poses.append((x, y, yaw))
    return poses


def motion_end(robot: DiffDrive, pose: Pose, wheels: Wheels, command: Wheels, duration: float) -> Pose:
    """The last pose of `motion`, for arrays: all arguments but ``robot`` and ``duration`` have shapes (n,).

    The parts of a step are those of `ramps`; where the robot turns back makes no difference to the end.
    """
    x, y, yaw = pose
    left, right = wheels
    limit = robot.max_wheel_acceleration
    left_time, right_time = (abs(goal - now) / limit for goal, now in zip(command, wheels, strict=True))
    left_rate, right_rate = (
        np.copysign(limit, goal - now) for goal, now in zip(command, wheels, strict=True)
    )
    first, second = np.minimum(left_time, duration), np.minimum(right_time, duration)
    begin = np.zeros_like(x)
    for end in (np.minimum(first, second), np.maximum(first, second), np.full_like(x, duration)):
        time = end - begin
        rates = np.where(begin < left_time, left_rate, 0.0), np.where(begin < right_time, right_rate, 0.0)
        speed, yaw_rate = robot.twist(left, right)
        acceleration, yaw_acceleration = robot.twist(*rates)
        ramping = (acceleration != 0.0) | (yaw_acceleration != 0.0)
        # Of a length of zero, and so without effect, where the other one applies.
        x, y = _arc_end(x, y, yaw, speed, yaw_rate, np.where(ramping, 0.0, time), ARRAYS)
        fastest = np.maximum(abs(yaw_rate), abs(yaw_rate + yaw_acceleration * time))
        pieces = np.where(ramping, np.maximum(np.ceil(fastest * time / _LARGEST_TURN), 1.0), 0.0)
        step = time / np.maximum(pieces, 1.0)
        for piece in range(int(pieces.max())):
            since = piece * step
            now = yaw + (yaw_rate + 0.5 * yaw_acceleration * since) * since
            x, y = _ramp_end(
                x,
                y,
                now,
                speed + acceleration * since,
                acceleration,
                yaw_rate + yaw_acceleration * since,
                yaw_acceleration,
                np.where(piece < pieces, step, 0.0),
                ARRAYS,
            )
        yaw = yaw + (yaw_rate + 0.5 * yaw_acceleration * time) * time
        left = np.where(end >= left_time, command[0], left + rates[0] * time)
        right = np.where(end >= right_time, command[1], right + rates[1] * time)
        begin = end
    return x, y, yaw


def _arc_end(
    x: Real, y: Real, yaw: Real, speed: Real, yaw_rate: Real, time: Real, xp: Elementwise
) -> tuple[Real, Real]:
    """The end of an arc, in closed form."""
    half = 0.5 * yaw_rate * time
    chord = speed * time * sine_ratio(half, xp)
    return x + chord * xp.cos(yaw + half), y + chord * xp.sin(yaw + half)


def _ramp_end(
    x: Real,
    y: Real,
    yaw: Real,
    speed: Real,
    acceleration: Real,
    yaw_rate: Real,
    yaw_acceleration: Real,
    time: Real,
    xp: Elementwise,
) -> tuple[Real, Real]:
    """The end of a path with constant accelerations, by quadrature."""
    cos, sin = xp.cos, xp.sin
    for node, weight in _QUADRATURE:
        at = node * time
        angle = yaw + (yaw_rate + 0.5 * yaw_acceleration * at) * at
        length = weight * time * (speed + acceleration * at)
        x = x + length * cos(angle)
        y = y + length * sin(angle)
    return x, y


def _monotonic(
    robot: DiffDrive, wheels: Wheels, command: Wheels, duration: float
) -> list[tuple[float, float, float, float, float]]:
    """The parts of a step as (duration, speed, acceleration, yaw rate, yaw acceleration), in [s], [m], [rad].

    A part ends where the robot reverses: the end of one that went forth and back would hide how far it went.
    """
    parts = []
    for time, speeds, rates in ramps(robot, wheels, command, duration):
        speed, yaw_rate = robot.twist(*speeds)
        acceleration, yaw_acceleration = robot.twist(*rates)
        if speed * acceleration < 0.0 and -speed / acceleration < time:
            until = -speed / acceleration
            parts.append((until, speed, acceleration, yaw_rate, yaw_acceleration))
            time, speed, yaw_rate = time - until, 0.0, yaw_rate + yaw_acceleration * until
        parts.append((time, speed, acceleration, yaw_rate, yaw_acceleration))
    return parts
