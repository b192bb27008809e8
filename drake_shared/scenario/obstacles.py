"""Obstacles of a task: shapes, places, geometry in a SceneGraph, and distances to them."""

import dataclasses
import math
from collections.abc import Collection

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import (
    Box as BoxShape,
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
# Distances are measured in the plane: the nearest face of a geometry this tall is at its side, never on top.
_PROXIMITY_HEIGHT = 1.0e3
_COLOR = Rgba(0.45, 0.50, 0.56, 1.0)


@dataclasses.dataclass(kw_only=True)
class Circle:
    """A round pillar at (``x``, ``y``), in [m], world frame; it moves if it has a path."""

    name: str = ""
    x: float = math.nan
    y: float = math.nan
    radius: float = math.nan
    z: float = 0.0
    """Height of its bottom, in [m], if it has a height."""
    height: float = 0.0
    """In [m]; 0 for an obstacle without top and bottom, as robots on a floor meet it."""
    path: list[list[float]] = dataclasses.field(default_factory=list)
    """Points [t, x, y] in [s] and [m]; linear between them, at rest before the first and after the last."""
    mapped: bool = True
    """Whether the agent knows it. The human and the safety filter see any obstacle."""

    def sizes(self) -> dict[str, float]:
        """Fields that must be positive, by name."""
        return {"radius": self.radius}

    def shape(self, height: float) -> Shape:
        """The pillar, ``height`` m tall, about its own centre."""
        return Cylinder(self.radius, height)

    def yaw_angle(self) -> float:
        """Zero: a circle has no direction."""
        return 0.0

    def bounding_radius(self) -> float:
        """Radius of the smallest circle about (x, y) that contains the obstacle, in [m]."""
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
    z: float = 0.0
    """Height of its bottom, in [m], if it has a height."""
    height: float = 0.0
    """In [m]; 0 for an obstacle without top and bottom, as robots on a floor meet it."""
    path: list[list[float]] = dataclasses.field(default_factory=list)
    """Points [t, x, y] in [s] and [m]; linear between them, at rest before the first and after the last."""
    mapped: bool = True
    """Whether the agent knows it. The human and the safety filter see any obstacle."""

    def sizes(self) -> dict[str, float]:
        """Fields that must be positive, by name."""
        return {"length": self.length, "width": self.width}

    def shape(self, height: float) -> Shape:
        """The box, ``height`` m tall, about its own centre."""
        return BoxShape(self.length, self.width, height)

    def yaw_angle(self) -> float:
        """Direction of the box's own x, in [rad]."""
        return self.yaw

    def bounding_radius(self) -> float:
        """Radius of the smallest circle about (x, y) that contains the obstacle, in [m]."""
        return math.hypot(self.length, self.width) / 2


Obstacle = Circle | Box


def position_at(obstacle: Obstacle, time: float) -> tuple[float, float]:
    """Position (x, y) of the obstacle, in [m], world frame, at ``time``, in [s] from the start of a trial."""
    if not obstacle.path:
        return obstacle.x, obstacle.y
    times, xs, ys = zip(*obstacle.path, strict=True)
    return float(np.interp(time, times, xs)), float(np.interp(time, times, ys))


def register_obstacles(scene_graph: SceneGraph, obstacles: list[Obstacle]) -> list[GeometryId]:
    """Anchors the obstacles in ``scene_graph``, with proximity and illustration geometry.

    One that moves is anchored at its first position; `drake_shared.systems.moving_obstacles` moves it.

    Returns:
        The proximity geometries, in the order of ``obstacles``.
    """
    source = scene_graph.RegisterSource("obstacles")
    solids = []
    for obstacle in obstacles:
        solid, drawn = obstacle_geometry(obstacle, obstacle.x, obstacle.y)
        solids.append(scene_graph.RegisterAnchoredGeometry(source, solid))
        scene_graph.RegisterAnchoredGeometry(source, drawn)
    return solids


def obstacle_geometry(obstacle: Obstacle, x: float, y: float) -> tuple[GeometryInstance, GeometryInstance]:
    """Proximity and illustration geometry of an obstacle, at (``x``, ``y``) of their frame, in [m]."""
    rotation = RollPitchYaw(0, 0, obstacle.yaw_angle())
    drawn_height = obstacle.height or _DRAWN_HEIGHT
    middle = obstacle.z + drawn_height / 2
    X_FG = RigidTransform(rotation, [x, y, middle if obstacle.height else 0.0])
    solid = GeometryInstance(X_FG, obstacle.shape(obstacle.height or _PROXIMITY_HEIGHT), obstacle.name)
    solid.set_proximity_properties(ProximityProperties())
    X_FG = RigidTransform(rotation, [x, y, middle])
    drawn = GeometryInstance(X_FG, obstacle.shape(drawn_height), f"{obstacle.name}_drawn")
    illustration = IllustrationProperties()
    illustration.AddProperty("phong", "diffuse", _COLOR)
    drawn.set_illustration_properties(illustration)
    return solid, drawn


def least_distance(
    query: QueryObject,
    x: float,
    y: float,
    z: float = 0.0,
    *,
    geometry_ids: Collection[GeometryId] | None = None,
) -> float:
    """Distance from (``x``, ``y``, ``z``) to the nearest obstacle, in [m]; negative inside one.

    Args:
        query: Of the SceneGraph.
        x, y, z: In [m], world frame. Obstacles without a height are equally far at any z.
        geometry_ids: Geometries that are obstacles; all with a proximity role if None.

    Returns:
        Infinite without obstacles.
    """
    found = query.ComputeSignedDistanceToPoint(np.array([x, y, z]))
    if geometry_ids is not None:
        found = [item for item in found if item.id_G in geometry_ids]
    return min((item.distance for item in found), default=math.inf)


class ObstacleDistance:
    """Distances to a fixed set of obstacles, computed by a SceneGraph without a diagram."""

    def __init__(self, obstacles: list[Obstacle]) -> None:
        self._scene_graph = SceneGraph()
        register_obstacles(self._scene_graph, obstacles)
        self._context = self._scene_graph.CreateDefaultContext()
        self._query = self._scene_graph.get_query_output_port().Eval(self._context)

    def __call__(self, positions: ArrayLike) -> NDArray[np.float64]:
        """Distances (n,), in [m], to the nearest obstacle.

        Args:
            positions: Shape (n, D) or (D,), in [m]: x, y and, if D is 3, z.
        """
        return np.array(
            [least_distance(self._query, *position) for position in np.atleast_2d(positions).tolist()]
        )
