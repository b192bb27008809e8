"""Motion of a circular body that stops at convex obstacles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from drake_shared.robots.motion import Pose, Wheels

MARGIN = 1e-6
"""How far short of an obstacle the body stops, in [m]: rounding never carries it inside."""
Distances = Callable[[float, float, float], Iterable[tuple[float, float, float]]]
"""Of each obstacle within a distance, in [m], of a point x, y: its signed distance, and the gradient of that
distance in x and y."""


def gap_at(distances: Distances, radius: float, x: float, y: float) -> float:
    """Gap of a body of ``radius`` at x, y to the nearest obstacle, in [m]; infinite without obstacles."""
    return min((distance for distance, *_ in distances(x, y, math.inf)), default=math.inf) - radius


def drive_until_contact(
    distances: Distances, radius: float, start: Pose, path: Sequence[Pose]
) -> tuple[float, float, float, bool]:
    """The pose at the end of a step, and whether the body touches an obstacle.

    Translation ends at the contact, and the yaw continues.

    Args:
        distances: To the obstacles.
        radius: Of the body, in [m].
        start: Pose at the start, x, y in [m] and yaw in [rad].
        path: Poses along the step in the open, as of `drake_shared.robots.motion.motion`.
    """
    x, y, yaw = start
    contact = False
    for piece_x, piece_y, yaw in path:  # noqa: B007 (the yaw continues after contact)
        if not contact:
            # Each piece is a chord from where the robot really is.
            x, y, contact = _walk(distances, radius, x, y, piece_x, piece_y)
    if not contact and gap_at(distances, radius, x, y) <= 2 * MARGIN:
        contact = True  # At rest against an obstacle.
    return x, y, yaw, contact


def speeds_in_contact(wheels: Wheels) -> Wheels:
    """Wheel speeds (left, right) without the forward speed, so that the robot can turn and back away."""
    turn = 0.5 * (wheels[1] - wheels[0])
    return -turn, turn


def _walk(
    distances: Distances, radius: float, x: float, y: float, to_x: float, to_y: float
) -> tuple[float, float, bool]:
    """Moves straight to a point, or as far as the obstacles allow.

    The gap to a convex obstacle is convex along a line: a step of Newton's method on it from outside never
    oversteps the contact.
    """
    length = math.hypot(to_x - x, to_y - y)
    if length == 0.0:
        return x, y, False
    along_x, along_y = (to_x - x) / length, (to_y - y) / length
    gone = 0.0
    while True:
        step = math.inf
        near = distances(x + gone * along_x, y + gone * along_y, radius + length - gone + MARGIN)
        for distance, gradient_x, gradient_y in near:
            slope = gradient_x * along_x + gradient_y * along_y
            if slope < 0.0:
                step = min(step, max(distance - radius - MARGIN, 0.0) / -slope)
        if step >= length - gone:
            return to_x, to_y, False
        gone += step
        if step < 1e-9:
            return x + gone * along_x, y + gone * along_y, True
