"""Mispredictions on purpose: what is driven in each case, and what became of the agent's mistake."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any

import numpy as np

from drake_shared.common.errors import InputError
from drake_shared.experiments.common import scenario_of
from drake_shared.experiments.report import number
from drake_shared.operators.named import changes_of_route, named_operator
from drake_shared.scenario import Route, Scenario, check_scenario, clearance_scorer
from drake_shared.scenario.obstacles import Circle
from drake_shared.scenario.paths import Path
from drake_shared.simulation.trial import Trial

PRESETS = ("paper", "default")
OPERATORS = ("primary", "stubborn")
CASES = {
    "unseen": "a route never taught",
    "changed": "a change of route",
    "obstacle": "a new obstacle",
    "narrow": "less room round it",
}
ARMS = {"on": "with authority", "off": "without"}
COMPARED = {
    ("none", "human"): "human alone",
    **{(preset, arm): f"{preset}, {words}" for preset in PRESETS for arm, words in ARMS.items()},
}
"""Of preset and arm, in the order of reading, with the label of each."""
LEAST = 95.0
"""Intent success that is asked for, in %."""
PARTED, NEAR, WATCHED = 0.15, 1.0, 2.0
"""A route is apart from others beyond the first, in [m], and an obstacle near within the second, in [m]; w is
watched for so long, in [s]."""
RADIUS = 0.15
"""Of a new obstacle, in [m]."""
ROOMS = {"obstacle": 0.3, "narrow": 0.15}
"""Beside a new obstacle, for the robot on its way round, in [m]."""
_HALF = 0.5
_LEAST_CLEARANCE = 0.08
_PLACES = np.linspace(0.2, 0.8, 25)
_SPACING = 0.02


@dataclasses.dataclass(frozen=True, kw_only=True)
class Drive:
    """What is driven in a trial of a case.

    Attributes:
        world: The scenario as it is; with a new obstacle, that is its last.
        route, then: What the operator means, and what after a change of mind.
        variant: Case and index among its `variants`; None in the scenario as it was taught.
    """

    world: Scenario
    route: str
    then: str | None = None
    variant: tuple[str, int] | None = None

    def path(self, name: str) -> Path:
        """The curve of a route."""
        return self.world.route(name).path(self.world.start)


def drive_of(scenario: str | None, case: str, learner: int, trial: int) -> Drive:
    """What is driven: the route this learner was not taught, a change, or round a new obstacle, in turn."""
    world = scenario_of(scenario)
    if case == "unseen":
        return Drive(world=world, route=untaught(world, learner).name)
    if case == "changed":
        changes = changes_of_route(world)
        route, then = changes[trial % len(changes)]
        return Drive(world=world, route=route.name, then=then.name)
    changed = variants(scenario, case)
    variant = trial % len(changed)
    return Drive(world=changed[variant], route=changed[variant].routes[0].name, variant=(case, variant))


@functools.cache
def variants(scenario: str | None, case: str = "obstacle") -> tuple[Scenario, ...]:
    """The scenario with a pillar in the way of a route that now goes round it, one for each possible route.

    The pillar stands where most room is left to go round it; routes with no such place are left out.

    Raises:
        InputError: There is no place on any route.
    """
    world = scenario_of(scenario)
    found = []
    for route in world.routes:
        possible = [
            _with_obstacle(world, route, share, side * ROOMS[case])
            for share in _PLACES
            for side in (1.0, -1.0)
        ]
        clearance, best = max(possible, key=lambda one: one[0])
        if best is not None and clearance >= _LEAST_CLEARANCE:
            found.append(best)
    if not found:
        raise InputError(f"scenario {world.name}", "routes", "must hold one with room round a new obstacle")
    return tuple(found)


def moment(scenario: str | None, drive: Drive, case: str, trial: Trial) -> float | None:
    """When the misprediction begins to matter, in [s]; None if it never did.

    unseen: the robot comes, by its nearest point on the operator's route, to where that is first farther
    than 0.15 m from every other route. changed: the operator changes. obstacle, narrow: the robot's
    centre is first within 1 m of the new obstacle's edge.
    """
    if case == "changed":
        return trial.metadata["behaviour"]["switch_time"]
    if case in ROOMS:
        new = drive.world.obstacles[-1]
        apart = np.hypot(*(trial.positions - (new.x, new.y)).T) - new.bounding_radius()
        there = apart <= NEAR
    else:
        own, parting = points_of(drive.path(drive.route)), _parting(scenario, drive.route)
        if parting is None:
            return None
        there = _distances(trial.positions, own).argmin(axis=1) >= parting
    return float(trial["t"][there.argmax()]) if there.any() else None


def recovery(trial: Trial, begun: float | None) -> dict[str, Any]:
    """What became of the human's weight w after the moment ``begun``, in [s].

    Returns:
        weight: "above" if w was above 0.5 throughout the 2 s from that moment (or what was left), "never" if
            it fell and did not come back before the end, "back" if it did, "unmet" if there was no such
            moment. recovery: where it came back, the time from the moment to that, in [s], else NaN.
    """
    if begun is None or begun > trial["t"][-1]:
        return {"weight": "unmet", "recovery": math.nan}
    since = trial["t"] >= begun - 1e-9
    times, human = trial["t"][since], trial["human_weight"][since] > _HALF
    if human[times <= begun + WATCHED].all():
        return {"weight": "above", "recovery": math.nan}
    fell = int(np.argmin(human))
    if not human[fell:].any():
        return {"weight": "never", "recovery": math.nan}
    return {"weight": "back", "recovery": float(times[fell + int(np.argmax(human[fell:]))] - begun)}


def strayed(drive: Drive, trial: Trial) -> float:
    """Largest distance of the robot from the route meant at the time, in [m]."""
    distance = _distances(trial.positions, points_of(drive.path(drive.route))).min(axis=1)
    if drive.then is not None:
        after = trial["t"] >= trial.metadata["behaviour"]["switch_time"]
        distance[after] = _distances(trial.positions[after], points_of(drive.path(drive.then))).min(axis=1)
    return float(distance.max())


def rooms_in_words(scenario: str | None) -> str:
    """The clearance of the ways round, in words."""
    said = []
    for case in ROOMS:
        found = [
            clearance_scorer(world)(points_of(world.routes[0].path(world.start)))
            for world in variants(scenario, case)
        ]
        said.append(f"{number(min(found))} to {number(max(found))} m of clearance ({CASES[case]})")
    return " and ".join(said)


def switch_time_in(scenario: str | None) -> float:
    """When the operator changes the route, in [s]."""
    return named_operator("switching").behaviour_in(scenario_of(scenario)).switch_time


def untaught(world: Scenario, learner: int) -> Route:
    """The route that a learner of that index is not taught; routes take turns."""
    return world.routes[learner % len(world.routes)]


def _with_obstacle(world: Scenario, route: Route, share: float, room: float) -> tuple[float, Scenario | None]:
    """The route round a pillar at a share of its length, with so much room to the left, or right if negative.

    Returns:
        Its clearance, in [m], and the scenario; minus infinity and None if it cannot be driven.
    """
    path = route.path(world.start)
    along = share * path.length
    x, y, yaw, _ = path.frame(along)
    aside = math.copysign(RADIUS + world.robot.footprint_radius + abs(room), room)
    whole = (0.0, path.length)
    arcs = [path.nearest(*point, between=whole) for point in route.waypoints]
    inner = zip(arcs[1:-1], route.waypoints[1:-1], strict=True)
    points = [(arc, point) for arc, point in inner if abs(arc - along) > abs(aside)]
    points.append((along, [x - aside * math.sin(yaw), y + aside * math.cos(yaw)]))
    waypoints = [route.waypoints[0], *(point for _, point in sorted(points)), route.waypoints[-1]]
    pillar = Circle(name="new_obstacle", x=x, y=y, radius=RADIUS)
    sides = {**route.sides, pillar.name: "left" if room > 0 else "right"}
    changed = dataclasses.replace(
        world,
        name=f"{world.name}_{route.name}_blocked",
        obstacles=[*world.obstacles, pillar],
        routes=[dataclasses.replace(route, waypoints=waypoints, sides=sides)],
    )
    try:
        check_scenario(changed)
    except InputError:
        return -math.inf, None
    return clearance_scorer(changed)(points_of(changed.routes[0].path(world.start))), changed


@functools.cache
def _parting(scenario: str | None, name: str) -> int | None:
    """Index of the first of a route's points that is apart from all other routes."""
    world = scenario_of(scenario)
    own = points_of(world.route(name).path(world.start))
    others = [points_of(route.path(world.start)) for route in world.routes if route.name != name]
    apart = _distances(own, np.concatenate(others)).min(axis=1) > PARTED
    return int(apart.argmax()) if apart.any() else None


def points_of(path: Path) -> np.ndarray:
    """Points (m, 2) along a path, in [m]."""
    return path.position(np.linspace(0.0, path.length, int(path.length / _SPACING) + 1))


def _distances(positions: np.ndarray, points: np.ndarray) -> np.ndarray:
    """From each position (n, 2) to each point (m, 2): shape (n, m), in [m]."""
    apart = positions[:, None, :] - points
    return np.hypot(apart[..., 0], apart[..., 1])
