"""Paths of a differential drive that follows a command for one period and then brakes to rest."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import Pose, Wheels

_BRAKING_PIECES = 8


def _segment_maps() -> NDArray[np.float64]:
    """Linear maps from 21 numbers per path to speeds and angles at its nodes and durations of its pieces.

    A path has five segments of constant wheel acceleration: three within the period, two of braking. The last
    two are cut into pieces. Nodes are ends and middles of pieces. The 21 numbers are the speeds at the six
    ends of the segments, each segment's duration times the yaw rate at its begin (5) and at its end
    (5), and the durations (5).

    Returns:
        Shape (21, 2 nodes + pieces): columns for speeds, angles and durations.
    """
    cuts = [1, 1, 1, _BRAKING_PIECES, _BRAKING_PIECES]
    nodes = [(s, k / (2 * cut)) for s, cut in enumerate(cuts) for k in range(2 * cut)] + [(4, 1.0)]
    speeds, angles = np.zeros((21, len(nodes))), np.zeros((21, len(nodes)))
    for node, (segment, share) in enumerate(nodes):
        speeds[segment : segment + 2, node] = 1.0 - share, share
        angles[6 : 6 + segment, node] = angles[11 : 11 + segment, node] = 0.5
        angles[6 + segment, node] = share - 0.5 * share**2
        angles[11 + segment, node] = 0.5 * share**2
    durations = np.zeros((21, sum(cuts)))
    durations[16:] = np.repeat(np.diag(1.0 / np.array(cuts)), cuts, axis=1)
    return np.hstack([speeds, angles, durations])


_MAPS = _segment_maps()
PIECES = 3 + 2 * _BRAKING_PIECES
"""Number of pieces of a path."""
_NODES = 2 * PIECES + 1


class BrakingPaths:
    """Paths of the body's centre: one period under a command, then full braking of both wheels.

    Points are complex numbers, x + iy in [m], world frame. Positions are integrated by Simpson's rule on each
    piece, with an error of 1e-6 m.

    Args:
        robot: Dimensions and limits.
        pose: x, y in [m] and yaw in [rad].
        wheels: Present wheel speeds (left, right), in [rad/s].
        commands: m commands (left, right), in [rad/s], each within reach in one period.
        period: Control period, in [s].

    Attributes:
        durations: Durations of the k pieces: shape (m, k), in [s].
        points: Ends of the pieces: shape (m, k + 1), complex, in [m].
        points_and_tangents: The points, then for each piece its duration times the reversed velocity at its
            begin and times the velocity at its end: shape (m, 3 k + 1, 2), in [m].
    """

    def __init__(
        self, robot: DiffDrive, pose: Pose, wheels: Wheels, commands: Sequence[Wheels], period: float
    ) -> None:
        mapped = np.array([_segments(robot, wheels, command, period) for command in commands]) @ _MAPS
        self.durations = durations = mapped[:, 2 * _NODES :]
        velocity = mapped[:, :_NODES] * np.exp(1j * (pose[2] + mapped[:, _NODES : 2 * _NODES]))
        ends, middles = velocity[:, ::2], velocity[:, 1::2]
        values = np.empty((len(commands), 3 * PIECES + 1), dtype=complex)
        values[:, 0] = complex(pose[0], pose[1])
        begin = np.multiply(durations, ends[:, :-1], out=values[:, PIECES + 1 : 2 * PIECES + 1])
        end = np.multiply(durations, ends[:, 1:], out=values[:, 2 * PIECES + 1 :])
        values[:, 1 : PIECES + 1] = (begin + end + 4.0 * durations * middles) / 6.0
        self.points = np.cumsum(values[:, : PIECES + 1], axis=1, out=values[:, : PIECES + 1])
        np.negative(begin, out=begin)
        self.points_and_tangents = values.view(float).reshape(len(commands), -1, 2)

    def times(self) -> NDArray[np.float64]:
        """Times at which the points are reached: shape (m, k + 1), in [s] from now."""
        times = np.zeros(self.points.shape)
        np.cumsum(self.durations, axis=1, out=times[:, 1:])
        return times


def _segments(robot: DiffDrive, wheels: Wheels, command: Wheels, period: float) -> list[float]:
    """The 21 numbers of :func:`_segment_maps` for one command."""
    limit = robot.max_wheel_acceleration
    ramp_times = [abs(target - speed) / limit for speed, target in zip(wheels, command, strict=True)]
    first, last = sorted(ramp_times)
    soon, late = sorted(abs(target) / limit for target in command)
    speeds = [
        [
            speed,
            target if ramp_time == first else speed + math.copysign(first * limit, target - speed),
            target,
            target,
            target - math.copysign(soon * limit, target),
            0.0,
        ]
        for speed, target, ramp_time in zip(wheels, command, ramp_times, strict=True)
    ]
    durations = [first, last - first, period - last, soon, late - soon]
    forward, turn = 0.5 * robot.wheel_radius, robot.wheel_radius / robot.track
    left, right = speeds
    rates = [turn * (fast - slow) for slow, fast in zip(left, right, strict=True)]
    return [
        *(forward * (one + other) for one, other in zip(left, right, strict=True)),
        *(duration * rate for duration, rate in zip(durations, rates, strict=False)),
        *(duration * rate for duration, rate in zip(durations, rates[1:], strict=True)),
        *durations,
    ]
