"""The cases in which the agent mispredicts: what the operator drives, and how the human weight recovers."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.experiments.common import scenario_of
from drake_shared.experiments.training import PRESETS
from drake_shared.operators.named import changes_of_route, named_operator
from drake_shared.scenario import Route, Scenario, check_scenario, clearance_scorer
from drake_shared.scenario.obstacles import Circle
from drake_shared.scenario.paths import Path
from drake_shared.simulation.trial import Trial

OPERATORS = ("primary", "stubborn")
CASES = {
    "unseen": "a route without demonstrations",
    "changed": "a change of route",
    "obstacle": "a new obstacle",
    "narrow": "a narrow passage",
}
ARMS = {"on": "with authority", "off": "without"}
LINES = {
    ("none", "human"): "human alone",
    **{(preset, arm): f"{preset}, {words}" for preset in PRESETS for arm, words in ARMS.items()},
}
"""Preset and arm, in the order of the report, with the label of each."""
LEAST = 95.0
"""Required intent success, in %."""
PARTED, NEAR, WATCHED = 0.15, 1.0, 2.0
"""Distances between routes and from a new obstacle, in [m], and the time for which w is evaluated, in [s]."""
RADIUS = 0.15
"""Of a new obstacle, in [m]."""
PASSAGES = {"obstacle": 0.3, "narrow": 0.15}
"""Space beside the robot on its route round a new obstacle, in [m]."""
_HALF = 0.5
_LEAST_CLEARANCE = 0.08
_PLACES = np.linspace(0.2, 0.8, 25)
_SPACING = 0.02


@dataclasses.dataclass(frozen=True, kw_only=True)
class Drive:
    """What the operator drives in a trial.

    Attributes:
        world: The scenario; a new obstacle is its last.
        route, then: The instructed route, and the one after a change.
        variant: Case and index among its `variants`; None in the scenario of the demonstrations.
    """

    world: Scenario
    route: str
    then: str | None = None
    variant: tuple[str, int] | None = None

    def path(self, name: str) -> Path:
        """The path of a route."""
        return self.world.route(name).path(self.world.start)

    def distances(self, name: str, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """The distance of each position (n, 2) from a route, shape (n,), in [m]."""
        distances: NDArray[np.float64] = _distances(positions, points_of(self.path(name))).min(axis=1)
        return distances


def drive_of(scenario: str | None, case: str, learner: int, trial: int) -> Drive:
    """The drive of a trial: the route without demonstrations, a change, or round a new obstacle."""
    world = scenario_of(scenario)
    if case == "unseen":
        return Drive(world=world, route=route_left_out(world, learner).name)
    if case == "changed":
        changes = changes_of_route(world)
        route, then = changes[trial % len(changes)]
        return Drive(world=world, route=route.name, then=then.name)
    changed = variants(scenario, case)
    variant = trial % len(changed)
    return Drive(world=changed[variant], route=changed[variant].routes[0].name, variant=(case, variant))


def route_left_out(world: Scenario, learner: int) -> Route:
    """The route of which a learner has no demonstration; learners alternate between the routes."""
    return world.routes[learner % len(world.routes)]


@functools.cache
def variants(scenario: str | None, case: str = "obstacle") -> tuple[Scenario, ...]:
    """The scenario with a new obstacle on a route, which now passes beside it, for each route where possible.

    The obstacle stands where the route round it has the largest clearance.

    Raises:
        InputError: No route can pass beside a new obstacle.
    """
    world = scenario_of(scenario)
    found: list[Scenario] = []
    for route in world.routes:
        possible = (
            _with_obstacle(world, route, share, side * PASSAGES[case])
            for share in _PLACES
            for side in (1.0, -1.0)
        )
        # Whether a scenario is valid takes longer to find out than its clearance.
        ordered = sorted(((_clearance(one), one) for one in possible), key=lambda one: -one[0])
        roomy = (one for clearance, one in ordered if clearance >= _LEAST_CLEARANCE)
        found += itertools.islice(filter(_is_valid, roomy), 1)
    if not found:
        expected = "must contain a route that can pass beside a new obstacle"
        raise InputError(f"scenario {world.name}", "routes", expected)
    return tuple(found)


def _with_obstacle(world: Scenario, route: Route, share: float, space: float) -> Scenario:
    """The scenario with a new obstacle, which one route passes on the left, or right if ``space`` < 0."""
    path = route.path(world.start)
    along = share * path.length
    x, y, yaw, _ = path.frame(along)
    aside = math.copysign(RADIUS + world.diff_drive.footprint_radius + abs(space), space)
    whole = (0.0, path.length)
    arcs = [path.nearest(*point, between=whole) for point in route.waypoints]
    inner = zip(arcs[1:-1], route.waypoints[1:-1], strict=True)
    points = [(arc, point) for arc, point in inner if abs(arc - along) > abs(aside)]
    points.append((along, [x - aside * math.sin(yaw), y + aside * math.cos(yaw)]))
    waypoints = [route.waypoints[0], *(point for _, point in sorted(points)), route.waypoints[-1]]
    pillar = Circle(name="new_obstacle", x=x, y=y, radius=RADIUS)
    sides = {**route.sides, pillar.name: "left" if space > 0 else "right"}
    return dataclasses.replace(
        world,
        name=f"{world.name}_{route.name}_blocked",
        obstacles=[*world.obstacles, pillar],
        routes=[dataclasses.replace(route, waypoints=waypoints, sides=sides)],
    )


def _is_valid(scenario: Scenario) -> bool:
    try:
        check_scenario(scenario)
    except InputError:
        return False
    return True


def _clearance(world: Scenario) -> float:
    """The clearance of the first route, in [m]."""
    return clearance_scorer(world)(points_of(world.routes[0].path(world.start)))


def clearances(scenario: str | None) -> dict[str, list[float]]:
    """The clearance of the routes round a new obstacle by the name of the case, in [m]."""
    return {CASES[case]: [_clearance(world) for world in variants(scenario, case)] for case in PASSAGES}


def moment(scenario: str | None, drive: Drive, case: str, trial: Trial) -> float | None:
    """The time from which the misprediction matters, in [s]; None if there is none.

    unseen: the nearest point on the instructed route is the first that is farther than 0.15 m from all other
    routes. changed: the operator changes the route. obstacle, narrow: the robot's centre is first within 1 m
    of the edge of the new obstacle.
    """
    if case == "changed":
        return float(trial.metadata["behaviour"]["switch_time"])
    if case in PASSAGES:
        new = drive.world.obstacles[-1]
        reached = np.hypot(*(trial.positions - (new.x, new.y)).T) - new.bounding_radius() <= NEAR
    else:
        parting = _parting(scenario, drive.route)
        if parting is None:
            return None
        nearest = _distances(trial.positions, points_of(drive.path(drive.route))).argmin(axis=1)
        reached = nearest >= parting
    return float(trial["t"][reached.argmax()]) if reached.any() else None


def recovery(trial: Trial, start: float | None) -> dict[str, Any]:
    """How the human weight w recovers after a time ``start``, in [s].

    Returns:
        weight: "above" if w was above 0.5 throughout the 2 s from that time (or the rest of the trial),
            "back" if it fell and rose again, "never" if it fell and did not rise before the end, "unmet" if
            ``start`` is None or after the end.
        recovery: The time until it rose again, in [s]; NaN in all other cases.
    """
    if start is None or start > trial["t"][-1]:
        return {"weight": "unmet", "recovery": math.nan}
    since = trial["t"] >= start - 1e-9
    times, high = trial["t"][since], trial["human_weight"][since] > _HALF
    if high[times <= start + WATCHED].all():
        return {"weight": "above", "recovery": math.nan}
    fell = int(np.argmin(high))
    if not high[fell:].any():
        return {"weight": "never", "recovery": math.nan}
    return {"weight": "back", "recovery": float(times[fell + int(np.argmax(high[fell:]))] - start)}


def largest_deviation(drive: Drive, trial: Trial) -> float:
    """Largest distance of the robot from the route instructed at the time, in [m]."""
    distance = drive.distances(drive.route, trial.positions)
    if drive.then is not None:
        after = trial["t"] >= trial.metadata["behaviour"]["switch_time"]
        distance[after] = drive.distances(drive.then, trial.positions[after])
    return float(distance.max())


def switch_time_in(scenario: str | None) -> float:
    """The time at which the operator changes the route, in [s]."""
    return named_operator("switching").behaviour_in(scenario_of(scenario)).switch_time


@functools.cache
def _parting(scenario: str | None, name: str) -> int | None:
    """Index of the first point of a route that is separate from all other routes."""
    world = scenario_of(scenario)
    own = points_of(world.route(name).path(world.start))
    others = [points_of(route.path(world.start)) for route in world.routes if route.name != name]
    separate = _distances(own, np.concatenate(others)).min(axis=1) > PARTED
    return int(separate.argmax()) if separate.any() else None


def points_of(path: Path) -> NDArray[np.float64]:
    """Points (m, 2) along a path, in [m]."""
    return path.position(np.linspace(0.0, path.length, int(path.length / _SPACING) + 1))


def _distances(positions: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """From each position (n, 2) to each point (m, 2): shape (n, m), in [m]."""
    offset = positions[:, None, :] - points
    return np.hypot(offset[..., 0], offset[..., 1])
