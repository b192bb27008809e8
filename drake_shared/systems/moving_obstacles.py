"""Obstacles on prescribed paths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydrake.common.value import Value
from pydrake.geometry import FramePoseVector, GeometryFrame, SceneGraph, SourceId
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort

from drake_shared.scenario.obstacles import Obstacle, obstacle_geometry, position_at


class MovingObstacles(LeafSystem):
    """Moves obstacles along their paths.

    .. pydrake_system::

        name: MovingObstacles
        output_ports:
        - geometry_pose

    Outputs:
        geometry_pose: FramePoseVector of the obstacles' frames. It depends on time alone, so that a query of
            the SceneGraph does not close an algebraic loop.

    Args:
        obstacles: Those that move.
        scene_graph: Where their proximity and illustration geometry is registered.
    """

    def __init__(self, *, obstacles: Sequence[Obstacle], scene_graph: SceneGraph) -> None:
        super().__init__()
        self.set_name("moving_obstacles")
        self._obstacles = tuple(obstacles)
        self._source = scene_graph.RegisterSource("moving_obstacles")
        self._frames = []
        for obstacle in self._obstacles:
            frame = scene_graph.RegisterFrame(self._source, GeometryFrame(obstacle.name))
            for geometry in obstacle_geometry(obstacle, 0.0, 0.0):
                scene_graph.RegisterGeometry(self._source, frame, geometry)
            self._frames.append(frame)
        self._pose_port = self.DeclareAbstractOutputPort(
            "geometry_pose", lambda: Value(FramePoseVector()), self._calc_poses, {self.time_ticket()}
        )

    def source_id(self) -> SourceId:
        """The obstacles' source in the SceneGraph."""
        return self._source

    def get_geometry_pose_output_port(self) -> OutputPort:
        """The port ``geometry_pose``."""
        return self._pose_port

    def _calc_poses(self, context: Context, output: Any) -> None:
        poses = FramePoseVector()
        for obstacle, frame in zip(self._obstacles, self._frames, strict=True):
            poses.set_value(frame, RigidTransform([*position_at(obstacle, context.get_time()), 0.0]))
        output.set_value(poses)


def AddMovingObstacles(
    builder: DiagramBuilder, scene_graph: SceneGraph, obstacles: Sequence[Obstacle]
) -> MovingObstacles | None:
    """Adds those of ``obstacles`` that move to ``builder`` and ``scene_graph``.

    Returns:
        The system, or None if no obstacle moves.
    """
    moving = [item for item in obstacles if item.path]
    if not moving:
        return None
    system: MovingObstacles = builder.AddSystem(MovingObstacles(obstacles=moving, scene_graph=scene_graph))
    builder.Connect(
        system.get_geometry_pose_output_port(), scene_graph.get_source_pose_port(system.source_id())
    )
    return system
