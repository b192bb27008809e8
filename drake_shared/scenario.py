"""The world of a task: robot, start, goal, workspace, obstacles and the routes between them."""

import dataclasses
import functools
import itertools
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common.yaml import yaml_dump, yaml_load_data, yaml_load_typed

from drake_shared.errors import InputError
from drake_shared.files import models_directory
from drake_shared.obstacles import Box, Circle, ObstacleDistance, position_at
from drake_shared.paths import Path as RoutePath
from drake_shared.paths import passing_side

# yaml_load_typed builds every object from its defaults: what must be given starts as a number that the
# check for finite numbers refuses.
MUST_BE_GIVEN = math.nan
# A trial of more control steps is a slip of the pen, and would fill the memory with its log.
MOST_STEPS = 1_000_000

PLANTS = ("kinematic", "dynamic")


@dataclasses.dataclass(kw_only=True)
class Robot:
    """A differential-drive robot with a circular footprint; the defaults are the Pioneer P3-DX."""

    model: str = "pioneer_p3dx.sdf"
    """SDF file: a path, or the name of one in models/robots."""
    footprint_radius: float = 0.267
    """Swing radius about the middle of the axle, in [m]."""
    wheel_radius: float = 0.0975
    """In [m]."""
    track: float = 0.33
    """Distance between the wheels, in [m]."""
    max_speed: float = 1.2
    """Of each wheel along the floor, in [m/s]."""
    max_acceleration: float = 1.5
    """Of each wheel along the floor, in [m/s^2]."""

    @property
    def max_wheel_speed(self) -> float:
        """In [rad/s]."""
        return self.max_speed / self.wheel_radius

    @property
    def max_wheel_acceleration(self) -> float:
        """In [rad/s^2]."""
        return self.max_acceleration / self.wheel_radius

    def wheel_speeds(self, speed: float, yaw_rate: float) -> tuple[float, float]:
        """Wheel speeds (left, right), in [rad/s], that drive at ``speed`` [m/s] and ``yaw_rate`` [rad/s].

        Where a wheel would be too fast both are scaled alike, which keeps the radius of the turn.
        """
        turn = 0.5 * self.track * yaw_rate
        left, right = (speed - turn) / self.wheel_radius, (speed + turn) / self.wheel_radius
        fastest = max(abs(left), abs(right))
        if fastest > self.max_wheel_speed:
            scale = self.max_wheel_speed / fastest
            return left * scale, right * scale
        return left, right

    def twist(self, left: float, right: float) -> tuple[float, float]:
        """Speed, in [m/s], and yaw rate, in [rad/s], of the wheel speeds, in [rad/s]."""
        half = 0.5 * self.wheel_radius
        return half * (left + right), self.wheel_radius / self.track * (right - left)

    def model_path(self) -> Path:
        """Where the SDF file is."""
        given = Path(self.model)
        return given if given.is_file() else models_directory() / "robots" / self.model


@dataclasses.dataclass(kw_only=True)
class Start:
    """Pose at the start of a trial, in [m] and [rad], world frame."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


@dataclasses.dataclass(kw_only=True)
class Goal:
    """Where the robot is to come, in [m], world frame; it is there within ``radius``."""

    x: float = MUST_BE_GIVEN
    y: float = MUST_BE_GIVEN
    radius: float = 0.2


@dataclasses.dataclass(kw_only=True)
class Workspace:
    """The rectangle in which everything happens, in [m], world frame."""

    x_min: float = MUST_BE_GIVEN
    x_max: float = MUST_BE_GIVEN
    y_min: float = MUST_BE_GIVEN
    y_max: float = MUST_BE_GIVEN

    def contains(self, x: float, y: float) -> bool:
        """Whether the point lies inside, the border included."""
        return self.x_min <= x <= self.x_max and self.y_min <= y <= self.y_max


@dataclasses.dataclass(kw_only=True)
class Route:
    """A way from start to goal that an operator may have in mind."""

    name: str = ""
    waypoints: list[list[float]] = dataclasses.field(default_factory=list)
    """Points (x, y) in [m] that a smooth curve joins, from start to goal."""
    sides: dict[str, str] = dataclasses.field(default_factory=dict)
    """For the name of each obstacle that stands, "left" or "right": the side on which the robot passes it."""

    def path(self, start: Start) -> RoutePath:
        """The curve through the waypoints, leaving in the direction in which the robot stands."""
        return _curve(tuple(map(tuple, self.waypoints)), start.yaw)


@functools.lru_cache(maxsize=64)
def _curve(waypoints: tuple[tuple[float, ...], ...], heading: float) -> RoutePath:
    """Made once: every trial asks for it, and it never changes."""
    return RoutePath(np.array(waypoints, dtype=float), heading=heading)


@dataclasses.dataclass(kw_only=True)
class Scenario:
    """A task: see models/scenarios for examples. Lengths in [m], angles in [rad], times in [s]."""

    name: str = ""
    start: Start = dataclasses.field(default_factory=Start)
    goal: Goal = dataclasses.field(default_factory=Goal)
    workspace: Workspace = dataclasses.field(default_factory=Workspace)
    robot: Robot = dataclasses.field(default_factory=Robot)
    obstacles: list[Circle | Box] = dataclasses.field(default_factory=list)
    routes: list[Route] = dataclasses.field(default_factory=list)
    duration: float = 15.0
    """Time after which a trial is over."""
    control_period: float = 0.05
    travel_time: float = 11.0
    """Time in which an unhurried operator comes from start to goal."""
    plant: str = "kinematic"
    """"kinematic": wheels that never slip; "dynamic": mass, friction and motors."""

    @property
    def standing(self) -> list[Circle | Box]:
        """The obstacles that never move."""
        return [item for item in self.obstacles if not item.path]

    @property
    def steps(self) -> int:
        """Number of control steps in a trial."""
        return round(self.duration / self.control_period)

    def route(self, name: str) -> Route:
        """The route of that name.

        Raises:
            InputError: There is none.
        """
        for route in self.routes:
            if route.name == name:
                return route
        names = ", ".join(route.name for route in self.routes)
        raise InputError(f"scenario {self.name}", "routes", f"has no route {name!r}; there are: {names}")


def load_scenario(path: str | os.PathLike[str] | None = None) -> Scenario:
    """Reads and checks a scenario.

    Args:
        path: A YAML file, or the name of one in models/scenarios; the two-obstacle task if None.

    Raises:
        InputError: The file is missing, is no scenario, or describes what cannot be.
    """
    given = "two_obstacles" if path is None else os.fspath(path)
    file = Path(given)
    if not file.is_file():
        shipped = {item.stem: item for item in (models_directory() / "scenarios").glob("*.yaml")}
        if given not in shipped:
            raise InputError(given, "", f"must be a scenario file, or one of: {', '.join(sorted(shipped))}")
        file = shipped[given]
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(file, "", f"cannot be read as a scenario: {error}") from error
    return _read_scenario(text, source=file)


def scenario_from_dict(data: Mapping[str, Any], *, source: str | os.PathLike[str] = "scenario") -> Scenario:
    """The scenario that ``dataclasses.asdict`` made ``data`` of; logs hold theirs so.

    Raises:
        InputError: It is not what a scenario must be.
    """
    try:
        given = dict(data)
        given["obstacles"] = [
            {"_tag": "!Box" if "length" in item else "!Circle", **item} for item in given.get("obstacles", [])
        ]
        text = yaml_dump(json.loads(json.dumps(given)))
    except (TypeError, ValueError) as error:
        raise InputError(source, "", f"cannot be read as a scenario: {error}") from error
    return _read_scenario(text, source=source)


def _read_scenario(text: str, *, source: str | os.PathLike[str]) -> Scenario:
    """The scenario that a YAML text describes, checked."""
    text += "\n"  # No text at all would count as none given.
    try:
        scenario = yaml_load_typed(schema=Scenario, data=text)
    except Exception as error:  # It raises RuntimeError, yaml.YAMLError, TypeError and others.
        raise InputError(source, _field_at_fault(text), f"cannot be read: {error}") from error
    for item in scenario.obstacles:
        if item.path and math.isnan(item.x) and math.isnan(item.y):
            _check_obstacle_path(item, source)
            item.x, item.y = position_at(item, 0.0)
    check_scenario(scenario, source=source)
    return scenario


def _field_at_fault(text: str) -> str:
    """The first field that yaml_load_typed cannot take; empty if the fault lies in the whole.

    It does not say where it met a wrong type; but as everything has a default, each can be tried alone.
    """
    fields: list[str] = []
    tried: Any = Scenario()
    while dataclasses.is_dataclass(tried):
        try:
            given = yaml_load_data(text)
        except Exception:  # No YAML at all.
            break
        for name, value in given.items() if isinstance(given, dict) else ():
            alone = yaml_dump({name: value})
            try:
                yaml_load_typed(schema=type(tried), data=alone)
            except Exception:  # As above.
                fields.append(str(name))
                tried, text = getattr(tried, str(name), None), yaml_dump(value)
                break
        else:
            break
    return ".".join(fields)


def check_scenario(scenario: Scenario, *, source: str | os.PathLike[str] = "scenario") -> None:
    """Makes sure that a trial can be run in ``scenario``.

    Raises:
        InputError: Something is not finite, not positive where it must be, outside the workspace, in an
            obstacle with the footprint counted, or passes an obstacle on another side than it says.
    """
    _check_finite(scenario, "", source)
    _check_sizes(scenario, source)
    space = scenario.workspace
    placed: list[tuple[str, Any]] = [("start", scenario.start), ("goal", scenario.goal)]
    placed += [(f"obstacles: {item.name}", item) for item in scenario.standing]
    for field, item in placed:
        if not space.contains(item.x, item.y):
            raise InputError(source, field, "must lie inside the workspace", f"({item.x}, {item.y})")
    clearance = clearance_scorer(scenario)
    for field, point in (("start", scenario.start), ("goal", scenario.goal)):
        gap = clearance(np.array([[point.x, point.y]]))
        if gap <= 0:
            raise InputError(
                source, field, "must leave the robot free of obstacles", f"{gap:.3f} m of clearance"
            )
    for item in scenario.obstacles:
        if item.path:
            _check_moving(scenario, item, source)
    for route in scenario.routes:
        _check_route(scenario, route, clearance, source)


def clearance_scorer(scenario: Scenario):
    """A function of positions (n, 2) in [m]: the least clearance of the robot's body along them, in [m].

    Clearance is the distance from the robot's centre to the nearest obstacle, from SceneGraph, less the
    footprint's radius. Obstacles that move are left out: a position alone does not say when.
    """
    distance = ObstacleDistance(scenario.standing)
    footprint = scenario.robot.footprint_radius

    def clearance(positions: np.ndarray) -> float:
        return float(np.min(distance(positions))) - footprint

    return clearance


def _check_finite(item, field: str, source) -> None:
    """Every number in the dataclass ``item`` is finite; yaml reads .nan and .inf without a word."""
    for entry in dataclasses.fields(item):
        name = f"{field}.{entry.name}" if field else entry.name
        _check_value(getattr(item, entry.name), name, source)


def _check_value(value, name: str, source) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError(source, name, "must be given, as a finite number", value)
    if isinstance(value, list):
        for index, each in enumerate(value):
            _check_value(each, f"{name}[{index}]", source)
    elif dataclasses.is_dataclass(value):
        _check_finite(value, name, source)


def _check_sizes(scenario: Scenario, source) -> None:
    robot, space = scenario.robot, scenario.workspace
    if not scenario.name:
        raise InputError(source, "name", "must be given")
    positive = {f"{name}": getattr(scenario, name) for name in ("duration", "control_period", "travel_time")}
    positive |= {"goal.radius": scenario.goal.radius}
    positive |= {
        f"robot.{item.name}": getattr(robot, item.name)
        for item in dataclasses.fields(robot)
        if item.name != "model"
    }
    positive |= {
        "workspace's width": space.x_max - space.x_min,
        "workspace's height": space.y_max - space.y_min,
    }
    for index, obstacle in enumerate(scenario.obstacles):
        positive |= {f"obstacles[{index}].{name}": value for name, value in obstacle.sizes().items()}
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
            source, "robot.model", "must be an SDF file or one of models/robots", repr(robot.model)
        )
    if not scenario.routes:
        raise InputError(source, "routes", "must name at least one route")
    for field, names in (
        ("obstacles", [item.name for item in scenario.obstacles]),
        ("routes", [route.name for route in scenario.routes]),
    ):
        if not all(name.strip() for name in names):
            raise InputError(source, field, "must all have a name")
        if len(set(names)) != len(names):
            raise InputError(source, field, "must have names that differ", ", ".join(names))


def _check_obstacle_path(obstacle, source) -> None:
    field, path = f"obstacles: {obstacle.name}: path", obstacle.path
    if any(len(point) != 3 or not all(map(math.isfinite, point)) for point in path):
        raise InputError(source, field, "must be finite points [t, x, y]", path)
    if any(a[0] >= b[0] for a, b in itertools.pairwise(path)):
        raise InputError(source, field, "must go on in time", [point[0] for point in path])


def _check_moving(scenario: Scenario, obstacle, source) -> None:
    _check_obstacle_path(obstacle, source)
    field, start = f"obstacles: {obstacle.name}: path", scenario.start
    at_first = position_at(obstacle, 0.0)
    if math.dist(at_first, (obstacle.x, obstacle.y)) > 1e-6:
        raise InputError(source, field, f"must be at the obstacle's x and y at time 0, not at {at_first}")
    gap = float(ObstacleDistance([obstacle])(np.array([[start.x, start.y]]))[0])
    if gap <= scenario.robot.footprint_radius:
        left = f"{gap - scenario.robot.footprint_radius:.3f} m of clearance"
        raise InputError(source, field, "must not start on the robot", left)


def _check_route(scenario: Scenario, route: Route, clearance, source) -> None:
    field = f"routes: {route.name}"
    if len(route.waypoints) < 2 or any(len(point) != 2 for point in route.waypoints):
        raise InputError(source, field, "must have at least two waypoints [x, y]", route.waypoints)
    if any(math.dist(a, b) < 1e-6 for a, b in zip(route.waypoints, route.waypoints[1:], strict=False)):
        raise InputError(source, field, "must not have a waypoint twice in a row")
    ends = (("start", scenario.start, route.waypoints[0]), ("goal", scenario.goal, route.waypoints[-1]))
    for name, place, waypoint in ends:
        if math.dist((place.x, place.y), waypoint) > 1e-6:
            raise InputError(source, field, f"must lead from start to goal; it misses the {name}", waypoint)
    path = route.path(scenario.start)
    positions = path.position(np.linspace(0, path.length, max(50, int(path.length / 0.02))))
    outside = [point for point in positions if not scenario.workspace.contains(*point)]
    if outside:
        raise InputError(source, field, "must stay inside the workspace", np.round(outside[0], 3))
    gap = clearance(positions)
    if gap <= 0:
        raise InputError(source, field, "must leave the robot free of obstacles", f"{gap:.3f} m of clearance")
    names = {item.name for item in scenario.standing}
    if set(route.sides) != names:
        raise InputError(
            source, f"{field}: sides", f"must name every obstacle that stands ({', '.join(sorted(names))})"
        )
    for item in scenario.standing:
        side = passing_side(positions, (item.x, item.y))
        if route.sides[item.name] != side:
            raise InputError(
                source, f"{field}: sides: {item.name}", f"must be {side}", repr(route.sides[item.name])
            )
