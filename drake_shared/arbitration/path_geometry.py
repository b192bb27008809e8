"""Geometry of paths in the plane beside obstacles that may move."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.elementwise import ARRAYS
from drake_shared.scenario.obstacles import Circle, Obstacle
from drake_shared.scenario.planar_distance import distance_and_gradient

Floats = NDArray[np.float64]

JOINED = 12
"""Predictions among which the one nearest to the robot is looked for."""


def arc_lengths(paths: Floats) -> Floats:
    """Lengths (n, m) of paths (n, m, 2) from their first point to each point, in [m]."""
    lengths = np.zeros(paths.shape[:2])
    steps = paths[:, 1:] - paths[:, :-1]
    np.cumsum(np.hypot(steps[..., 0], steps[..., 1]), axis=1, out=lengths[:, 1:])
    return lengths


def interpolated(at: Floats, grid: Floats, values: Floats) -> Floats:
    """As `numpy.interp`, values (n, d) at ``at`` (n,) of rows of ``values`` (n, m, d) at ``grid`` (n, m)."""
    each = np.arange(len(at))
    after = np.minimum(np.maximum((grid <= at[:, None]).sum(axis=1), 1), grid.shape[1] - 1)
    begin, end = grid[each, after - 1], grid[each, after]
    length = end - begin
    share = np.minimum(np.maximum((at - begin) / np.where(length > 0.0, length, 1.0), 0.0), 1.0)
    before = values[each, after - 1]
    between: Floats = before + share[:, None] * (values[each, after] - before)
    return between


def joined(robot: Floats, paths: Floats) -> Floats:
    """Paths (n, Q, 2) that do not first lead back, to a beginning that the robot (n, 2) has passed."""
    nearest = np.hypot(*(paths[:, :JOINED] - robot[:, None]).transpose(2, 0, 1)).argmin(axis=1)[:, None]
    if not nearest.any():
        return paths
    index = np.arange(paths.shape[1])
    at_join = paths[np.arange(len(paths))[:, None], nearest]
    share = ((index + 1) / (nearest + 1))[..., None]
    straight = robot[:, None] + share * (at_join - robot[:, None])
    return np.where((index < nearest)[..., None], straight, paths)


def obstacle_distance(obstacle: Obstacle, points: Floats) -> Floats:
    """Distances (n, m) from points (n, m, 2) to an obstacle at its place at the start, in [m]."""
    x, y = points[..., 0], points[..., 1]
    if isinstance(obstacle, Circle):
        # Without the gradient, this takes a third of the time.
        beside: Floats = np.hypot(x - obstacle.x, y - obstacle.y) - obstacle.radius
        return beside
    distance: Floats = distance_and_gradient(obstacle, x, y, ARRAYS)[0]
    return distance


def displacements(obstacle: Obstacle, times: Floats) -> Floats:
    """How far an obstacle is from its place at the start at times (n, m): shape (n, m, 2) or (1, 1, 2)."""
    if not obstacle.path:
        return np.zeros((1, 1, 2))
    at, *places = np.array(obstacle.path).T
    start = (obstacle.x, obstacle.y)
    return np.stack(
        [np.interp(times, at, place) - origin for place, origin in zip(places, start, strict=True)], axis=-1
    )


def gap_between(one: Obstacle, other: Obstacle) -> float:
    """Distance between two static obstacles, in [m]; infinite if one of them moves."""
    if one.path or other.path:
        return math.inf
    x, y = other.x, other.y
    for _ in range(30):
        # Alternating projections onto two convex sets.
        for item in (one, other):
            distance, *slope = distance_and_gradient(item, x, y)
            if distance > 0.0:
                x, y = x - distance * slope[0], y - distance * slope[1]
    return float(max(distance_and_gradient(one, x, y)[0], 0.0))
