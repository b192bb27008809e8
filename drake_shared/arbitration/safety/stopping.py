"""Where a robot comes to rest that brakes as hard as it can after one step, under several commands."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import Pose, Wheels


def _maps(pieces: int = 8) -> np.ndarray:
    """How speeds and angles at the nodes of a path, and durations between, follow from 21 numbers.

    A path has five segments of constant wheel acceleration, the last two cut into pieces; nodes are the ends
    and middles of pieces. The numbers are the speeds at the six ends of the segments, each segment's
    duration times the yaw rate at its begin (5) and at its end (5), and the durations (5).

    Returns:
        Shape (21, 2 nodes + pieces): columns for speeds, angles, durations.
    """
    cuts = [1, 1, 1, pieces, pieces]
    places = [(s, k / (2 * cut)) for s, cut in enumerate(cuts) for k in range(2 * cut)] + [(4, 1.0)]
    speeds, angles = np.zeros((21, len(places))), np.zeros((21, len(places)))
    for node, (segment, share) in enumerate(places):
        speeds[segment : segment + 2, node] = 1.0 - share, share
        angles[6 : 6 + segment, node] = angles[11 : 11 + segment, node] = 0.5
        angles[6 + segment, node] = share - 0.5 * share**2
        angles[11 + segment, node] = 0.5 * share**2
    durations = np.zeros((21, sum(cuts)))
    durations[16:] = np.repeat(np.diag(1.0 / np.array(cuts)), cuts, axis=1)
    return np.hstack([speeds, angles, durations])


_MAPS = _maps()
PIECES = _MAPS.shape[1] // 5
"""Of a path, one after another."""
_NODES = 2 * PIECES + 1


class StoppingPaths:
    """Ways of the body under several commands: one step, then both wheels brake as hard as they can.

    Points of the plane are complex numbers, x + iy in [m], world frame.
    Positions are exact but for Simpson's rule on pieces of at most an eighth of the braking (1e-6 m).

    Args:
        robot: Sizes and limits.
        pose: x, y in [m] and yaw in [rad] now.
        wheels: Speeds (left, right) now, in [rad/s].
        commands: Each (left, right), in [rad/s], within reach in one step.
        period: Of the step, in [s].

    Attributes:
        durations: Shape (m, k), in [s]: of the pieces.
        points: Shape (m, k + 1), complex, in [m]: the ends of the pieces.
        along: Shape (m, 3 k + 1, 2), in [m]: these, and for each piece its duration times the velocity at
            its begin, reversed, and at its end.
    """

    def __init__(
        self, robot: DiffDrive, pose: Pose, wheels: Wheels, commands: Sequence[Wheels], period: float
    ) -> None:
        numbers = np.array([_numbers(robot, wheels, command, period) for command in commands])
        mapped = numbers @ _MAPS
        self.durations = durations = mapped[:, 2 * _NODES :]
        velocity = mapped[:, :_NODES] * np.exp(1j * (pose[2] + mapped[:, _NODES : 2 * _NODES]))
        ends, middles = velocity[:, ::2], velocity[:, 1::2]
        both = np.empty((len(commands), 3 * PIECES + 1), dtype=complex)
        both[:, 0] = complex(pose[0], pose[1])
        begin = np.multiply(durations, ends[:, :-1], out=both[:, PIECES + 1 : 2 * PIECES + 1])
        end = np.multiply(durations, ends[:, 1:], out=both[:, 2 * PIECES + 1 :])
        both[:, 1 : PIECES + 1] = (begin + end + 4.0 * durations * middles) / 6.0
        self.points = np.cumsum(both[:, : PIECES + 1], axis=1, out=both[:, : PIECES + 1])
        np.negative(begin, out=begin)
        self.along = both.view(float).reshape(len(commands), -1, 2)

    def times(self) -> np.ndarray:
        """When the points are reached: shape (m, k + 1), in [s] from now."""
        times = np.zeros(self.points.shape)
        np.cumsum(self.durations, axis=1, out=times[:, 1:])
        return times


def _numbers(robot: DiffDrive, wheels: Wheels, command: Wheels, period: float) -> list[float]:
    """What :func:`_maps` maps, of one command."""
    limit = robot.max_wheel_acceleration
    (left, right), (to_left, to_right) = wheels, command
    left_there, right_there = abs(to_left - left) / limit, abs(to_right - right) / limit
    left_stop, right_stop = abs(to_left) / limit, abs(to_right) / limit
    first, last = sorted((left_there, right_there))
    soon, late = sorted((left_stop, right_stop))
    lefts, rights = [left], [right]
    if left_there <= right_there:
        lefts.append(to_left)
        rights.append(right + math.copysign(first * limit, to_right - right))
    else:
        lefts.append(left + math.copysign(first * limit, to_left - left))
        rights.append(to_right)
    lefts += [to_left, to_left, to_left - math.copysign(soon * limit, to_left), 0.0]
    rights += [to_right, to_right, to_right - math.copysign(soon * limit, to_right), 0.0]
    durations = [first, last - first, period - last, soon, late - soon]
    forward, turn = 0.5 * robot.wheel_radius, robot.wheel_radius / robot.track
    rates = [turn * (r - l) for l, r in zip(lefts, rights, strict=True)]  # noqa: E741
    return [
        *(forward * (l + r) for l, r in zip(lefts, rights, strict=True)),  # noqa: E741
        *(d * rate for d, rate in zip(durations, rates, strict=False)),
        *(d * rate for d, rate in zip(durations, rates[1:], strict=True)),
        *durations,
    ]
