"""Lines on the floor for the page's maps: the instructed routes, and paths driven."""

from __future__ import annotations

from typing import Any

import numpy as np

from drake_shared.scenario import Scenario

_ROUTE_POINTS = 40
_PATH_POINTS = 300


def describe_instructed_routes(scenario: Scenario) -> list[dict[str, Any]]:
    """Returns ``name`` and ``path`` [[x, y], ...] of each route, in [m], world frame."""
    described = []
    for route in scenario.routes:
        points = scenario.points_of(route, _ROUTE_POINTS)[:, :2]
        described.append({"name": route.name, "path": thinned(points, _ROUTE_POINTS)})
    return described


def thinned(points: np.ndarray, most: int = _PATH_POINTS) -> list[list[float]]:
    """Returns at most ``most`` of the points (n, k), evenly spaced by index, both ends included."""
    count = min(len(points), most)
    index = np.unique(np.linspace(0, len(points) - 1, count).round().astype(int))
    chosen: list[list[float]] = np.round(points[index], 3).tolist()
    return chosen
