"""The scenes of the frozen benchmark: generated once from fixed seeds, and kept in a file."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing
from drake_shared.robots import DiffDrive
from drake_shared.scenario import Circle, Goal, Route, Scenario, Workspace, check_scenario
from drake_shared.scenario.obstacles import Obstacle
from drake_shared.scenario.paths import passing_side
from drake_shared.scenario.planar_distance import PlanarDistance
from drake_shared.scenario.route_planner import plan_routes

SCENES = "scenes-1"
"""Name and version of the set: a change of anything in it needs another one."""
COUNT = 50
TUNING = tuple(f"scene_{number}" for number in range(COUNT, COUNT + 4))
"""Further scenes, for tuning; they are never scored."""
KINDS = ("unmapped", "moved", "moving")
"""What changes in a scene after the demonstrations: an obstacle that the agent does not know appears, a known
one stands elsewhere, or one crosses. Scene n has the change n modulo 3."""
# As in RTV2_ws (arXiv 2509.19954): two or three goals, three to five obstacles, at the size of the Pioneer.
_GOALS, _OBSTACLES = (2, 3), (3, 4, 5)
_WORKSPACE = Workspace(x_min=-0.7, x_max=5.7, y_min=-2.3, y_max=2.3)
_DURATION, _TRAVEL_TIME = 18.0, 12.0
_GOAL_Y, _GOALS_APART = 1.7, 1.1
_RADII, _OBSTACLE_X, _OBSTACLE_Y = (0.18, 0.35), (1.2, 4.0), 1.5
# Free space round start and goals, and between obstacles, in [m]: some gaps are too narrow for the robot.
_FREE, _GAP = 0.67, 0.15
_NEW_RADIUS, _CROSSING = 0.15, 3.0
# Routes to a goal; cost of the longest as a multiple of the least; clearance; and distance to other goals.
_MOST_ROUTES, _LONGEST, _CLEARANCE, _FROM_GOALS = 2, 1.4, 0.1, 0.4
_WAYPOINTS, _CHECKED = 9, 400
_ATTEMPTS = 200


def generate(seed: int) -> tuple[Scenario, Scenario]:
    """The scene of a seed, and what it is changed to after the demonstrations: the same on every machine.

    Raises:
        InputError: No scene with a route to every goal was found.
    """
    random = np.random.default_rng(seed)
    for _ in range(_ATTEMPTS):
        scene = _with_routes(_drawn(random, f"scene_{seed:02d}"))
        changed = None if scene is None else _changed(random, scene, KINDS[seed % len(KINDS)])
        if scene is not None and changed is not None:
            return scene, changed
    raise InputError("compare", "seed", f"must give a scene within {_ATTEMPTS} attempts", seed)


def write_scenes(path: Path, count: int = COUNT + len(TUNING)) -> None:
    """Generates scenes and writes their file; `load_scenario` reads them by names as scenes-1/scene_00."""
    scenes = [scene for seed in range(count) for scene in generate(seed)]
    lines = ",\n".join(json.dumps(_as_stored(scene), separators=(",", ":")) for scene in scenes)
    with replacing(path) as temporary:
        temporary.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


def _as_stored(scene: Scenario) -> dict[str, Any]:
    """What differs from the defaults, so that the file stays as it is when fields are added."""

    def changed(item: Any) -> dict[str, Any]:
        plain = type(item)()
        values = {field.name: getattr(item, field.name) for field in dataclasses.fields(item)}
        return {name: value for name, value in values.items() if value != getattr(plain, name)}

    lists = {
        name: [changed(item) for item in getattr(scene, name)] for name in ("goals", "obstacles", "routes")
    }
    sizes = {"name": scene.name, "duration": scene.duration, "travel_time": scene.travel_time}
    return {**sizes, "workspace": changed(scene.workspace), **lists}


def _drawn(random: np.random.Generator, name: str) -> Scenario:
    """Goals and obstacles at random, without routes."""
    count, wanted = int(random.choice(_GOALS)), int(random.choice(_OBSTACLES))
    heights = np.zeros(count)
    while count > 1 and np.diff(np.sort(heights)).min() < _GOALS_APART:
        heights = random.uniform(-_GOAL_Y, _GOAL_Y, count).round(2)
    goals = [Goal(name=f"goal_{'abc'[index]}", x=5.0, y=y) for index, y in enumerate(heights.tolist())]
    scene = Scenario(
        name=name, goals=goals, workspace=_WORKSPACE, duration=_DURATION, travel_time=_TRAVEL_TIME
    )
    while len(scene.obstacles) < wanted:
        item = Circle(
            name=f"o{len(scene.obstacles)}",
            x=round(random.uniform(*_OBSTACLE_X), 2),
            y=round(random.uniform(-_OBSTACLE_Y, _OBSTACLE_Y), 2),
            radius=round(random.uniform(*_RADII), 2),
        )
        if _is_free(scene, item):
            scene.obstacles.append(item)
    return scene


def _is_free(scene: Scenario, item: Obstacle) -> bool:
    """Whether an obstacle leaves room to start, goals and the other obstacles."""
    ends = [(0.0, 0.0), *((goal.x, goal.y) for goal in scene.goals)]
    others = [other for other in scene.obstacles if other.name != item.name]
    gap = float(PlanarDistance(others).least(np.array(item.x), np.array(item.y))) - item.bounding_radius()
    return gap > _GAP and all(
        math.dist((item.x, item.y), end) - item.bounding_radius() > _FREE for end in ends
    )


def _changed(random: np.random.Generator, scene: Scenario, kind: str) -> Scenario | None:
    """The scene after a change, with routes for it; None if it leaves none to a goal."""
    obstacles = list(scene.obstacles)
    route = scene.routes[int(random.integers(len(scene.routes)))]
    path = scene.path_of(route)
    x, y = path.position(np.array([random.uniform(0.35, 0.65) * path.length]))[0].round(2).tolist()
    if kind == "moved":
        index, angle = int(random.integers(len(obstacles))), random.uniform(-math.pi, math.pi)
        old, far = obstacles[index], random.uniform(0.3, 0.6)
        new = dataclasses.replace(
            old, x=round(old.x + far * math.cos(angle), 2), y=round(old.y + far * math.sin(angle), 2)
        )
        obstacles[index] = new
    else:
        new = Circle(name="new", x=x, y=y, radius=_NEW_RADIUS, mapped=kind == "moving")
        if kind == "moving":
            # It crosses from one side to the other, and is on the route when an unhurried robot comes.
            side = float(random.choice([-1.0, 1.0]))
            middle = max(round(_TRAVEL_TIME * x / scene.goals[0].x, 2), _CROSSING + 0.1)
            new.path = [
                [round(middle + sign * _CROSSING, 2), x, round(y - sign * side * 1.8, 2)] for sign in (-1, 1)
            ]
            new.y = new.path[0][2]
        obstacles.append(new)
    changed = dataclasses.replace(scene, name=f"{scene.name}_{kind}", obstacles=obstacles, routes=[])
    if not new.path and not _is_free(changed, new):
        return None
    return dataclasses.replace(changed, routes=scene.routes) if new.path else _with_routes(changed)


def _with_routes(scene: Scenario) -> Scenario | None:
    """The scene with planned routes that can be driven; None if a goal has none, or there are under three."""
    routes: list[Route] = []
    counts = dict.fromkeys((goal.name for goal in scene.goals), 0)
    # The planner knows mapped obstacles; the driver sees all.
    seen = dataclasses.replace(
        scene, obstacles=[dataclasses.replace(item, mapped=True) for item in scene.obstacles]
    )
    for planned in plan_routes(seen, most=2 * _MOST_ROUTES, longest=_LONGEST):
        name = planned.goal.name
        route = _route(scene, planned.points, f"to_{name[-1]}{counts[name] + 1}")
        if counts[name] < _MOST_ROUTES and _is_valid(scene, route, planned.goal):
            routes.append(route)
            counts[name] += 1
    if min(counts.values()) == 0 or len(routes) < 3:
        return None
    return dataclasses.replace(scene, routes=routes)


def _route(scene: Scenario, points: NDArray[np.float64], name: str) -> Route:
    index = np.linspace(0, len(points) - 1, _WAYPOINTS).round().astype(int)
    route = Route(name=name, waypoints=points[index].round(3).tolist())
    positions = _positions(scene, route)
    sides = {item.name: passing_side(positions, (item.x, item.y)) for item in scene.static_obstacles}
    return dataclasses.replace(route, sides=sides)


def _positions(scene: Scenario, route: Route) -> NDArray[np.float64]:
    path = scene.path_of(route)
    return path.position(np.linspace(0.0, path.length, _CHECKED))


def _is_valid(scene: Scenario, route: Route, goal: Goal) -> bool:
    """Whether a route leaves room, stays away from other goals, and can be driven."""
    positions = _positions(scene, route)
    gap = PlanarDistance(scene.static_obstacles).least(*positions.T).min() - DiffDrive().footprint_radius
    others = [other for other in scene.goals if other is not goal]
    near = [np.hypot(*(positions - (other.x, other.y)).T).min() < _FROM_GOALS for other in others]
    if gap < _CLEARANCE or any(near):
        return False
    try:
        check_scenario(dataclasses.replace(scene, goals=[], goal=goal, routes=[route]))
    except InputError:
        return False
    return True
