"""A trial of an arm as an animation in Meshcat: the arm, its predicted routes, and the tip's shadow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from pydrake.geometry import (
    Cylinder,
    Meshcat,
    MeshcatParams,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from drake_shared.robots import Arm
from drake_shared.robots.arm_model import ArmModel
from drake_shared.scenario import Scenario
from drake_shared.scenario.obstacles import register_obstacles
from drake_shared.simulation.scene_drawing import start_quiet_meshcat
from drake_shared.simulation.trial import Trial
from drake_shared.systems.intention_visualizer import AGENT_COLOR, HUMAN_COLOR, SHARED_COLOR
from drake_shared.systems.log_playback import LogPlayback
from drake_shared.systems.moving_obstacles import AddMovingObstacles
from drake_shared.systems.route_ribbons import Ribbon
from drake_shared.systems.strip_mesh import strip_mesh

# Time that the line of a command covers, in [s]; number of its dots, and their radius, in [m].
_COMMAND_TIME, _DOTS, _DOT = 1.0, 4, 0.008
_COMMANDS = {"human": HUMAN_COLOR, "autonomous": AGENT_COLOR, "shared": SHARED_COLOR}
_SHADOW_COLOR, _GOAL_COLOR = Rgba(0.05, 0.05, 0.08, 0.6), Rgba(0.1, 0.6, 0.3, 0.35)


def arm_page(
    trial: Trial, scenario: Scenario, arm: Arm, ribbons: Sequence[Sequence[Ribbon]], every: int
) -> str:
    """Meshcat's own page with an animation of the trial, from an angle that can be turned.

    Args:
        trial: Of the arm.
        scenario: Its task.
        arm: Its robot.
        ribbons: Predicted routes at every ``every``-th row; none are drawn without any.
        every: As above.
    """
    meshcat = start_quiet_meshcat(MeshcatParams(host="localhost", port=0, show_stats_plot=False))
    show_scene(meshcat, scenario, arm)
    builder = DiagramBuilder()
    scene_graph = builder.AddSystem(SceneGraph())
    register_obstacles(scene_graph, scenario.static_obstacles)
    AddMovingObstacles(builder, scene_graph, scenario.obstacles)
    model = ArmModel(arm, scene_graph)
    joints = np.column_stack([trial[name] for name in arm.joint_names])
    playback = builder.AddSystem(LogPlayback(times=trial["t"], rows={"joints": joints}))
    placed = builder.AddSystem(MultibodyPositionToGeometryPose(model.plant))
    builder.Connect(playback.get_output_port(), placed.get_input_port())
    builder.Connect(placed.get_output_port(), scene_graph.get_source_pose_port(model.plant.get_source_id()))
    illustration = MeshcatVisualizerParams(role=Role.kIllustration, prefix="scene")
    visualizer = MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, illustration)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    names = list(_draw_ribbons(meshcat, ribbons))
    for who, color in _COMMANDS.items():
        for dot in range(_DOTS):
            meshcat.SetObject(f"commands/{who}/{dot}", Sphere(_DOT), Rgba(*color))
    visualizer.StartRecording()
    for row, time in enumerate(trial["t"].tolist()):
        context.SetTime(time)
        diagram.ForcedPublish(context)
        configuration = [float(trial[name][row]) for name in arm.configuration_names]
        place_shadow(meshcat, scenario, arm.position(configuration), time)
        for who in _COMMANDS:
            command = trial.commands(who)[row].tolist()
            known = bool(np.isfinite(command).all())
            meshcat.SetProperty(f"commands/{who}", "visible", known, time)
            for dot in range(_DOTS if known else 0):
                at = arm.rollout(configuration, command, _COMMAND_TIME * (dot + 1) / _DOTS)
                meshcat.SetTransform(f"commands/{who}/{dot}", RigidTransform(at), time)
        for index, name in enumerate(names):
            meshcat.SetProperty(name, "visible", index == row // every, time)
    visualizer.StopRecording()
    visualizer.PublishRecording()
    page: str = meshcat.StaticHtml()
    return page


def show_scene(meshcat: Meshcat, scenario: Scenario, arm: Arm) -> None:
    """Draws goals and the disc of the shadow, and looks at the workspace from an angle."""
    low, high = scenario.workspace.corners()
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    meshcat.SetCameraPose(middle + size * np.array([0.65, -0.6, 0.4]), middle)
    for name in ("/Grid", "/Axes"):
        meshcat.SetProperty(name, "visible", False)
    meshcat.SetProperty("/Background", "top_color", [0.93, 0.94, 0.96])
    meshcat.SetProperty("/Background", "bottom_color", [0.86, 0.88, 0.91])
    for goal in scenario.all_goals:
        path = f"goals/{goal.name or 'goal'}"
        meshcat.SetObject(path, Sphere(goal.radius), _GOAL_COLOR)
        meshcat.SetTransform(path, RigidTransform(goal.position(arm.position_names)))
    meshcat.SetObject("shadow", Cylinder(0.02, 1e-3), _SHADOW_COLOR)


def place_shadow(
    meshcat: Meshcat, scenario: Scenario, position: Sequence[float], time: float | None = None
) -> None:
    """Puts the shadow on the bottom of the workspace, below ``position`` (x, y, z), in [m].

    Args:
        meshcat: Of `show_scene`.
        scenario: Of `show_scene`.
        position: Of the tip.
        time: In a recording, in [s].
    """
    x, y, _ = position
    X = RigidTransform([x, y, scenario.workspace.z_min + 1e-3])
    meshcat.SetTransform("shadow", X, time)


def _draw_ribbons(meshcat: Meshcat, ribbons: Sequence[Sequence[Ribbon]]) -> Iterator[str]:
    """Draws the routes of each of the rows under a name of its own, which is returned."""
    for index, routes in enumerate(ribbons):
        name = f"routes/{index}"
        for slot, ribbon in enumerate(routes):
            known = ribbon.fade > 0.0
            vertices, faces = strip_mesh(ribbon.center, ribbon.half_width, known)
            opacity = ribbon.probability * float(ribbon.fade[known].mean())
            meshcat.SetTriangleMesh(f"{name}/{slot}", vertices, faces, Rgba(*AGENT_COLOR, opacity))
        meshcat.SetProperty(name, "visible", False)
        yield name
