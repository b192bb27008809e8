"""Calibrates the confidence of a learner on trials: see `drake_shared.learners.calibrated_confidence`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.learners.calibrated_confidence import LEAST_RATIO, CalibratedConfidence, OpenWay
from drake_shared.robots import DiffDrive
from drake_shared.scenario import Scenario
from drake_shared.scenario.paths import passing_side
from drake_shared.scenario.planar_distance import PlanarDistance
from drake_shared.scenario.route_planner import plan_routes

Floats = NDArray[np.float64]

_POINTS = 15
# A driver this far from an obstacle, in radii of the robot, can still pass it on either side.
_OPEN = 2.0


def calibrated_confidence(
    ratio: Floats, correct: NDArray[np.bool_], open_ways: Sequence[Sequence[OpenWay]]
) -> CalibratedConfidence:
    """The calibration that fits steps of trials on demonstrated routes.

    Args:
        ratio: Shape (n,), K var at each step.
        correct: Shape (n,), whether the forecast was correct.
        open_ways: Of each demonstration; see `open_ways_of`.

    Raises:
        InputError: There are no steps with a finite ratio.
    """
    known = np.isfinite(ratio)
    if not known.any():
        raise InputError("evaluate", "trials", "must have steps on demonstrated routes")
    logs = np.log10(np.maximum(ratio[known], LEAST_RATIO))
    order = np.argsort(logs, kind="stable")
    parts = np.array_split(order, min(_POINTS, len(order)))
    centers = np.array([logs[part].mean() for part in parts])
    shares = np.array([correct[known][part].mean() for part in parts])
    # Equal ratios give equal centers, of which one stays.
    centers, which = np.unique(centers.round(6), return_inverse=True)
    weights = np.bincount(which, [len(part) for part in parts])
    means = np.bincount(which, [len(part) * share for part, share in zip(parts, shares, strict=True)])
    fitted = isotonic_regression(means / weights, weights=weights, increasing=False).x
    return CalibratedConfidence(
        log_ratio=tuple(centers.tolist()),
        probability=tuple(np.clip(fitted, 0.0, 1.0).round(4).tolist()),
        open_ways=tuple(tuple(ways) for ways in open_ways),
    )


def open_ways_of(scenario: Scenario, learner: Learner) -> list[list[OpenWay]]:
    """The ways past obstacles that are open on each demonstration of a learner, and were never demonstrated.

    An arm has none: its demonstrations differ in their goals.
    """
    paths: Any = () if learner.demonstrations is None else learner.demonstrations
    if not isinstance(scenario.robot, DiffDrive):
        return [[] for _ in paths]
    near = _OPEN * scenario.robot.footprint_radius
    obstacles = {item.name: item for item in scenario.static_obstacles}
    planned = [
        {name: "left" if left else "right" for name, left in route.passes.items()}
        for route in plan_routes(scenario)
    ]
    sides = [
        {name: passing_side(path, (item.x, item.y)) for name, item in obstacles.items()} for path in paths
    ]
    found: list[list[OpenWay]] = []
    for path, own in zip(paths, sides, strict=True):
        at = {name: int(np.hypot(*(path - (item.x, item.y)).T).argmin()) for name, item in obstacles.items()}
        passed: dict[str, str] = {}
        ways = []
        for name in sorted(obstacles, key=at.__getitem__):
            alike = [other for other in sides if passed.items() <= other.items()]
            is_possible = any(
                passed.items() <= route.items() and route.get(name, own[name]) != own[name]
                for route in planned
            )
            if is_possible and all(other[name] == own[name] for other in alike):
                distance = PlanarDistance([obstacles[name]]).least(*path[: at[name] + 1].T)
                before = np.flatnonzero(distance > near)
                if len(before):
                    ways.append(OpenWay(until=float(learner.grid[before[-1]]), alike=len(alike)))
            passed[name] = own[name]
        found.append(ways)
    return found
