"""The geometry of what an agent predicts: one ribbon for each route that is still possible."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drake_shared.learners import Modes
from drake_shared.robots import Robot, scaled_length
from drake_shared.systems.intention import Intention

Array = NDArray[np.float64]

POINTS = 41
"""Number of points of a ribbon's centre line."""

# Routes less probable than this are not shown.
_LEAST_PROBABILITY = 0.03
# Lengths in [m] for the Pioneer P3-DX. Routes that stay closer than the first are one route from here on;
# half widths lie between the next two; where the standard deviation exceeds the fourth, a ribbon fades; a
# path shorter than the last is not shown.
_SAME_ROUTE, _LEAST_WIDTH, _LARGEST_WIDTH, _KNOWN_SIGMA, _SHORTEST = 0.15, 0.03, 0.30, 0.10, 0.05
# Half widths are so many standard deviations: a ribbon holds 95% of a normal distribution.
_DEVIATIONS = 2.0
# A ribbon that has faded to this is not drawn.
_INVISIBLE = 0.05


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Ribbon:
    """A predicted route as a strip along the ground.

    Attributes:
        probability: Of the route, from 0 to 1.
        center: Shape (POINTS, D), evenly spaced along the path, in [m], world frame; the first is the robot.
        half_width: Shape (POINTS,), twice the standard deviation across the path, within limits, in [m].
        fade: Shape (POINTS,), from 1 where the path is known to 0 where nothing is known.
        marks: Shape (k,), where the path is after 1, 2, ... s, as an index into ``center`` with a fraction.
    """

    probability: float
    center: Array
    half_width: Array
    fade: Array
    marks: Array


def route_ribbons(
    intention: Intention, modes: Modes | None, *, position: Sequence[float], robot: Robot
) -> list[Ribbon]:
    """The ribbons of a prediction, the most probable first.

    Routes that do not differ any more are one ribbon. Where the standard deviation is large, a ribbon fades
    instead of growing; one that has faded everywhere is left out.

    Args:
        intention: The prediction.
        modes: Its modes, from entry ``intention.first`` on; None takes the whole prediction for one.
        position: The robot's (D,), in [m], world frame.
        robot: Gives the coordinates and the scale of what is drawn.
    """
    first = intention.first
    if modes is None:
        rest = intention.mean[None, first:], intention.variance[None, first:]
        modes = Modes(probability=np.ones(1), mean=rest[0], variance=rest[1], aim=0)
    names = tuple(robot.position_names)
    across = [names.index(name) for name in ("x", "y") if name in names]
    if len(across) < 2 or not math.isfinite(sum(position)):
        return []
    times = np.concatenate([[intention.time], intention.times[first:]])
    ribbons = []
    for probability, mean, variance in _distinct(modes, scaled_length(robot, _SAME_ROUTE)):
        path = np.concatenate([[position], mean])
        if np.isfinite(path).all() and np.isfinite(variance).all():
            ribbon = _ribbon(probability, times, path, variance, across, robot)
            if ribbon is not None:
                ribbons.append(ribbon)
    return ribbons


def _distinct(modes: Modes, distance: float) -> list[tuple[float, Array, Array]]:
    """Probability, mean and variance of each route, those that stay within ``distance`` taken together."""
    merged: list[tuple[float, Array, Array]] = []
    for index in np.argsort(-modes.probability):
        probability, mean = float(modes.probability[index]), modes.mean[index]
        if not np.isfinite(mean).all():
            continue
        for slot, (other, path, variance) in enumerate(merged):
            if np.linalg.norm(mean - path, axis=-1).max() < distance:
                merged[slot] = other + probability, path, variance
                break
        else:
            merged.append((probability, mean, modes.variance[index]))
    likely = [mode for mode in merged if mode[0] >= _LEAST_PROBABILITY]
    return sorted(likely, key=lambda mode: -mode[0])


def _ribbon(
    probability: float, times: Array, path: Array, variance: Array, across: list[int], robot: Robot
) -> Ribbon | None:
    least, largest, known, shortest = (
        scaled_length(robot, length) for length in (_LEAST_WIDTH, _LARGEST_WIDTH, _KNOWN_SIGMA, _SHORTEST)
    )
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=-1))])
    length = float(arc[-1])
    if length < shortest:
        return None
    points = np.linspace(0.0, length, POINTS)
    center = np.stack([np.interp(points, arc, values) for values in path.T], axis=-1)
    spread = np.stack([np.interp(points, arc[1:], variance[:, axis]) for axis in across])
    tangent = np.gradient(center[:, across], axis=0).T
    tangent /= np.maximum(np.hypot(*tangent), 1e-9)
    sigma = np.sqrt(tangent[1] ** 2 * spread[0] + tangent[0] ** 2 * spread[1])
    fade = np.square(known / np.maximum(sigma, 1e-9))
    fade = np.clip((fade - _INVISIBLE) / (1.0 - _INVISIBLE), 0.0, 1.0)
    if not fade.any():
        return None
    half_width = np.clip(_DEVIATIONS * sigma, least, largest)
    # It starts as wide as the robot's position is known, and widens from there without a step.
    half_width[:4] = np.minimum(half_width[:4], least + (half_width[4] - least) * np.arange(4) / 4)
    seconds = np.arange(1.0, times[-1] - times[0] + 1e-9)
    reached = np.interp(times[0] + seconds, times, arc)
    # The path ends with the robot at rest at the goal, where marks would fall on each other.
    marks = reached[reached < length - shortest] * ((POINTS - 1) / length)
    return Ribbon(probability=probability, center=center, half_width=half_width, fade=fade, marks=marks)
