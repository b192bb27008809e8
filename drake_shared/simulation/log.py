"""The log of a trial, and its file."""

from __future__ import annotations

import dataclasses
import functools
import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing
from drake_shared.demonstrations import LOG_FORMAT, METADATA_KEY
from drake_shared.demonstrations.log_table import (
    LOG_VERSION,
    SEVERAL_VERSION,
    TRIAL,
    shared_metadata,
    split_number,
    split_table,
)
from drake_shared.robots import Robot, RobotDescription, describe_robot, described_robot

_COMMANDS = ("human", "autonomous", "shared")
_MEASURES = ("confidence", "human_weight", "mean_variance", "clearance", "contact")
_INFLUENCE = ("moved_by_pose", "moved_by_command")


def log_columns(robot: Robot | RobotDescription) -> tuple[str, ...]:
    """Names of the columns that every log of ``robot`` has beside the time.

    They are the configuration, the coordinates of the position that are not part of it, the commands of
    human, agent and arbiter (such as ``human_left``), the robot's own speeds, and the measures of each step.
    """
    description = robot if isinstance(robot, RobotDescription) else describe_robot(robot)
    further = [name for name in description.position_names if name not in description.configuration_names]
    commands = [name for who in _COMMANDS for name in description.columns(who)]
    return (
        *description.configuration_names,
        *further,
        *commands,
        *description.speed_names,
        *_MEASURES,
        *_INFLUENCE,
    )


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Trial:
    """The log of a trial.

    Attributes:
        columns: Name of each column, and its values (n,). Row k holds what is applied from t_k to t_k+1, its
            ``contact`` is that of the step that led to it, and the last row is not applied.
        metadata: Scenario, robot, learner, operator, seed, status and all settings, as JSON holds them.
    """

    columns: Mapping[str, NDArray[Any]]
    metadata: Mapping[str, Any]

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self.columns[column]

    def __repr__(self) -> str:
        name = self.metadata.get("scenario", {}).get("name")
        return f"Trial({name!r}, {self.metadata.get('status')!r}, {len(self['t'])} rows)"

    @functools.cached_property
    def robot(self) -> RobotDescription:
        """Names, units and limits of the robot's values; a differential drive in logs of version 0.1.0.

        Raises:
            InputError: The metadata describe no robot.
        """
        return described_robot(self.metadata)

    @property
    def status(self) -> str:
        """How the trial ended: "reached", "timed_out", or the reason of an interruption."""
        status: str = self.metadata["status"]
        return status

    @property
    def positions(self) -> NDArray[np.float64]:
        """Shape (n, D), in [m], world frame."""
        return np.stack([self[name] for name in self.robot.position_names], axis=-1)

    def commands(self, who: str) -> NDArray[np.float64]:
        """Shape (n, M), in the robot's units: "human", "autonomous", "shared" or (if logged) "safe"."""
        return np.stack([self[name] for name in self.robot.columns(who)], axis=-1)


def write_log(trial: Trial, path: str | os.PathLike[str], *, durable: bool = False) -> None:
    """Writes a trial as Parquet, atomically.

    Args:
        trial: What to write.
        path: File to write.
        durable: Wait until the file is on the disk, so that it survives a power failure.

    Raises:
        InputError: The folder cannot be written to.
    """
    _write(dict(trial.columns), trial.metadata, path, durable=durable)


def write_logs(trials: Mapping[int, Trial], path: str | os.PathLike[str]) -> None:
    """Writes several trials into one Parquet file, atomically; a single one as `write_log` does.

    Args:
        trials: By number, from 0 on, with the same columns.
        path: Of the file. ``FILE#3`` then names trial 3 wherever a log is read.

    Raises:
        InputError: There is no trial, or the folder cannot be written to.
    """
    if not trials:
        raise InputError(path, "", "must hold at least one trial")
    first = next(iter(trials.values()))
    if len(trials) == 1:
        write_log(first, path)
        return
    columns = {TRIAL: np.repeat(np.array(list(trials)), [len(trial["t"]) for trial in trials.values()])}
    columns |= {name: np.concatenate([trial[name] for trial in trials.values()]) for name in first.columns}
    metadata = shared_metadata({number: trial.metadata for number, trial in trials.items()})
    # Values that differ from row to row: a dictionary of them takes time and saves nothing.
    _write(columns, metadata, path, use_dictionary=[TRIAL])


def _write(
    columns: dict[str, NDArray[Any]],
    metadata: Mapping[str, Any],
    path: str | os.PathLike[str],
    *,
    durable: bool = False,
    **options: Any,
) -> None:
    table = pa.table(columns).replace_schema_metadata({METADATA_KEY: json.dumps(dict(metadata))})
    with replacing(path, durable=durable) as temporary:
        pq.write_table(table, temporary, **options)


def read_log(path: str | os.PathLike[str]) -> Trial:
    """Reads a trial.

    Args:
        path: Of a file of one trial, or FILE#NUMBER for one of several.

    Raises:
        InputError: See `read_logs`; or the file holds several trials, and none of them is named.
    """
    trials = list(read_logs(path).items())
    (number, trial), *others = trials
    if others:
        expected = f"holds {len(trials)} trials: name one of them, as in {os.fspath(path)}#{number}"
        raise InputError(path, "", expected)
    return trial


def read_logs(path: str | os.PathLike[str]) -> dict[int, Trial]:
    """Reads the trials of a file, by number; a file of one trial has number 0.

    Args:
        path: Of the file, or FILE#NUMBER for one of several trials.

    Raises:
        InputError: The file is missing, is not a log or of another version, or lacks columns or metadata.
    """
    file, wanted = split_number(path)
    table, metadata = _read(file)
    trials = {}
    for number, (rows, described) in split_table(file, table, metadata, wanted).items():
        name = file if number is None else f"{file}#{number}"
        trials[number or 0] = _trial(name, rows, described)
    return trials


def _read(path: str) -> tuple[pa.Table, dict[str, Any]]:
    """Table and metadata of a log."""
    if not os.path.isfile(path):
        raise InputError(path, "", "must be a log; there is no such file")
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise InputError(path, "", "cannot be read as a log") from error
    try:
        metadata = json.loads((table.schema.metadata or {}).get(METADATA_KEY, b"null"))
    except ValueError as error:
        raise InputError(path, "metadata", "must be JSON") from error
    if not isinstance(metadata, dict) or metadata.get("format") != LOG_FORMAT:
        raise InputError(path, "format", f"must be {LOG_FORMAT!r}")
    if metadata.get("version") not in (LOG_VERSION, SEVERAL_VERSION):
        expected = f"must be {LOG_VERSION}, or {SEVERAL_VERSION} for several trials"
        raise InputError(path, "version", expected, metadata.get("version"))
    return table, metadata


def _trial(path: str, table: pa.Table, metadata: dict[str, Any]) -> Trial:
    """The trial of a table; ``path`` is for error messages."""
    _check_metadata(metadata, path)
    required = ("t", *log_columns(described_robot(metadata, source=path)))
    missing = [name for name in required if name not in table.column_names]
    if missing:
        raise InputError(path, "columns", f"must include {', '.join(missing)}")
    if not table.num_rows:
        raise InputError(path, "", "must hold at least one row")
    columns = {name: table[name].to_numpy() for name in table.column_names}
    for name in required:
        if columns[name].dtype.kind not in "bif":
            raise InputError(path, name, "must hold numbers", table.schema.field(name).type)
    if not (np.diff(columns["t"]) > 0).all():
        raise InputError(path, "t", "must increase")
    return Trial(columns=columns, metadata=metadata)


def _check_metadata(metadata: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Checks the metadata that the metrics of a trial use."""
    scenario = metadata.get("scenario")
    parts = {"name": str, "goal": dict, "robot": dict, "obstacles": list, "routes": list}
    if not isinstance(scenario, dict) or not all(isinstance(scenario.get(k), v) for k, v in parts.items()):
        raise InputError(path, "scenario", f"must be an object with {', '.join(parts)}")
    if not isinstance(metadata.get("status"), str):
        raise InputError(path, "status", "must be given", metadata.get("status"))
    names = [route.get("name") for route in scenario["routes"]]
    for field in ("route", "then"):
        if metadata.get(field) not in (None, *names):
            raise InputError(path, field, f"must be one of {', '.join(names)}", repr(metadata[field]))
