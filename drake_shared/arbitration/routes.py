"""The routes that a driver may intend: those of demonstrations, and those round known obstacles."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.robots import scaled_length
from drake_shared.scenario import Scenario
from drake_shared.scenario.paths import passing_side
from drake_shared.scenario.planar_distance import PlanarDistance
from drake_shared.scenario.route_planner import PlannedRoute, equidistant, plan_routes

Floats = NDArray[np.float64]

POINTS = 201
# A demonstrated route that comes closer to an obstacle, in [m] for the Pioneer P3-DX, is given up: the
# obstacle was not there when it was demonstrated.
_LEAST_CLEARANCE = 0.02


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Routes:
    """Routes that a driver may intend.

    Attributes:
        points: Shape (K, 201, 2), in [m], world frame, at equal distances along each route.
        lengths: Shape (K,), in [m].
        demonstrated: Shape (K,), whether a route was demonstrated; the others were planned.
    """

    points: Floats
    lengths: Floats
    demonstrated: NDArray[np.bool_]


def routes_of(
    scenario: Scenario, demonstrated: Sequence[Floats], planned: Sequence[PlannedRoute] | None = None
) -> Routes:
    """The demonstrated routes that are clear of known obstacles, and a planned one for each further way.

    Args:
        scenario: Its static obstacles are known.
        demonstrated: Paths (n, 2), in [m].
        planned: What `plan_routes` returns for the scenario, if that is known already.

    Raises:
        InputError: There is no route.
    """
    planned = plan_routes(scenario) if planned is None else planned
    named = {item.name: (item.x, item.y) for item in scenario.static_obstacles}
    distance = PlanarDistance(scenario.static_obstacles)
    least = scenario.diff_drive.footprint_radius + scaled_length(scenario.diff_drive, _LEAST_CLEARANCE)
    paths = [equidistant(path, POINTS) for path in demonstrated]
    paths = [path for path in paths if distance.least(*path.T).min() >= least]

    def is_demonstrated(route: PlannedRoute) -> bool:
        return any(
            scenario.goal_at(path[-1]) is route.goal
            and all(
                (passing_side(path, named[name]) == "left") == left for name, left in route.passes.items()
            )
            for path in demonstrated
        )

    demonstrated = list(paths)
    count = len(paths)
    paths += [equidistant(route.points, POINTS) for route in planned if not is_demonstrated(route)]
    if not paths:
        expected = "must leave a way for the robot from start to goal"
        raise InputError(f"scenario {scenario.name}", "obstacles", expected)
    return Routes(
        points=np.stack(paths),
        lengths=np.array([np.hypot(*np.diff(path, axis=0).T).sum() for path in paths]),
        demonstrated=np.arange(len(paths)) < count,
    )
