"""Distances to static obstacles in closed form, for one point or many."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.elementwise import ARRAYS, FLOATS, Elementwise, Real
from drake_shared.scenario.obstacles import Circle, Obstacle


class PlanarDistance:
    """Signed distances in the plane, as a SceneGraph with these obstacles measures them.

    Args:
        obstacles: Static ones.
    """

    def __init__(self, obstacles: Sequence[Obstacle]) -> None:
        self._obstacles = tuple(obstacles)

    def least(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances (n,) from the points ``x`` (n,), ``y`` (n,) to the nearest obstacle, in [m].

        Negative inside an obstacle; infinite without obstacles.
        """
        least = np.full(np.shape(x), math.inf)
        for obstacle in self._obstacles:
            least = np.minimum(least, distance_and_gradient(obstacle, x, y, ARRAYS)[0])
        return least

    def nearest(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distances (n,) to the nearest obstacle, as `least` returns them, and their gradients (n, 2)."""
        least, slopes = np.full(np.shape(x), math.inf), np.zeros((*np.shape(x), 2))
        for obstacle in self._obstacles:
            distance, *gradient = distance_and_gradient(obstacle, x, y, ARRAYS)
            nearer = distance < least
            least = np.where(nearer, distance, least)
            slopes = np.where(nearer[..., None], np.stack(gradient, axis=-1), slopes)
        return least, slopes

    def within(self, x: float, y: float, threshold: float) -> list[tuple[float, float, float]]:
        """Of each obstacle within ``threshold``: its distance, and the gradient of that in x and y."""
        found = [distance_and_gradient(obstacle, x, y) for obstacle in self._obstacles]
        return [item for item in found if item[0] <= threshold]


def distance_and_gradient(
    obstacle: Obstacle, x: Real, y: Real, xp: Elementwise = FLOATS
) -> tuple[Real, Real, Real]:
    """Signed distance of a point to an obstacle, in [m], and its gradient in x and y.

    Args:
        obstacle: A circle or a box.
        x, y: In [m], world frame.
        xp: For numbers or arrays.
    """
    x, y = x - obstacle.x, y - obstacle.y
    if isinstance(obstacle, Circle):
        away = xp.hypot(x, y)
        outside = away > 0.0
        safe = xp.where(outside, away, 1.0)
        return away - obstacle.radius, xp.where(outside, x / safe, 1.0), y / safe
    cos, sin = math.cos(obstacle.yaw), math.sin(obstacle.yaw)
    u, v = cos * x + sin * y, cos * y - sin * x
    over_u, over_v = abs(u) - 0.5 * obstacle.length, abs(v) - 0.5 * obstacle.width
    out_u, out_v = xp.maximum(over_u, 0.0), xp.maximum(over_v, 0.0)
    away = xp.hypot(out_u, out_v)
    outside = away > 0.0
    safe = xp.where(outside, away, 1.0)
    # Inside, the nearest face decides.
    by_u = over_u >= over_v
    slope_u = xp.copysign(xp.where(outside, out_u / safe, 1.0 * by_u), u)
    slope_v = xp.copysign(xp.where(outside, out_v / safe, 1.0 - 1.0 * by_u), v)
    distance = away + xp.minimum(xp.maximum(over_u, over_v), 0.0)
    return distance, cos * slope_u - sin * slope_v, sin * slope_u + cos * slope_v
