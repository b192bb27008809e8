"""Checks that a trial can be run in a scenario."""

import dataclasses
import itertools
import math
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.robots import Arm, scaled_length
from drake_shared.scenario.arm_checks import check_arm
from drake_shared.scenario.obstacles import Obstacle, ObstacleDistance, position_at
from drake_shared.scenario.passages import widest_passage
from drake_shared.scenario.paths import passing_side
from drake_shared.scenario.planar_distance import PlanarDistance
from drake_shared.scenario.scenario import MOST_STEPS, PLANTS, Goal, Route, Scenario

MAX_NAME = 100
"""Of a scenario, in bytes: with date, number and suffix it must fit the name of a file."""


def check_scenario(scenario: Scenario, *, source: str | os.PathLike[str] = "scenario") -> None:
    """Makes sure that a trial can be run in ``scenario``.

    Raises:
        InputError: A value is not finite, or not positive where it must be; start, a goal or a route lies
            outside the workspace or closer to an obstacle than the footprint's radius; a goal has no route,
            or the obstacles leave no way to it; or a route passes an obstacle on another side than its
            ``sides`` have it, or leads through another goal.
    """
    _check_finite(scenario, "", source)
    if scenario.goals and scenario.goal != scenario.goals[0]:
        raise InputError(source, "goal", "cannot be combined with goals", scenario.goal)
    _check_sizes(scenario, source)
    if isinstance(scenario.robot, Arm):
        for item in scenario.obstacles:
            if item.path:
                check_obstacle_path(item, source)
        check_arm(scenario, scenario.robot, _named_goals(scenario), source=source)
        return
    space = scenario.workspace
    ends: list[tuple[str, Any]] = [("start", scenario.start), *_named_goals(scenario)]
    placed = ends + [(f"obstacles: {item.name}", item) for item in scenario.static_obstacles]
    for field, item in placed:
        if not space.contains(item.x, item.y):
            raise InputError(source, field, "must lie inside the workspace", f"({item.x}, {item.y})")
    distance = PlanarDistance(scenario.static_obstacles)
    for field, point in ends:
        gap = _clearance(scenario, distance, np.array([[point.x, point.y]]))
        if gap <= 0:
            raise InputError(
                source, field, "must leave the robot free of obstacles", f"{gap:.3f} m of clearance"
            )
    for item in scenario.obstacles:
        if item.path:
            _check_moving(scenario, item, source)
    for route in scenario.routes:
        _check_route(scenario, route, distance, source)
    reached = [id(scenario.goal_of(route)) for route in scenario.routes]
    for field, goal in _named_goals(scenario):
        if id(goal) not in reached:
            _check_passage(scenario, goal, source)
            raise InputError(source, field, "must have a route that leads to it")


def _named_goals(scenario: Scenario) -> list[tuple[str, Goal]]:
    """Each goal with the field that holds it."""
    if not scenario.goals:
        return [("goal", scenario.goal)]
    return [(f"goals: {goal.name}", goal) for goal in scenario.goals]


def _check_passage(scenario: Scenario, goal: Goal, source: str | os.PathLike[str]) -> None:
    """Checks that the obstacles leave a way to ``goal`` that is as wide as the robot."""
    width, needed = widest_passage(scenario, goal), 2.0 * scenario.diff_drive.footprint_radius
    if width < needed:
        field = next(name for name, item in _named_goals(scenario) if item is goal)
        expected = (
            f"must be reachable: the robot is {needed:.3f} m wide; the widest way between the obstacles"
        )
        raise InputError(source, field, f"{expected} from the start has about {width:.3f} m")


def _check_finite(item: Any, field: str, source: str | os.PathLike[str]) -> None:
    """Checks that every number in the dataclass ``item`` is finite; YAML allows .nan and .inf."""
    for entry in dataclasses.fields(item):
        if isinstance(item, Scenario) and item.goals and entry.name == "goal":
            continue
        name = f"{field}.{entry.name}" if field else entry.name
        _check_value(getattr(item, entry.name), name, source)


def _check_value(value: Any, name: str, source: str | os.PathLike[str]) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError(source, name, "must be given, as a finite number", value)
    if isinstance(value, list):
        for index, each in enumerate(value):
            _check_value(each, f"{name}[{index}]", source)
    elif dataclasses.is_dataclass(value):
        _check_finite(value, name, source)


def _check_name(name: str, source: str | os.PathLike[str]) -> None:
    """Checks the name of a scenario, which is part of the names of files."""
    if not name.strip():
        raise InputError(source, "name", "must be given")
    if not name.isprintable() or any(mark in name for mark in "/\\") or name.startswith("."):
        raise InputError(
            source, "name", "must be printable, without / and \\ and no dot in front", ascii(name)
        )
    if len(name.encode("utf-8", "replace")) > MAX_NAME:
        raise InputError(source, "name", f"must have at most {MAX_NAME} bytes", len(name.encode()))


def _check_yaw(yaw: float, field: str, source: str | os.PathLike[str]) -> None:
    if abs(yaw) > math.tau:
        degrees = f"{yaw:g}, which may be degrees: {yaw:g} degrees are {math.radians(yaw):.4f} rad"
        raise InputError(source, field, "must be in radians, from -2 pi to 2 pi", degrees)


def _check_sizes(scenario: Scenario, source: str | os.PathLike[str]) -> None:
    robot, space = scenario.robot, scenario.workspace
    _check_name(scenario.name, source)
    positive = {f"{name}": getattr(scenario, name) for name in ("duration", "control_period", "travel_time")}
    positive |= {f"{field}.radius": goal.radius for field, goal in _named_goals(scenario)}
    positive |= {
        f"robot.{item.name}": getattr(robot, item.name)
        for item in dataclasses.fields(robot)
        if isinstance(getattr(robot, item.name), float)
    }
    positive |= {
        "workspace's width": space.x_max - space.x_min,
        "workspace's height": space.y_max - space.y_min,
    }
    _check_yaw(scenario.start.yaw, "start.yaw", source)
    for index, obstacle in enumerate(scenario.obstacles):
        _check_yaw(obstacle.yaw_angle(), f"obstacles[{index}].yaw", source)
        positive |= {f"obstacles[{index}].{name}": value for name, value in obstacle.sizes().items()}
        if obstacle.height < 0.0:
            raise InputError(source, f"obstacles[{index}].height", "must not be negative", obstacle.height)
    for name, value in positive.items():
        if value <= 0:
            raise InputError(source, name, "must be positive", value)
    if scenario.plant not in PLANTS:
        raise InputError(source, "plant", f"must be one of {', '.join(PLANTS)}", repr(scenario.plant))
    steps = scenario.duration / scenario.control_period
    if steps < 0.5 or abs(steps - round(steps)) > 1e-6:
        raise InputError(source, "duration", "must be a whole number of control periods", scenario.duration)
    if steps > MOST_STEPS:
        raise InputError(
            source, "control_period", f"must leave at most {MOST_STEPS} steps", scenario.control_period
        )
    if not robot.model_path().is_file():
        raise InputError(
            source, "robot.model", "must be a model file or one of models/robots", repr(robot.model)
        )
    if not scenario.routes:
        raise InputError(source, "routes", "must name at least one route")
    for field, names in (
        ("obstacles", [item.name for item in scenario.obstacles]),
        ("routes", [route.name for route in scenario.routes]),
        ("goals", [goal.name for goal in scenario.goals]),
    ):
        if not all(name.strip() for name in names):
            raise InputError(source, field, "must all have a name")
        if not all(name.isprintable() for name in names):
            raise InputError(source, field, "must have printable names", ", ".join(map(ascii, names)))
        if len(set(names)) != len(names):
            raise InputError(source, field, "must have names that differ", ", ".join(names))


def check_obstacle_path(obstacle: Obstacle, source: str | os.PathLike[str]) -> None:
    """Checks the path of a moving obstacle.

    Raises:
        InputError: Its points are not finite, or its times do not increase.
    """
    field, path = f"obstacles: {obstacle.name}: path", obstacle.path
    if any(len(point) != 3 or not all(map(math.isfinite, point)) for point in path):
        raise InputError(source, field, "must be finite points [t, x, y]", path)
    if any(a[0] >= b[0] for a, b in itertools.pairwise(path)):
        raise InputError(source, field, "must have increasing times", [point[0] for point in path])


def _check_moving(scenario: Scenario, obstacle: Obstacle, source: str | os.PathLike[str]) -> None:
    check_obstacle_path(obstacle, source)
    field, start = f"obstacles: {obstacle.name}: path", scenario.start
    at_first = position_at(obstacle, 0.0)
    if math.dist(at_first, (obstacle.x, obstacle.y)) > 1e-6:
        raise InputError(source, field, f"must be at the obstacle's x and y at time 0, not at {at_first}")
    gap = float(ObstacleDistance([obstacle])(np.array([[start.x, start.y]]))[0])
    if gap <= scenario.diff_drive.footprint_radius:
        left = f"{gap - scenario.diff_drive.footprint_radius:.3f} m of clearance"
        raise InputError(source, field, "must not start on the robot", left)


def _clearance(scenario: Scenario, distance: PlanarDistance, positions: NDArray[np.float64]) -> float:
    """The least clearance of the robot's body at positions (n, 2), in [m]."""
    return float(distance.least(*positions.T).min()) - scenario.diff_drive.footprint_radius


def _check_route(
    scenario: Scenario,
    route: Route,
    distance: PlanarDistance,
    source: str | os.PathLike[str],
) -> None:
    field = f"routes: {route.name}"
    if len(route.waypoints) < 2 or any(len(point) != 2 for point in route.waypoints):
        raise InputError(source, field, "must have at least two waypoints [x, y]", route.waypoints)
    if any(math.dist(a, b) < 1e-6 for a, b in zip(route.waypoints, route.waypoints[1:], strict=False)):
        raise InputError(source, field, "must not have a waypoint twice in a row")
    goal = scenario.goal_of(route)
    ends = (("start", scenario.start, route.waypoints[0]), ("goal", goal, route.waypoints[-1]))
    for name, place, waypoint in ends:
        if math.dist((place.x, place.y), waypoint) > 1e-6:
            raise InputError(source, field, f"must lead from start to goal; it misses the {name}", waypoint)
    path = scenario.path_of(route)
    count = max(50, int(path.length / scaled_length(scenario.diff_drive, 0.02)))
    positions = path.position(np.linspace(0, path.length, count))
    space = scenario.workspace
    low, high = (space.x_min, space.y_min), (space.x_max, space.y_max)
    outside = ((positions < low) | (positions > high)).any(axis=1)
    if outside.any():
        raise InputError(source, field, "must stay inside the workspace", np.round(positions[outside][0], 3))
    gap = _clearance(scenario, distance, positions)
    if gap <= 0:
        _check_passage(scenario, goal, source)
        raise InputError(source, field, "must leave the robot free of obstacles", f"{gap:.3f} m of clearance")
    for other in scenario.all_goals:
        if other is not goal and np.hypot(*(positions - (other.x, other.y)).T).min() <= other.radius:
            raise InputError(source, field, f"must not lead through another goal, {other.name}")
    names = {item.name for item in scenario.static_obstacles}
    if set(route.sides) != names:
        raise InputError(
            source, f"{field}: sides", f"must name every static obstacle ({', '.join(sorted(names))})"
        )
    for item in scenario.static_obstacles:
        side = passing_side(positions, (item.x, item.y))
        if route.sides[item.name] != side:
            raise InputError(
                source, f"{field}: sides: {item.name}", f"must be {side}", repr(route.sides[item.name])
            )
