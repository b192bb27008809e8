"""Logs as CSV: one file for each trial, one with a line for each trial, and what the columns mean."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
from pyarrow import csv

from drake_shared.analysis.glossary import OF_TRIALS
from drake_shared.analysis.metrics import metrics
from drake_shared.simulation.log import Trial

_MEANINGS = {
    "t": "time since the start of the trial, in s",
    "confidence": "c_f of eq. (1)",
    "human_weight": "w: 1 gives the command to the human, 0 to the agent",
    "mean_variance": "mean predicted variance of the rest of the path, in m^2",
    "clearance": "distance from the body to the nearest obstacle, in m",
    "contact": "whether the robot touched an obstacle in the step that led here",
    "moved_by_pose": "share of the change of the prediction that is due to the pose",
    "moved_by_command": "share of the change of the prediction that is due to the human command",
}
_KEYS = ("seed", "route", "status", "mode", "learner", "preset", "operator")


def write_csv(logs: Sequence[tuple[str, Trial]], folder: Path) -> None:
    """Writes ``NAME.csv`` for each trial, ``trials.csv`` and ``README.md`` to a folder that exists.

    Floats have the shortest decimals that give the same bits again.
    """
    rows = []
    for name, trial in logs:
        csv.write_csv(pa.table(dict(trial.columns)), folder / f"{name}.csv")
        scenario = trial.metadata["scenario"]["name"]
        keys = {"scenario": scenario} | {key: trial.metadata.get(key) for key in _KEYS}
        rows.append({"log": name, **keys, **metrics(trial)})
    csv.write_csv(pa.Table.from_pylist(_with_all_columns(rows)), folder / "trials.csv")
    (folder / "README.md").write_text(_readme(logs), encoding="utf-8")


def _with_all_columns(rows: Sequence[dict[str, object]]) -> list[dict[str, object]]:
    names = list(dict.fromkeys(name for row in rows for name in row))
    return [{name: row.get(name) for name in names} for row in rows]


def _readme(logs: Sequence[tuple[str, Trial]]) -> str:
    robot = logs[0][1].robot
    meanings = dict(_MEANINGS)
    meanings |= dict.fromkeys(robot.configuration_names, "of the pose, in m or rad, world frame")
    for who in ("human", "autonomous", "shared", "safe"):
        for name, unit in zip(robot.columns(who), robot.command_units, strict=True):
            meanings[name] = f"{who} command, in {unit}"
    columns = dict.fromkeys(name for _, trial in logs for name in trial.columns)
    lines = ["# Logs of drake_shared", "", "Each `NAME.csv` is a trial, a row for each control step.", ""]
    lines += ["Row k holds what is applied from t_k to t_k+1; the last row is not applied.", ""]
    lines += ["| column | meaning |", "|---|---|"]
    lines += [f"| `{name}` | {meanings.get(name, 'see the documentation of logs')} |" for name in columns]
    lines += [
        "",
        "`trials.csv` has a line for each trial:",
        "",
        "| column | unit | meaning |",
        "|---|---|---|",
    ]
    lines += [f"| `{key}` | | as in the log's metadata |" for key in ("log", "scenario", *_KEYS)]
    for name, measure in OF_TRIALS.items():
        lines.append(f"| `{name}` | {measure.unit_for(robot.command_units[0])} | {measure.meaning} |")
    return "\n".join(lines) + "\n"
