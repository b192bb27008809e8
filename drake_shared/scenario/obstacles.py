"""Obstacles of a task: their shapes, where they stand, and how far points are from them."""

import dataclasses
import math

import numpy as np
from pydrake.geometry import (
    Box as BoxShape,
)
from pydrake.geometry import (
    Cylinder,
    GeometryId,
    GeometryInstance,
    IllustrationProperties,
    ProximityProperties,
    QueryObject,
    Rgba,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform, RollPitchYaw

_DRAWN_HEIGHT = 0.3
# Obstacles are felt in the plane: geometry this tall has its nearest face at the side, never at the top.
_FELT_HEIGHT = 1.0e3
_COLOR = Rgba(0.45, 0.50, 0.56, 1.0)


@dataclasses.dataclass(kw_only=True)
class Circle:
    """A round pillar at (``x``, ``y``), in [m], world frame; it moves if it has a path."""

    name: str = ""
    x: float = math.nan
    y: float = math.nan
    radius: float = math.nan
    path: list[list[float]] = dataclasses.field(default_factory=list)
    """Points [t, x, y] in [s] and [m]; straight and even between them, at rest before and after."""

    def sizes(self) -> dict[str, float]:
        """What must be positive."""
        return {"radius": self.radius}

    def shape(self, height: float) -> Shape:
        """The pillar, ``height`` m tall, about its own centre."""
        return Cylinder(self.radius, height)

    def yaw_angle(self) -> float:
        """A circle has no direction."""
        return 0.0

    def bounding_radius(self) -> float:
        """Radius of the least circle about (x, y) that holds the obstacle, in [m]."""
        return self.radius


@dataclasses.dataclass(kw_only=True)
class Box:
    """A wall or crate centred at (``x``, ``y``), turned by ``yaw``, in [m] and [rad], world frame.

    ``length`` lies along the box's own x, ``width`` along its y. It moves, without turning, if it has a path.
    """

    name: str = ""
    x: float = math.nan
    y: float = math.nan
    length: float = math.nan
    width: float = math.nan
    yaw: float = 0.0
    path: list[list[float]] = dataclasses.field(default_factory=list)
    """Points [t, x, y] in [s] and [m]; straight and even between them, at rest before and after."""

    def sizes(self) -> dict[str, float]:
        """What must be positive."""
        return {"length": self.length, "width": self.width}

    def shape(self, height: float) -> Shape:
        """The box, ``height`` m tall, about its own centre."""
        return BoxShape(self.length, self.width, height)

    def yaw_angle(self) -> float:
        """Its direction, in [rad]."""
        return self.yaw

    def bounding_radius(self) -> float:
        """Radius of the least circle about (x, y) that holds the obstacle, in [m]."""
        return math.hypot(self.length, self.width) / 2


Obstacle = Circle | Box


def position_at(obstacle: Obstacle, time: float) -> tuple[float, float]:
    """Where the obstacle is at ``time``, in [s] from the start of a trial: (x, y) in [m], world frame."""
    if not obstacle.path:
        return obstacle.x, obstacle.y
    times, xs, ys = zip(*obstacle.path, strict=True)
    return float(np.interp(time, times, xs)), float(np.interp(time, times, ys))


def register_obstacles(scene_graph: SceneGraph, obstacles: list[Obstacle]) -> list[GeometryId]:
    """Anchors the obstacles in ``scene_graph``, to be felt (proximity) and seen (illustration).

    One that moves is anchored where it is at first; `drake_shared.systems.moving_obstacles` moves it.

    Returns:
        The identifiers of what can be felt, in the order of ``obstacles``.
    """
    source = scene_graph.RegisterSource("obstacles")
    felt = []
    for obstacle in obstacles:
        solid, drawn = obstacle_geometry(obstacle, obstacle.x, obstacle.y)
        felt.append(scene_graph.RegisterAnchoredGeometry(source, solid))
        scene_graph.RegisterAnchoredGeometry(source, drawn)
    return felt


def obstacle_geometry(obstacle: Obstacle, x: float, y: float) -> tuple[GeometryInstance, GeometryInstance]:
    """What is felt of an obstacle and what is seen, at (``x``, ``y``) of their frame, in [m]."""
    rotation = RollPitchYaw(0, 0, obstacle.yaw_angle())
    X_FG = RigidTransform(rotation, [x, y, 0])
    solid = GeometryInstance(X_FG, obstacle.shape(_FELT_HEIGHT), obstacle.name)
    solid.set_proximity_properties(ProximityProperties())
    X_FG = RigidTransform(rotation, [x, y, _DRAWN_HEIGHT / 2])
    drawn = GeometryInstance(X_FG, obstacle.shape(_DRAWN_HEIGHT), f"{obstacle.name}_drawn")
    illustration = IllustrationProperties()
    illustration.AddProperty("phong", "diffuse", _COLOR)
    drawn.set_illustration_properties(illustration)
    return solid, drawn


def least_distance(query: QueryObject, x: float, y: float) -> float:
    """Distance in the plane from (``x``, ``y``) to the nearest obstacle, in [m]; negative inside one.

    Infinite where there is no obstacle.
    """
    found = query.ComputeSignedDistanceToPoint(np.array([x, y, 0.0]))
    return min((item.distance for item in found), default=math.inf)


class ObstacleDistance:
    """Distances to a fixed set of obstacles, through SceneGraph but without a diagram around it."""

    def __init__(self, obstacles: list[Obstacle]) -> None:
        self._scene_graph = SceneGraph()
        register_obstacles(self._scene_graph, obstacles)
        self._context = self._scene_graph.CreateDefaultContext()
        self._query = self._scene_graph.get_query_output_port().Eval(self._context)

    def __call__(self, positions: np.ndarray) -> np.ndarray:
        """Distance from each of ``positions`` (n, 2) in [m] to the nearest obstacle: (n,), in [m]."""
        return np.array([least_distance(self._query, x, y) for x, y in np.reshape(positions, (-1, 2))])
