"""The safe command nearest to a given one, by a discrete-time control barrier function."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.geometry import GeometryId

from drake_shared.arbitration.safety.braking_paths import BrakingPaths
from drake_shared.arbitration.safety.gap_bounds import TOLERANCE, DistanceQuery, GapBounds
from drake_shared.arbitration.safety.obstacle_motion import ObstacleMotion, ObstaclePath
from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import Pose, Wheels

# Margin beyond the required gap, in [m]: the gap is only approximately linear in the command.
_MARGIN = 1e-4
# Step of finite differences, in [rad/s].
_DIFFERENCE = 1e-4
_MAX_ITERATIONS = 5


def nearest_feasible(
    target: Wheels, low: Wheels, high: Wheels, normals: Sequence[Sequence[float]], bounds: Sequence[float]
) -> Wheels | None:
    """The point of a box nearest to ``target`` that satisfies linear constraints: a quadratic program in 2-D.

    Minimises |c - target|^2 over low <= c <= high with normals[i] . c >= bounds[i], by the incremental
    algorithm of Seidel (1991): a constraint that the optimum so far violates is active at the new optimum,
    which is found on its line, within the constraints before it. Exact, and three to six times faster than
    Clarabel through MathematicalProgram (``drake-shared benchmark --only safety``).

    Args:
        target, low, high: Two values each.
        normals: Shape (n, 2).
        bounds: Shape (n,).

    Returns:
        The point; None if no point satisfies all constraints.
    """
    half_planes = [
        *((1.0, 0.0, low[0]), (0.0, 1.0, low[1]), (-1.0, 0.0, -high[0]), (0.0, -1.0, -high[1])),
        *((normal[0], normal[1], bound) for normal, bound in zip(normals, bounds, strict=True)),
    ]
    x, y = target
    for count, (a, b, bound) in enumerate(half_planes):
        if a * x + b * y >= bound:
            continue
        squared = a * a + b * b
        if squared == 0.0:
            return None
        shift = (bound - a * target[0] - b * target[1]) / squared
        base_x, base_y = target[0] + shift * a, target[1] + shift * b
        # Points of the line: base + t (-b, a), with t from begin to end.
        begin, end = -math.inf, math.inf
        for c, d, other in half_planes[:count]:
            slope, missing = a * d - b * c, other - c * base_x - d * base_y
            if slope > 0.0:
                begin = max(begin, missing / slope)
            elif slope < 0.0:
                end = min(end, missing / slope)
            elif missing > 0.0:
                return None
        if begin > end:
            return None
        t = min(max(0.0, begin), end)
        x, y = base_x - t * b, base_y + t * a
    return _clip((x, y), low, high)


def safe_command(
    robot: DiffDrive,
    pose: Pose,
    wheels: Wheels,
    command: Wheels,
    *,
    clearance: float,
    query: DistanceQuery,
    period: float,
    moving: Mapping[GeometryId, ObstaclePath] | None = None,
    time: float = 0.0,
) -> Wheels:
    """The command nearest to ``command`` after one period of which the robot can still brake safely.

    A command is safe if one period of it, followed by full braking, keeps ``clearance`` to every obstacle. A
    safe command is returned unchanged. Otherwise the nearest wheel speeds within reach are the solution of a
    quadratic program, with the gaps to the obstacles linearised in the command as constraints. Each solution
    is checked; if none passes, the robot brakes. Braking is always possible: it follows the rest of the path
    that was found safe one period earlier.

    If full braking itself comes nearer to an obstacle than ``clearance`` (the robot started there), the gap
    that full braking keeps is required instead: the robot is never pushed further in and can always move
    away. Rotation on the spot is always safe. The norm of a change is that of the wheel speeds: directly in
    front of a wall only the forward speed is removed, and the turn remains.

    A moving obstacle is predicted along its path during the period, the braking, and with the robot at rest
    until the time that braking from full speed would take. Its position one period earlier counts too, since
    the plant treats it as static within a step. An obstacle that hits the robot even under full braking is
    treated as stopping at the contact: the robot may move away or out of its path, but not towards it.

    Args:
        robot: Dimensions and limits.
        pose: x, y in [m] and yaw in [rad].
        wheels: Present wheel speeds (left, right), in [rad/s].
        command: Desired wheel speeds (left, right), in [rad/s], finite.
        clearance: Gap to keep, in [m], to within 1e-6 m.
        query: Measures distances to convex obstacles at their present positions.
        period: Control period, in [s].
        moving: Paths of the moving obstacles.
        time: Present time, in [s] from the start of the trial.

    Returns:
        Wheel speeds (left, right), in [rad/s].
    """
    limit, change = robot.max_wheel_speed, robot.max_wheel_acceleration * period
    low = max(wheels[0] - change, -limit), max(wheels[1] - change, -limit)
    high = min(wheels[0] + change, limit), min(wheels[1] + change, limit)
    fastest = max(map(abs, (*low, *high)))
    horizon = period + max(limit, fastest) / robot.max_wheel_acceleration
    motions = {
        name: ObstacleMotion(times - time, positions, period=period, horizon=horizon)
        for name, (times, positions) in (moving or {}).items()
    }
    reach = robot.wheel_radius * fastest * (period + fastest / (2 * robot.max_wheel_acceleration))
    reach += clearance + max((motion.largest_displacement for motion in motions.values()), default=0.0)
    gaps = GapBounds(query, robot.footprint_radius, pose, reach, motions)
    candidate, brake = _clip(command, low, high), _clip((0.0, 0.0), low, high)
    if not gaps.count or candidate == brake:
        return command

    required = np.full(gaps.count, clearance)
    if motions or gaps.at_start() < clearance - TOLERANCE:
        required = gaps.gaps_kept(BrakingPaths(robot, pose, wheels, [brake], period), clearance)
    target = _clip(command, (-limit, -limit), (limit, limit))
    # Gaps are concave in the speeds, so a secant across the whole box is conservative.
    other_left = low[0] if 2 * candidate[0] > low[0] + high[0] else high[0]
    other_right = low[1] if 2 * candidate[1] > low[1] + high[1] else high[1]
    for iteration in range(_MAX_ITERATIONS):
        path = BrakingPaths(robot, pose, wheels, [candidate], period)
        known = gaps.find_violation(path, required - TOLERANCE)
        if known is None:
            return candidate if iteration else command
        varied = [(other_left, candidate[1]), (candidate[0], other_right)]
        left, right = gaps.least(BrakingPaths(robot, pose, wheels, varied, period))
        slopes = (left - known) / (other_left - candidate[0]), (right - known) / (other_right - candidate[1])
        bounds = required + _MARGIN - known + slopes[0] * candidate[0] + slopes[1] * candidate[1]
        # Braking stays feasible whatever the linearisation predicts.
        bounds = np.minimum(bounds, slopes[0] * brake[0] + slopes[1] * brake[1])
        found = nearest_feasible(target, low, high, np.transpose(slopes).tolist(), bounds.tolist())
        if found is None:
            break
        # Braking passes the check, so a candidate nearer to it is more likely to.
        share = 0.5 ** max(iteration - 1, 0)
        candidate = brake[0] + share * (found[0] - brake[0]), brake[1] + share * (found[1] - brake[1])
        other_left = candidate[0] + math.copysign(_DIFFERENCE, wheels[0] - candidate[0])
        other_right = candidate[1] + math.copysign(_DIFFERENCE, wheels[1] - candidate[1])
    return brake


def _clip(command: Wheels, low: Wheels, high: Wheels) -> Wheels:
    return min(max(command[0], low[0]), high[0]), min(max(command[1], low[1]), high[1])
