"""The task as data: robot, start, goal, workspace, obstacles and the routes between them."""

import dataclasses
import functools
import math

import numpy as np

from drake_shared.common.errors import InputError
from drake_shared.robots.diff_drive import DiffDrive
from drake_shared.scenario.obstacles import Box, Circle, ObstacleDistance
from drake_shared.scenario.paths import Path as RoutePath

# yaml_load_typed builds every object from its defaults: what must be given starts as a number that the
# check for finite numbers refuses.
MUST_BE_GIVEN = math.nan
# A trial of more control steps is a slip of the pen, and would fill the memory with its log.
MOST_STEPS = 1_000_000

PLANTS = ("kinematic", "dynamic")


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
    robot: DiffDrive = dataclasses.field(default_factory=DiffDrive)
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
    def static_obstacles(self) -> list[Circle | Box]:
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


def clearance_scorer(scenario: Scenario):
    """A function of positions (n, 2) in [m]: the least clearance of the robot's body along them, in [m].

    Clearance is the distance from the robot's centre to the nearest obstacle, from SceneGraph, less the
    footprint's radius. Obstacles that move are left out: a position alone does not say when.
    """
    distance = ObstacleDistance(scenario.static_obstacles)
    footprint = scenario.robot.footprint_radius

    def clearance(positions: np.ndarray) -> float:
        return float(np.min(distance(positions))) - footprint

    return clearance
