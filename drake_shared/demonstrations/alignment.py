"""Aligns demonstrations in time: the same time is the same phase of the task in all of them."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.arrays import path_at
from drake_shared.demonstrations.trajectories import Demonstration, Demonstrations

Array = NDArray[np.float64]

_WINDOW = 0.5
"""Of the mean speed, in [s]: noise of positions is not motion."""
_STILL = 0.1
"""Of the median speed in motion: less is a pause."""
_SHORTEST = 0.4
"""Shorter pauses are left, in [s]."""
_PACES = 1.25
"""Demonstrations whose travel times differ by a smaller factor from their median are of one pace."""


def align(demonstrations: Demonstrations, *, pace: float | None = None) -> Demonstrations:
    """Brings demonstrations of different paces to one, and counts pauses out.

    A learner that takes differences in time for differences of route would be confident without reason. At
    the start, where every robot takes time to get going, the shortest such time is left; waiting at the end
    is not a pause.

    Args:
        demonstrations: At least one. Those that need no change, as when all were driven alike, are returned
            as they are.
        pace: The `motion_time` to bring them to, in [s]; default: the median.

    Returns:
        Demonstrations whose provenance has what was changed: "time_factor", that on the time to the arrival,
        and "pauses", the time that was then cut, in [s].
    """
    items = list(demonstrations)
    # Whether a robot moves is judged over the same window at every pace, so that one step is not exact.
    for _ in range(2):
        motion = np.array([motion_time(item) for item in items])
        factors = (float(np.median(motion)) if pace is None else pace) / motion
        if np.abs(np.log(factors)).max() > np.log(_PACES) or items[0] is not demonstrations[0]:
            items = [_scale(*pair) for pair in zip(items, factors.tolist(), strict=True)]
    stops = [_find_stops(item) for item in items]
    start_up = min(
        own[0][1] - item.times[0] if own and own[0][0] == item.times[0] else 0.0
        for own, item in zip(stops, items, strict=True)
    )
    items = [_cut(item, own, start_up) for item, own in zip(items, stops, strict=True)]
    if all(new is old for new, old in zip(items, demonstrations, strict=True)):
        return demonstrations
    return dataclasses.replace(demonstrations, items=tuple(items))


def motion_time(demonstration: Demonstration) -> float:
    """Time in which the robot moves, in [s]; all of the time if it never does."""
    stops = _find_stops(demonstration)
    whole = float(demonstration.times[-1] - demonstration.times[0])
    return whole - sum(high - low for low, high in stops)


def _find_stops(item: Demonstration) -> list[tuple[float, float]]:
    """Begin and end of every time in which the robot hardly moves, in [s]; they do not overlap."""
    times, positions = item.times, item.positions
    before = np.maximum(times - 0.5 * _WINDOW, times[0])
    after = np.minimum(times + 0.5 * _WINDOW, times[-1])
    moved = path_at(positions, times, after) - path_at(positions, times, before)
    speed = np.sqrt(np.square(moved).sum(axis=1)) / (after - before)
    if not speed.any():
        return []
    usual = float(np.median(speed[speed > _STILL * speed.max()]))
    still = np.concatenate([[False], speed < _STILL * usual, [False]])
    edges = np.flatnonzero(np.diff(still))
    stops: list[tuple[float, float]] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        # The mean speed is higher within half a window of the motion.
        near = np.sqrt(np.square(positions - positions[first:end].mean(axis=0)).sum(axis=1))
        near_by = near < _STILL * usual * _WINDOW
        low, high = first, end - 1
        while low > 0 and near_by[low - 1]:
            low -= 1
        while high < len(times) - 1 and near_by[high + 1]:
            high += 1
        if stops and times[low] <= stops[-1][1]:
            # The robot stayed where it was in between.
            stops[-1] = (min(stops[-1][0], float(times[low])), max(stops[-1][1], float(times[high])))
        else:
            stops.append((float(times[low]), float(times[high])))
    return stops


def _cut(item: Demonstration, stops: list[tuple[float, float]], start_up: float) -> Demonstration:
    """The demonstration without its pauses, but for the last ``start_up`` seconds of one at the start."""
    begin, last = item.times[0], item.times[-1]
    times, keep = item.times.copy(), np.ones(len(item), dtype=bool)
    total = 0.0
    for low, high in stops:
        end = high - start_up if low == begin else high
        if high < last and end - low > _SHORTEST:
            keep &= (item.times <= low) | (item.times > end)
            times[item.times > end] -= end - low
            total += end - low
    if not total:
        return item
    return dataclasses.replace(
        item,
        times=times[keep],
        positions=item.positions[keep],
        yaws=None if item.yaws is None else item.yaws[keep],
        provenance={**item.provenance, "pauses": round(total, 3)},
    )


def _scale(item: Demonstration, factor: float) -> Demonstration:
    """The demonstration with the time to its arrival times ``factor``, and as long a wait as before."""
    begin, stops = item.times[0], _find_stops(item)
    arrival = stops[-1][0] if stops and stops[-1][1] == item.times[-1] else item.times[-1]
    moving = np.minimum(item.times, arrival) - begin
    total = factor * item.provenance.get("time_factor", 1.0)
    return dataclasses.replace(
        item,
        times=begin + factor * moving + np.maximum(item.times - arrival, 0.0),
        provenance={**item.provenance, "time_factor": round(total, 4)},
    )
