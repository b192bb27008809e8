"""The task as data: robot, start, goal, workspace, obstacles and the routes between them."""

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.robots import Arm, DiffDrive, scaled_length
from drake_shared.scenario.obstacles import Box, Circle, ObstacleDistance
from drake_shared.scenario.paths import SPACING, Path as RoutePath
from drake_shared.scenario.space_path import SpacePath

# yaml_load_typed builds every object from its defaults. A field that must be given starts as NaN, which the
# check for finite numbers refuses.
MUST_BE_GIVEN = math.nan
# More control steps are a mistake, and their log would fill the memory.
MOST_STEPS = 1_000_000

PLANTS = ("kinematic", "dynamic")


@dataclasses.dataclass(kw_only=True)
class Start:
    """Pose at the start of a trial, in [m] and [rad], world frame; an arm starts at home instead."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


@dataclasses.dataclass(kw_only=True)
class Goal:
    """Position to reach, in [m], world frame; it is reached within ``radius``."""

    x: float = MUST_BE_GIVEN
    y: float = MUST_BE_GIVEN
    z: float = 0.0
    """For robots whose position has a z."""
    radius: float = 0.2
    name: str = ""
    """Needed where a scenario has several goals."""

    def position(self, names: Sequence[str]) -> tuple[float, ...]:
        """The coordinates of the goal that a robot's ``position_names`` name, in [m].

        Raises:
            InputError: A name is not x, y or z.
        """
        known = {"x": self.x, "y": self.y, "z": self.z}
        unknown = [name for name in names if name not in known]
        if unknown:
            raise InputError("robot", "position_names", "must be among x, y and z", ", ".join(unknown))
        return tuple(known[name] for name in names)


@dataclasses.dataclass(kw_only=True)
class Workspace:
    """Rectangle, or box for an arm, that contains the task, in [m], world frame."""

    x_min: float = MUST_BE_GIVEN
    x_max: float = MUST_BE_GIVEN
    y_min: float = MUST_BE_GIVEN
    y_max: float = MUST_BE_GIVEN
    z_min: float = 0.0
    """For an arm."""
    z_max: float = 0.0
    """For an arm."""

    def corners(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest coordinates (3,) of the box, in [m]."""
        low = np.array([self.x_min, self.y_min, self.z_min])
        return low, np.array([self.x_max, self.y_max, self.z_max])

    def contains(self, x: float, y: float) -> bool:
        """Whether the point lies inside or on the border."""
        return self.x_min <= x <= self.x_max and self.y_min <= y <= self.y_max


@dataclasses.dataclass(kw_only=True)
class Route:
    """An instructed path from start to a goal: the one at its last waypoint."""

    name: str = ""
    waypoints: list[list[float]] = dataclasses.field(default_factory=list)
    """Points (x, y), or (x, y, z) for an arm, in [m] that a smooth curve joins, from start to goal."""
    sides: dict[str, str] = dataclasses.field(default_factory=dict)
    """For the name of each static obstacle, "left" or "right": the side on which the robot passes it."""

    def path(self, start: Start, *, spacing: float = SPACING) -> RoutePath:
        """The curve through the waypoints, which leaves in the robot's direction at the start.

        Args:
            start: Of the scenario.
            spacing: Distance between the points that represent the curve, in [m]; see `Scenario.path_of`.
        """
        return _curve(tuple(map(tuple, self.waypoints)), start.yaw, spacing)


@functools.lru_cache(maxsize=64)
def _curve(waypoints: tuple[tuple[float, ...], ...], heading: float, spacing: float) -> RoutePath:
    """Cached: every trial needs the curve, and it never changes."""
    return RoutePath(np.array(waypoints, dtype=float), heading=heading, spacing=spacing)


@dataclasses.dataclass(kw_only=True)
class Scenario:
    """A task; see models/scenarios for examples. Lengths in [m], angles in [rad], times in [s]."""

    name: str = ""
    start: Start = dataclasses.field(default_factory=Start)
    goal: Goal = dataclasses.field(default_factory=Goal)
    """The goal; the first one where there are several."""
    goals: list[Goal] = dataclasses.field(default_factory=list)
    """All goals where there are several, in place of ``goal``; a trial ends at any of them."""
    workspace: Workspace = dataclasses.field(default_factory=Workspace)
    robot: DiffDrive | Arm = dataclasses.field(default_factory=DiffDrive)
    obstacles: list[Circle | Box] = dataclasses.field(default_factory=list)
    routes: list[Route] = dataclasses.field(default_factory=list)
    duration: float = 15.0
    """Time after which a trial is over."""
    control_period: float = 0.05
    travel_time: float = 11.0
    """Time in which an unhurried operator drives from start to a goal."""
    plant: str = "kinematic"
    """"kinematic": wheels that never slip; "dynamic": mass, friction and motors."""

    def __post_init__(self) -> None:
        if self.goals and math.isnan(self.goal.x):
            self.goal = self.goals[0]

    @property
    def all_goals(self) -> list[Goal]:
        """The goals, of which there is at least one."""
        return self.goals or [self.goal]

    @property
    def diff_drive(self) -> DiffDrive:
        """The robot of a scenario for a differential drive.

        Raises:
            InputError: The robot is another one.
        """
        if isinstance(self.robot, DiffDrive):
            return self.robot
        raise InputError(
            f"scenario {self.name}", "robot", "must be a DiffDrive here", type(self.robot).__name__
        )

    @property
    def static_obstacles(self) -> list[Circle | Box]:
        """The obstacles that never move."""
        return [item for item in self.obstacles if not item.path]

    def as_mapped(self) -> "Scenario":
        """The scenario as the agent knows it: without the obstacles that are not mapped."""
        return dataclasses.replace(self, obstacles=[item for item in self.obstacles if item.mapped])

    @property
    def steps(self) -> int:
        """Number of control steps in a trial."""
        return round(self.duration / self.control_period)

    def path_of(self, route: Route) -> RoutePath:
        """The curve of ``route``, of a differential drive, with points as close as suits its size."""
        return route.path(self.start, spacing=scaled_length(self.diff_drive, SPACING))

    def goal_of(self, route: Route) -> Goal:
        """The goal to which ``route`` leads: the one nearest to its last waypoint."""
        return self.goal_at(route.waypoints[-1])

    def goal_at(self, position: Sequence[float]) -> Goal:
        """The goal nearest to a position, with x and y first, in [m]."""
        x, y, *_ = position
        return min(self.all_goals, key=lambda goal: math.dist((goal.x, goal.y), (x, y)))

    def points_of(self, route: Route, count: int) -> NDArray[np.float64]:
        """Points (count, D), in [m], at equal distances along the curve of ``route``."""
        if isinstance(self.robot, Arm):
            return SpacePath(route.waypoints).positions(count)
        path = self.path_of(route)
        return path.position(np.linspace(0.0, path.length, count))

    def route(self, name: str) -> Route:
        """The route of that name.

        Raises:
            InputError: No route has that name.
        """
        for route in self.routes:
            if route.name == name:
                return route
        names = ", ".join(route.name for route in self.routes)
        raise InputError(f"scenario {self.name}", "routes", f"has no route {name!r}; there are: {names}")


def clearance_scorer(scenario: Scenario) -> Callable[[NDArray[np.float64]], float]:
    """A function of positions (n, D), in [m]: the least clearance of the robot's body along them, in [m].

    Clearance is the distance from the robot's centre to the nearest static obstacle, from SceneGraph, less
    the footprint's radius; for an arm, the distance from its tip. Moving obstacles do not count: positions
    without times cannot be compared to them.
    """
    distance = ObstacleDistance(scenario.static_obstacles)
    robot = scenario.robot
    footprint = robot.footprint_radius if isinstance(robot, DiffDrive) else 0.0

    def clearance(positions: NDArray[np.float64]) -> float:
        return float(np.min(distance(positions))) - footprint

    return clearance
