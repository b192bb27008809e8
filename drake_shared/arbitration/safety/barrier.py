"""The arithmetic of the safety filter: the least change of a command that keeps a robot clear."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.geometry import GeometryId

from drake_shared.arbitration.safety.drift import Drift, Way
from drake_shared.arbitration.safety.gaps import TOLERANCE, Gaps, Nearby
from drake_shared.arbitration.safety.stopping import StoppingPaths
from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import Pose, Wheels

# A changed command aims this far beyond what is required, in [m]: the gap is only nearly linear in it.
_AIM = 1e-4
# For derivatives, in [rad/s].
_NUDGE = 1e-4
# Commands that are tried before the robot brakes.
_TRIES = 5


def least_change(
    wish: Wheels, low: Wheels, high: Wheels, normals: Sequence[Sequence[float]], bounds: Sequence[float]
) -> Wheels | None:
    """The point of a box that is nearest to ``wish`` and meets linear constraints: a quadratic program.

    Minimises |c - wish|^2 over low <= c <= high with normals[i] . c >= bounds[i]. The box is clipped by one
    half-plane after the other; the answer lies in the convex polygon that remains, or on its edge.

    Args:
        wish, low, high: Each two numbers.
        normals: Shape (n, 2).
        bounds: Shape (n,).

    Returns:
        The point; None if there is none.
    """
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    inside = low[0] <= wish[0] <= high[0] and low[1] <= wish[1] <= high[1]
    for (a, b), bound in zip(normals, bounds, strict=True):
        if a * (low[0] if a > 0 else high[0]) + b * (low[1] if b > 0 else high[1]) >= bound:
            continue  # The whole box meets it.
        inside = inside and a * wish[0] + b * wish[1] >= bound
        slack = [a * x + b * y - bound for x, y in corners]
        if min(slack) >= 0.0:
            continue
        kept = []
        for k, (x, y) in enumerate(corners):
            before, at = slack[k - 1], slack[k]
            if (before < 0.0) != (at < 0.0):
                share = before / (before - at)
                from_x, from_y = corners[k - 1]
                kept.append((from_x + share * (x - from_x), from_y + share * (y - from_y)))
            if at >= 0.0:
                kept.append((x, y))
        corners = kept
        if not corners:
            return None
    if inside:
        return wish
    return min(
        (_nearest_on(corners[k - 1], corners[k], wish) for k in range(len(corners))),
        key=lambda point: math.hypot(point[0] - wish[0], point[1] - wish[1]),
    )


def _nearest_on(begin: Wheels, end: Wheels, wish: Wheels) -> Wheels:
    """The point of a line between two points that is nearest to ``wish``."""
    along_x, along_y = end[0] - begin[0], end[1] - begin[1]
    length = along_x * along_x + along_y * along_y
    if length == 0.0:
        return begin
    share = ((wish[0] - begin[0]) * along_x + (wish[1] - begin[1]) * along_y) / length
    share = min(max(share, 0.0), 1.0)
    return begin[0] + share * along_x, begin[1] + share * along_y


def safe_command(
    robot: DiffDrive,
    pose: Pose,
    wheels: Wheels,
    command: Wheels,
    *,
    clearance: float,
    nearby: Nearby,
    period: float,
    moving: Mapping[GeometryId, Way] | None = None,
    now: float = 0.0,
) -> Wheels:
    """The command nearest to ``command`` after one step of which the robot can still stop in the clear.

    A command is safe if the step and full braking after it keep ``clearance`` to every obstacle; one that is
    safe is returned as it came. Else it is the solution of a quadratic program: the nearest wheel speeds
    within reach in one step whose gaps to the obstacles, made linear in the command, are kept. What comes
    out is checked in turn, and if nothing passes the robot brakes. That is always possible: braking follows
    the rest of the way that was found safe in the step before.

    Where full braking itself comes nearer than ``clearance`` (the robot was put there), the gap required of
    an obstacle is the one that full braking keeps: it never pushes further in, and can always move out.
    Rotation on the spot is always safe. The norm of a change is that of the wheel speeds, in which forward
    speed weighs as much as half the track times the yaw rate: straight before a wall only the forward speed
    is taken away, and a robot that stands there turns as far as the command was a turn.

    The gap to an obstacle that moves is that to where it will be, at each time of step and braking and, the
    robot at rest by then, until braking from full speed would be over; where it was a period before counts
    too, since the plant lets it stand within a step. One that meets the robot even if it brakes counts as
    stopping as it meets it: the robot may go away from it, or clear of its way, but not against it.

    Args:
        pose: x, y in [m] and yaw in [rad].
        wheels: Speeds (left, right), in [rad/s].
        command: Wanted, (left, right), in [rad/s], finite.
        clearance: To keep, in [m], to within 1e-6 m.
        nearby: Finds convex obstacles, where they are now.
        period: Of the step, in [s].
        moving: The paths of those that move, by what ``nearby`` calls them.
        now: In [s] from the start of the trial, as the times of the paths.
    """
    limit, change = robot.max_wheel_speed, robot.max_wheel_acceleration * period
    low = max(wheels[0] - change, -limit), max(wheels[1] - change, -limit)
    high = min(wheels[0] + change, limit), min(wheels[1] + change, limit)
    fastest = max(map(abs, (*low, *high)))
    reach = robot.wheel_radius * fastest * (period + fastest / (2 * robot.max_wheel_acceleration))
    horizon = period + max(limit, fastest) / robot.max_wheel_acceleration
    drifts = {
        name: Drift(times - now, places, period=period, horizon=horizon)
        for name, (times, places) in (moving or {}).items()
    }
    reach += clearance + max((drift.farthest for drift in drifts.values()), default=0.0)
    gaps = Gaps(nearby, robot.footprint_radius, pose, reach, drifts)
    at, brake = _within(command, low, high), _within((0.0, 0.0), low, high)
    if not gaps.count or at == brake:
        return command

    required = np.full(gaps.count, clearance)
    if drifts or gaps.at_start() < clearance - TOLERANCE:
        required = gaps.kept_by(StoppingPaths(robot, pose, wheels, [brake], period), clearance)
    wish = _within(command, (-limit, -limit), (limit, limit))
    # Gaps are concave in the speeds: a secant across the box errs on the safe side, and passes at once.
    to_left = low[0] if 2 * at[0] > low[0] + high[0] else high[0]
    to_right = low[1] if 2 * at[1] > low[1] + high[1] else high[1]
    for trial in range(_TRIES):
        known = gaps.keep(StoppingPaths(robot, pose, wheels, [at], period), required - TOLERANCE)
        if known is None:
            return at if trial else command
        beside = StoppingPaths(robot, pose, wheels, [(to_left, at[1]), (at[0], to_right)], period)
        left, right = gaps.least(beside)
        slopes = (left - known) / (to_left - at[0]), (right - known) / (to_right - at[1])
        bounds = required + _AIM - known + slopes[0] * at[0] + slopes[1] * at[1]
        # Braking is always allowed, whatever the secants say of it.
        bounds = np.minimum(bounds, slopes[0] * brake[0] + slopes[1] * brake[1])
        found = least_change(wish, low, high, np.transpose(slopes).tolist(), bounds.tolist())
        if found is None:
            break
        # Braking passes the check: the nearer to it, the likelier the next trial does.
        share = 0.5 ** max(trial - 1, 0)
        at = brake[0] + share * (found[0] - brake[0]), brake[1] + share * (found[1] - brake[1])
        to_left = at[0] + math.copysign(_NUDGE, wheels[0] - at[0])
        to_right = at[1] + math.copysign(_NUDGE, wheels[1] - at[1])
    return brake


def _within(command: Wheels, low: Wheels, high: Wheels) -> Wheels:
    return min(max(command[0], low[0]), high[0]), min(max(command[1], low[1]), high[1])
