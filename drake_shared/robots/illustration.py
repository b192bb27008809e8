"""Illustration geometry of a robot, from its SDF file, on one frame of a SceneGraph."""

from __future__ import annotations

from pathlib import Path

from pydrake.geometry import FrameId, GeometryFrame, Role, SceneGraph, SourceId
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_shared.common.errors import InputError


def register_robot(scene_graph: SceneGraph, model: Path) -> tuple[SourceId, FrameId]:
    """Registers the illustration geometry of an SDF model on one new frame of ``scene_graph``.

    It has no proximity role, so that distances to obstacles do not find the robot itself.

    Args:
        scene_graph: Gets a source and a frame, both named "robot".
        model: SDF file with one model.

    Returns:
        The source, and the frame; its pose is that of the model on the floor.

    Raises:
        InputError: The file cannot be parsed, or has no illustration geometry.
    """
    builder = DiagramBuilder()
    plant, reader = AddMultibodyPlantSceneGraph(builder, 0.0)
    try:
        (instance,) = Parser(plant).AddModels(str(model))
    except (RuntimeError, ValueError) as error:
        raise InputError(model, "", f"must be an SDF file with one model: {error}") from error
    plant.Finalize()
    context = plant.CreateDefaultContext()
    inspector = reader.model_inspector()
    source = scene_graph.RegisterSource("robot")
    frame = scene_graph.RegisterFrame(source, GeometryFrame("robot"))
    count = 0
    for body in plant.GetBodyIndices(instance):
        X_WB = plant.EvalBodyPoseInWorld(context, plant.get_body(body))
        link = plant.GetBodyFrameIdOrThrow(body)
        for geometry in inspector.GetGeometries(link, Role.kIllustration):
            drawn = inspector.CloneGeometryInstance(geometry)
            drawn.set_pose(X_WB @ drawn.pose())
            drawn.set_name(f"{plant.get_body(body).name()}_{drawn.name()}".replace("::", "_"))
            scene_graph.RegisterGeometry(source, frame, drawn)
            count += 1
    if not count:
        raise InputError(model, "", "must have illustration geometry (a <visual>)")
    return source, frame
