"""A trial as a self-contained Meshcat page: the robot, its path, and the prediction over time."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Meshcat,
    MeshcatParams,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Role,
    SceneGraph,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_shared.common.files import replacing
from drake_shared.learners import Learner
from drake_shared.learners.no_learner import NoLearner
from drake_shared.robots.description import require_diff_drive
from drake_shared.robots.illustration import register_robot
from drake_shared.scenario import scenario_from_dict
from drake_shared.scenario.obstacles import register_obstacles
from drake_shared.simulation.scene_drawing import GHOST, draw_path, draw_scene, look_from_above
from drake_shared.simulation.trial import Trial
from drake_shared.systems.intention_estimator import IntentionEstimator
from drake_shared.systems.intention_visualizer import IntentionVisualizer
from drake_shared.systems.log_playback import LogPlayback
from drake_shared.systems.moving_obstacles import AddMovingObstacles

# In the corner of the page, above the scene.
_NOTE = (
    "position:fixed;top:12px;left:12px;z-index:1000;padding:6px 10px;border-radius:4px;"
    "background:#b3261e;color:#fff;font:600 15px sans-serif;pointer-events:none"
)


def write_replay(
    trial: Trial,
    path: str | os.PathLike[str],
    *,
    learner: Learner | None = None,
    recorded: NDArray[np.float64] | None = None,
    note: str = "",
) -> None:
    """Writes ``trial`` as a self-contained HTML page.

    The element ``trial`` of the page holds the trial's metadata, without its scenario, as JSON.

    Args:
        trial: A trial of a differential drive.
        path: The page to write.
        learner: The one that took part; without it the prediction is not shown.
        recorded: A path to compare with, drawn pale: shape (n, D), in [m].
        note: A note shown on the page, such as that the trial is open loop.

    Raises:
        InputError: The page cannot be written, the log's scenario is invalid, or the robot is another one.
    """
    robot = require_diff_drive(trial.metadata, "to be drawn")
    scenario = scenario_from_dict(trial.metadata["scenario"], source="the log's scenario")
    meshcat = Meshcat(MeshcatParams(host="localhost", show_stats_plot=False))
    draw_scene(meshcat, scenario)
    look_from_above(meshcat, scenario)
    draw_path(meshcat, trial.positions)
    if recorded is not None:
        draw_path(meshcat, recorded, "recorded_path", GHOST)

    builder = DiagramBuilder()
    scene_graph = builder.AddSystem(SceneGraph())
    register_obstacles(scene_graph, scenario.static_obstacles)
    AddMovingObstacles(builder, scene_graph, scenario.obstacles)
    source, frame = register_robot(scene_graph, scenario.robot.model_path())
    rows = {"pose": np.column_stack([trial[name] for name in robot.configuration_names])}
    rows |= {"human_weight": trial["human_weight"]}
    rows |= {f"{who}_command": trial.commands(who) for who in ("human", "autonomous", "shared")}
    playback = builder.AddSystem(LogPlayback(times=trial["t"], rows=rows, frame=frame))
    period = scenario.control_period
    estimator = builder.AddSystem(
        IntentionEstimator(
            learner=learner or NoLearner(scenario.duration), robot=scenario.robot, period=period
        )
    )
    visualizer = builder.AddSystem(
        IntentionVisualizer(meshcat=meshcat, robot=scenario.robot, period=2 * period)
    )
    builder.Connect(playback.GetOutputPort("geometry_pose"), scene_graph.get_source_pose_port(source))
    for name in ("pose", "human_command"):
        builder.Connect(playback.GetOutputPort(name), estimator.GetInputPort(name))
    builder.Connect(estimator.GetOutputPort("intention"), visualizer.GetInputPort("intention"))
    for name in rows:
        builder.Connect(playback.GetOutputPort(name), visualizer.GetInputPort(name))
    illustration = MeshcatVisualizerParams(role=Role.kIllustration, prefix="scene", publish_period=period)
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, illustration)
    simulator = Simulator(builder.Build())
    meshcat.StartRecording(frames_per_second=1 / period, set_visualizations_while_recording=False)
    simulator.AdvanceTo(float(trial["t"][-1]))
    meshcat.StopRecording()
    meshcat.PublishRecording()
    with replacing(path) as temporary:
        temporary.write_text(_annotated(meshcat.StaticHtml(), trial.metadata, note), encoding="utf-8")


def _annotated(page: str, metadata: Mapping[str, Any], note: str) -> str:
    text = json.dumps({name: value for name, value in metadata.items() if name != "scenario"})
    # Only this sequence ends a script element.
    text = text.replace("</", "<\\/")
    extra = f'<script type="application/json" id="trial">{text}</script>\n'
    if note:
        extra += f'<div id="note" style="{_NOTE}">{html.escape(note)}</div>\n'
    body, end, rest = page.rpartition("</body>")
    return body + extra + end + rest if end else page + extra
