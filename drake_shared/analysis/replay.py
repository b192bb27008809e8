"""A trial as a self-contained page: the scene of the cockpit with a player."""

from __future__ import annotations

import html
import json
import math
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    MeshcatParams,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Role,
    SceneGraph,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_shared.analysis.arm_replay import arm_page
from drake_shared.analysis.metrics import metrics
from drake_shared.analysis.scene_data import describe_routes, describe_task
from drake_shared.common.files import replacing
from drake_shared.common.html import script_safe
from drake_shared.learners import Learner
from drake_shared.robots import Arm
from drake_shared.robots.description import require_diff_drive
from drake_shared.robots.illustration import register_robot
from drake_shared.scenario import Scenario, scenario_from_dict
from drake_shared.scenario.obstacles import position_at, register_obstacles
from drake_shared.simulation.scene_drawing import center_scene, start_quiet_meshcat
from drake_shared.simulation.trial import Trial
from drake_shared.systems.intention_estimator import IntentionEstimator
from drake_shared.systems.log_playback import LogPlayback
from drake_shared.systems.moving_obstacles import AddMovingObstacles
from drake_shared.systems.route_ribbons import Ribbon, route_ribbons

# The page's own files, which this page shares; each module after those that it imports.
_PAGE = Path(__file__).parents[1] / "cockpit" / "page"
_MODULES = (
    *("scene_theme", "scene_task", "scene_ink", "scene_floor", "scene_routes", "scene_trail", "scene_robot"),
    *("scene_labels", "scene_views", "readback_canvas", "scene_layers", "render_throttle", "scene"),
    *("outcomes", "replay_chart", "replay"),
)
_STYLES = ("scene.css", "replay.css")
_IMPORT = re.compile(r'^import (\{.*?\}) from "\./(\w+)\.js";$', re.MULTILINE)
_EXPORT = re.compile(r"^export (?:class|function|const) (\w+)", re.MULTILINE)
# Rows of the log between two predictions that are shown, and digits of what is written.
_ROWS, _DIGITS = 2, 4


def write_replay(
    trial: Trial,
    path: str | os.PathLike[str],
    *,
    learner: Learner | None = None,
    recorded: NDArray[np.float64] | None = None,
    note: str = "",
) -> None:
    """Writes ``trial`` as a self-contained HTML page.

    The element ``trial`` of the page holds the trial's metadata, without its scenario, as JSON; the element
    ``replay`` what the page shows.

    Args:
        trial: A trial of a differential drive, or of an arm, whose page is an animation without a chart.
        path: The page to write.
        learner: The one that took part; without it the prediction is not shown.
        recorded: A path to compare with, drawn pale: shape (n, D), in [m].
        note: A note shown on the page, such as that the trial is open loop.

    Raises:
        InputError: The page cannot be written, the log's scenario is invalid, or the robot is another one.
    """
    scenario = scenario_from_dict(trial.metadata["scenario"], source="the log's scenario")
    metadata = {name: value for name, value in trial.metadata.items() if name != "scenario"}
    if isinstance(scenario.robot, Arm):
        ribbons = [] if learner is None else _ribbons(trial, scenario, learner)
        page = arm_page(trial, scenario, scenario.robot, ribbons, _ROWS)
        _write(path, _titled(page, scenario.name, [_json("trial", metadata)], _caption(trial, note)))
        return
    require_diff_drive(trial.metadata, "to be drawn")
    shown = {
        "task": describe_task(scenario),
        "scenario": scenario.name,
        "learner": trial.metadata.get("learner"),
        "driver": trial.metadata.get("mode"),
        "status": trial.status,
        "measures": _measures(trial),
        "rows": _rows(trial),
        "moving": _moving(scenario, trial["t"]),
        "routes": [] if learner is None else list(map(describe_routes, _ribbons(trial, scenario, learner))),
        "every": _ROWS,
        "recorded": [] if recorded is None else np.round(recorded[:, :2], _DIGITS).tolist(),
        "note": note,
    }
    _write(path, _assembled(_meshcat_page(scenario), shown, metadata, note))


def _meshcat_page(scenario: Scenario) -> str:
    """Meshcat's own page with robot and obstacles."""
    meshcat = start_quiet_meshcat(MeshcatParams(host="localhost", port=0, show_stats_plot=False))
    center_scene(meshcat, scenario)
    builder = DiagramBuilder()
    scene_graph = builder.AddSystem(SceneGraph())
    register_obstacles(scene_graph, scenario.static_obstacles)
    AddMovingObstacles(builder, scene_graph, scenario.obstacles)
    source, frame = register_robot(scene_graph, scenario.robot.model_path())
    start = [[scenario.start.x, scenario.start.y, scenario.start.yaw]]
    playback = builder.AddSystem(LogPlayback(times=[0.0], rows={"pose": start}, frame=frame))
    builder.Connect(playback.GetOutputPort("geometry_pose"), scene_graph.get_source_pose_port(source))
    illustration = MeshcatVisualizerParams(role=Role.kIllustration, prefix="scene")
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, illustration)
    diagram = builder.Build()
    diagram.ForcedPublish(diagram.CreateDefaultContext())
    page: str = meshcat.StaticHtml()
    return page


def _ribbons(trial: Trial, scenario: Scenario, learner: Learner) -> list[list[Ribbon]]:
    """The predicted routes at every second row, from the recorded poses and human commands."""
    robot, times = scenario.robot, trial["t"]
    rows = {
        "pose": np.column_stack([trial[name] for name in robot.configuration_names]),
        "human_command": trial.commands("human"),
    }
    builder = DiagramBuilder()
    playback = builder.AddSystem(LogPlayback(times=times, rows=rows))
    estimator = builder.AddSystem(
        IntentionEstimator(learner=learner, robot=robot, period=scenario.control_period)
    )
    for name in rows:
        builder.Connect(playback.GetOutputPort(name), estimator.GetInputPort(name))
    simulator = Simulator(builder.Build())
    context = estimator.GetMyContextFromRoot(simulator.get_context())
    shown = []
    for index in range(0, len(times), _ROWS):
        simulator.AdvanceTo(float(times[index]))
        intention = estimator.get_intention_output_port().Eval(context)
        modes = estimator.GetOutputPort("modes").Eval(context)
        position = robot.position(rows["pose"][index].tolist())
        shown.append(route_ribbons(intention, modes, position=position, robot=robot))
    return shown


def _rows(trial: Trial) -> dict[str, list[Any]]:
    names = ["t", "human_weight", "confidence", "clearance", "contact"]
    columns = {name: _numbers(trial[name]) for name in names if name in trial.columns}
    columns["pose"] = _numbers(np.column_stack([trial[name] for name in ("x", "y", "yaw")]))
    for who in ("human", "autonomous", "shared"):
        columns[who] = _numbers(trial.commands(who))
    return columns


def _moving(scenario: Scenario, times: NDArray[np.float64]) -> dict[str, list[Any]]:
    """Positions over time, in [m], of the obstacles that move, by their path in Meshcat's tree."""
    return {
        f"/drake/scene/{item.name}": _numbers(np.array([position_at(item, time) for time in times.tolist()]))
        for item in scenario.obstacles
        if item.path
    }


def _measures(trial: Trial) -> dict[str, Any]:
    values = metrics(trial)
    names = ("collision", "mean_human_weight", "clearance", "path_length")
    end = float(trial["t"][-1]) if len(trial["t"]) else 0.0
    return {"time": round(end, _DIGITS)} | {name: _number(values.get(name)) for name in names}


def _numbers(values: NDArray[Any]) -> list[Any]:
    """JSON has neither NaN nor infinity: null takes their place."""
    rounded = np.round(np.asarray(values, dtype=float), _DIGITS).astype(object)
    rounded[~np.isfinite(np.asarray(values, dtype=float))] = None
    numbers: list[Any] = rounded.tolist()
    return numbers


def _number(value: Any) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value), _DIGITS)


def _assembled(page: str, shown: dict[str, Any], metadata: dict[str, Any], note: str) -> str:
    """Meshcat's page with the scene, the player and what they show."""
    styles = "\n".join(_file(name) for name in _STYLES)
    title = html.escape(f"{shown['scenario']}: replay")
    head = (
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>\n{styles}</style>\n"
    )
    page = page.replace("<html>", '<html lang="en">', 1).replace("<title>Drake MeshCat</title>", "", 1)
    page = page.replace("</head>", f"{head}</head>", 1)
    body, _, rest = page.rpartition("</body>")
    parts = [body, _json("trial", metadata), _json("replay", shown)]
    if note:
        parts.append(f'<p id="note" role="note">{html.escape(note)}</p>\n')
    parts += [_file("replay.html"), f"<script>\n{_script(_MODULES)}</script>\n</body>", rest]
    return "".join(parts)


def _titled(page: str, scenario: str, parts: list[str], caption: str) -> str:
    """Meshcat's page with a title and ``parts``, and a caption over the scene."""
    title = html.escape(f"{scenario}: replay")
    page = page.replace("<html>", '<html lang="en">', 1)
    page = page.replace("<title>Drake MeshCat</title>", f"<title>{title}</title>", 1)
    style = "position:fixed;left:1em;bottom:1em;margin:0;font:14px sans-serif;color:#222"
    shown = f'<p id="note" role="note" style="{style}">{html.escape(caption)}</p>\n'
    body, _, rest = page.rpartition("</body>")
    return "".join([body, *parts, shown, "</body>", rest])


def _caption(trial: Trial, note: str) -> str:
    driver, end = trial.metadata.get("mode"), float(trial["t"][-1])
    legend = "dots: where the commands of human (yellow), agent (blue) and both (black) lead in a second"
    return ". ".join(part for part in (f"{driver}: {trial.status} after {end:.1f} s", legend, note) if part)


def _write(path: str | os.PathLike[str], page: str) -> None:
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _script(modules: Iterable[str]) -> str:
    """The modules as one script, since pages from a file cannot import: each is a function's body."""
    parts = []
    for name in modules:
        text = _IMPORT.sub(r"const \1 = modules.\2;", _file(f"{name}.js"))
        exported = ", ".join(_EXPORT.findall(text))
        text = text.replace("\nexport ", "\n")
        parts.append(f"modules.{name} = (() => {{\n{text}\nreturn {{ {exported} }};\n}})();\n")
    return "const modules = {};\n" + "".join(parts)


def _file(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")


def _json(name: str, content: dict[str, Any]) -> str:
    text = script_safe(json.dumps(content, separators=(",", ":")))
    return f'<script type="application/json" id="{name}">{text}</script>\n'
