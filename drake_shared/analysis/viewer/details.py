"""What the page shows of one trial or demonstration."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.glossary import OF_TRIALS
from drake_shared.analysis.metrics import metrics
from drake_shared.analysis.scene_data import describe_goals, describe_task
from drake_shared.analysis.viewer.catalogue import Entry
from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, read_demonstrations
from drake_shared.scenario import load_scenario, scenario_from_dict, shipped_scenarios
from drake_shared.simulation.log import Trial, read_logs

MOST_POINTS = 600
"""Of a curve on the page; a longer log is thinned out evenly."""
_CURVES = ("human_weight", "confidence", "clearance")


def details(entry: Entry) -> dict[str, Any]:
    """Path, curves over time, figures and scene of a trial or demonstration, as plain JSON.

    Raises:
        InputError: The file has changed, or is not a valid log.
    """
    if entry.kind == "demonstration":
        items = read_demonstrations(entry.file)
        if entry.number is None or entry.number >= len(items):
            raise InputError(entry.file, "demonstration", "must still be in the file", entry.number)
        return _of_demonstration(items.items[entry.number], items.scenario)
    path = str(entry.file) if entry.number is None else f"{entry.file}#{entry.number}"
    (trial,) = read_logs(path).values()
    return _of_trial(trial)


def _of_trial(trial: Trial) -> dict[str, Any]:
    rows = _chosen(len(trial["t"]))
    robot = trial.robot
    commands = {
        who: [_plain(column) for column in trial.commands(who)[rows].T]
        for who in ("human", "autonomous", "shared")
    }
    contact = np.flatnonzero(np.asarray(trial["contact"], dtype=bool))
    clearance = np.asarray(trial["clearance"], dtype=float)
    least = None
    if len(clearance) and np.isfinite(clearance).any():
        least = int(np.nanargmin(np.where(np.isfinite(clearance), clearance, np.nan)))
    marks = {
        "contact": _points(trial.positions, contact[:1]),
        "least_clearance": _points(trial.positions, [] if least is None else [least]),
    }
    return {
        "t": _plain(trial["t"][rows]),
        "path": [_plain(column) for column in trial.positions[rows].T[:2]],
        "commands": commands,
        "command_names": [
            f"{name} [{unit}]" for name, unit in zip(robot.command_names, robot.command_units, strict=True)
        ],
        "curves": {name: _plain(trial[name][rows]) for name in _CURVES if name in trial.columns},
        "marks": marks,
        "figures": _figures(trial),
        "scene": _scene(trial.metadata["scenario"]),
        "thinned": len(trial["t"]) > len(rows),
    }


def _of_demonstration(item: Demonstration, scenario: str | None) -> dict[str, Any]:
    rows = _chosen(len(item.times))
    score = [] if item.score is None else [_figure("score", item.score, "m", "", "As the file gives it.")]
    length = float(np.linalg.norm(np.diff(item.positions, axis=0), axis=1).sum())
    scene: dict[str, Any] = {}
    if scenario in shipped_scenarios():
        scene = _scene(dataclasses.asdict(load_scenario(scenario)))
    path = OF_TRIALS["path_length"]
    return {
        "t": _plain(item.times[rows]),
        "path": [_plain(column) for column in item.positions[rows].T[:2]],
        "commands": {},
        "command_names": [],
        "curves": {},
        "marks": {"contact": [], "least_clearance": []},
        "figures": [*score, _figure("path_length", length, path.unit, path.better, path.meaning)],
        "scene": scene,
        "thinned": len(item.times) > len(rows),
    }


def _figures(trial: Trial) -> list[dict[str, Any]]:
    measured: Mapping[str, Any] = metrics(trial)
    found = []
    for name, value in measured.items():
        known = OF_TRIALS[name]
        unit = known.unit_for(trial.robot.command_units[0])
        found.append(_figure(name, value, unit, known.better, known.meaning))
    return found


def _figure(name: str, value: Any, unit: str, better: str, meaning: str) -> dict[str, Any]:
    if isinstance(value, float) and not math.isfinite(value):
        value = None
    return {"name": name, "value": value, "unit": unit, "better": better, "meaning": meaning}


def _scene(data: Mapping[str, Any]) -> dict[str, Any]:
    """Workspace, obstacles, start, goals and routes of a scenario; what cannot be read is left out."""
    try:
        scenario = scenario_from_dict(data)
    except InputError:
        return {}
    space = scenario.workspace
    obstacles = []
    task = describe_task(scenario)
    shown = {item["name"] for item in task["obstacles"]}
    for item in (item for item in scenario.obstacles if item.name in shown):
        shape: dict[str, Any] = {"x": item.x, "y": item.y, "name": item.name, "moves": bool(item.path)}
        obstacles.append(shape | item.sizes() | {"yaw": item.yaw_angle()})
    routes = []
    for route in scenario.routes:
        points = scenario.points_of(route, 80)[:, :2]
        routes.append({"name": route.name, "path": np.round(points, 4).tolist()})
    return {
        "name": scenario.name,
        "workspace": [space.x_min, space.x_max, space.y_min, space.y_max],
        "obstacles": obstacles,
        "start": task["start"],
        "goals": describe_goals(scenario),
        "robot": task["robot_radius"],
        "routes": routes,
    }


def _chosen(count: int) -> NDArray[np.intp]:
    """Indices of at most `MOST_POINTS` of ``count`` rows, the last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_POINTS)).round().astype(np.intp))


def _points(positions: NDArray[np.float64], rows: Any) -> list[list[float]]:
    return [position[:2].tolist() for position in positions[list(rows)] if np.isfinite(position).all()]


def _plain(values: Any) -> list[float | None]:
    """Numbers for JSON, rounded to what a drawing shows; NaN and infinity become None."""
    return [
        float(f"{value:.5g}") if math.isfinite(value) else None
        for value in np.asarray(values, float).tolist()
    ]
