"""Logs as a LeRobotDataset v3.0, written with pyarrow.

The layout is that of ``lerobot.datasets`` (huggingface/lerobot, codebase version v3.0): frames of many
episodes in ``data/chunk-000/file-000.parquet``, a line for each episode in ``meta/episodes/``, and
``meta/info.json``, ``meta/stats.json`` and ``meta/tasks.parquet``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.simulation.log import Trial

CODEBASE_VERSION = "v3.0"
FILES_IN_A_CHUNK, MEGABYTES_IN_A_FILE = 1000, 100
_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_EPISODES = "meta/episodes/chunk-000/file-000.parquet"
Frames = dict[str, NDArray[Any]]


def write_lerobot(logs: Sequence[tuple[str, Trial]], folder: Path) -> None:
    """Writes trials as episodes of one dataset to a folder that exists.

    Every applied control step is a frame. ``action`` is the command that moved the robot, that is the safety
    filter's if there is one; ``action.human``, ``action.autonomous`` and ``action.shared`` are those before
    it, and ``is_intervention`` tells whether the human gave a command. Numbers are rounded to float32.

    Raises:
        InputError: The trials are of several robots or control periods.
    """
    first = logs[0][1]
    robot, period = first.robot, float(first.metadata["scenario"]["control_period"])
    rate = round(1.0 / period)
    for name, trial in logs:
        if trial.robot != robot or float(trial.metadata["scenario"]["control_period"]) != period:
            raise InputError(name, "", f"must be of the same robot and control period as {logs[0][0]}")
    tasks = list(dict.fromkeys(_task(trial) for _, trial in logs))
    episodes: list[dict[str, Any]] = []
    waiting: list[Frames] = []
    size = begin = file = 0
    for index, (_, trial) in enumerate(logs):
        frames = _frames(trial, index, tasks.index(_task(trial)), begin, rate)
        length = len(frames["index"])
        if size > MEGABYTES_IN_A_FILE * 1_000_000:
            _write_frames(waiting, folder, file)
            waiting, size, file = [], 0, file + 1
        waiting.append(frames)
        size += sum(values.nbytes for values in frames.values())
        episodes.append(
            {
                "episode_index": index,
                "tasks": [_task(trial)],
                "length": length,
                "data/chunk_index": file // FILES_IN_A_CHUNK,
                "data/file_index": file % FILES_IN_A_CHUNK,
                "dataset_from_index": begin,
                "dataset_to_index": begin + length,
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
                **{f"stats/{key}": value for key, value in _flat(_statistics(frames)).items()},
            }
        )
        begin += length
    _write_frames(waiting, folder, file)
    (folder / _EPISODES).parent.mkdir(parents=True)
    pq.write_table(pa.Table.from_pylist(episodes), folder / _EPISODES)
    named = pd.DataFrame({"task_index": range(len(tasks))}, index=pd.Index(tasks, name="task"))
    named.to_parquet(folder / "meta" / "tasks.parquet")
    info = {
        "codebase_version": CODEBASE_VERSION,
        "robot_type": first.metadata["scenario"]["robot"].get("model", "").rpartition("/")[2],
        "total_episodes": len(logs),
        "total_frames": begin,
        "total_tasks": len(tasks),
        "chunks_size": FILES_IN_A_CHUNK,
        "data_files_size_in_mb": MEGABYTES_IN_A_FILE,
        "video_files_size_in_mb": 200,
        "fps": rate,
        "splits": {"train": f"0:{len(logs)}"},
        "data_path": _DATA,
        "video_path": None,
        "features": _features(first, waiting[0]),
    }
    _write_json(folder / "meta" / "info.json", info)
    _write_json(folder / "meta" / "stats.json", _pooled(episodes))


def _task(trial: Trial) -> str:
    route = trial.metadata.get("route")
    way = f" along route {route}" if route else ""
    return f"drive to the goal of {trial.metadata['scenario']['name']}{way}"


def _frames(trial: Trial, episode: int, task: int, begin: int, rate: int) -> Frames:
    rows = max(1, len(trial["t"]) - 1)  # The last row is not applied.
    robot = trial.robot
    has_filter = robot.columns("safe")[0] in trial.columns
    commands = {who: trial.commands(who)[:rows] for who in ("human", "autonomous", "shared")}
    applied = trial.commands("safe")[:rows] if has_filter else commands["shared"]
    state = np.stack([trial[name][:rows] for name in robot.configuration_names], axis=-1)
    measures = np.stack([trial[name][:rows] for name in ("confidence", "human_weight")], axis=-1)
    done = np.zeros(rows, dtype=bool)
    done[-1] = True
    return {
        "observation.state": state.astype(np.float32),
        "observation.shared_control": measures.astype(np.float32),
        "action": applied.astype(np.float32),
        **{f"action.{who}": values.astype(np.float32) for who, values in commands.items()},
        "is_intervention": (commands["human"] != 0.0).any(axis=1),
        "next.done": done,
        "timestamp": (np.arange(rows) / rate).astype(np.float32),
        "frame_index": np.arange(rows),
        "episode_index": np.full(rows, episode),
        "index": begin + np.arange(rows),
        "task_index": np.full(rows, task),
    }


def _write_frames(episodes: Sequence[Frames], folder: Path, file: int) -> None:
    """A file with a row group for each episode, as lerobot writes them."""
    path = folder / _DATA.format(chunk_index=file // FILES_IN_A_CHUNK, file_index=file % FILES_IN_A_CHUNK)
    path.parent.mkdir(parents=True, exist_ok=True)
    tables = [pa.table({name: _as_column(values) for name, values in frames.items()}) for frames in episodes]
    with pq.ParquetWriter(path, tables[0].schema, compression="snappy") as writer:
        for table in tables:
            writer.write_table(table)


def _as_column(values: NDArray[Any]) -> pa.Array:
    if values.ndim == 1:
        return pa.array(values)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])


def _features(trial: Trial, frames: Frames) -> dict[str, dict[str, Any]]:
    robot = trial.robot
    names: dict[str, list[str] | None] = {
        "observation.state": list(robot.configuration_names),
        "observation.shared_control": ["confidence", "human_weight"],
    }
    names |= {name: list(robot.command_names) for name in frames if name.partition(".")[0] == "action"}
    return {
        name: {
            "dtype": str(values.dtype),
            "shape": list(values.shape[1:]) or [1],
            "names": names.get(name),
        }
        for name, values in frames.items()
    }


def _statistics(frames: Frames) -> dict[str, dict[str, list[float]]]:
    """Minimum, maximum, mean, standard deviation and count of each feature; NaN counts as 0."""
    found = {}
    for name, values in frames.items():
        columns = np.nan_to_num(values.reshape(len(values), -1).astype(np.float64))
        found[name] = {
            "min": columns.min(axis=0).tolist(),
            "max": columns.max(axis=0).tolist(),
            "mean": columns.mean(axis=0).tolist(),
            "std": columns.std(axis=0).tolist(),
            "count": [len(values)],
        }
    return found


def _flat(statistics: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    return {f"{name}/{kind}": value for name, kinds in statistics.items() for kind, value in kinds.items()}


def _pooled(episodes: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, list[float]]]:
    """The statistics of all episodes together."""
    names = [key.split("/")[1] for key in episodes[0] if key.startswith("stats/") and key.endswith("/min")]
    pooled = {}
    for name in names:
        part = {
            kind: np.array([episode[f"stats/{name}/{kind}"] for episode in episodes])
            for kind in ("min", "max", "mean", "std", "count")
        }
        weights = part["count"] / part["count"].sum()
        mean = (weights * part["mean"]).sum(axis=0)
        variance = (weights * (part["std"] ** 2 + (part["mean"] - mean) ** 2)).sum(axis=0)
        pooled[name] = {
            "min": part["min"].min(axis=0).tolist(),
            "max": part["max"].max(axis=0).tolist(),
            "mean": mean.tolist(),
            "std": np.sqrt(variance).tolist(),
            "count": [int(part["count"].sum())],
        }
    return pooled


def _write_json(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=4), encoding="utf-8")
