"""Parquet files of demonstrations, and logs of trials as demonstrations.

A file has the columns demonstration (int64), t [s], the coordinates of the position [m] ("x" and "y" in the
plane) and, if known, yaw [rad], one row a step. The rest is one JSON object under the key ``drake_shared`` of
the schema's metadata; its field ``position_names`` names the coordinates if they are others than x and y. A
file without metadata has x, y and, if there is such a column, z. Logs of trials are demonstrations too
(sec. III.E of Amirshirzad et al. 2022), if the trial reached the goal without contact.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing, sha256_of
from drake_shared.demonstrations.log_table import SEVERAL_VERSION, split_number, split_table
from drake_shared.demonstrations.trajectories import Demonstration, Demonstrations

FORMAT = "drake_shared.demonstrations"
LOG_FORMAT = "drake_shared.log"
VERSION = 1
METADATA_KEY = b"drake_shared"
_PLANE = ("x", "y")
# The fields of a trial's metadata that the provenance of a demonstration keeps.
_KEPT = ("operator", "learner", "learner_id", "preset", "mode", "route", "then", "seed", "status")

Path = str | os.PathLike[str]


def read_demonstrations(
    paths: Path | Sequence[Path],
    *,
    scenario: str | None = None,
    score_column: str | None = None,
    failed: list[InputError] | None = None,
) -> Demonstrations:
    """Reads demonstration files and logs, one after another, into one set.

    Args:
        paths: A file or several. Each trial of a log gives one demonstration; FILE#3 names trial 3 alone. A
            folder stands for the Parquet files in it.
        scenario: If given, files that name another scenario are refused.
        score_column: A column that holds each demonstration's score, the same in all of its rows.
        failed: If given, logs of trials that failed are left out, and their errors appended here.

    Raises:
        InputError: A file is missing or invalid, or no trial succeeded; names the file and the field.
    """
    files = _files([paths] if isinstance(paths, str | os.PathLike) else paths)
    if not files:
        raise InputError("demonstrations", "", "needs at least one file")
    items: list[Demonstration] = []
    metadata: dict[str, Any] = {}
    for given in files:
        path, number = split_number(given)
        table, description = _read_table(path)
        _check_scenario(path, description, scenario or metadata.get("scenario"))
        is_log = description.get("format") == LOG_FORMAT
        origin = {
            "kind": "log" if is_log else "demonstrations",
            "file": path,
            "sha256": sha256_of(path),
        }
        if is_log:
            read = _read_logs(path, table, description, score_column, number, failed)
        else:
            read = _read_file(path, table, description, score_column)
        items += [dataclasses.replace(item, provenance={**item.provenance, **origin}) for item in read]
        named = _scenario_name(description)
        if named is not None:
            metadata["scenario"] = named
    if failed and not items:
        raise failed[0]
    return Demonstrations(
        items=tuple(items), metadata=metadata, source=", ".join(os.fspath(path) for path in files)
    )


def provenance_of_trial(metadata: Mapping[str, Any], human_weight: ArrayLike | None) -> dict[str, Any]:
    """Provenance of a demonstration that is a trial.

    Args:
        metadata: Of the trial.
        human_weight: Its column (n,), if known; the last row is not applied and does not count.

    Returns:
        Operator, route, seed, mode, the learner that took part ("learner_id", from the content of its file)
        and the mean "human_weight": 1 less the share of the command that is the agent's.
    """
    kept = {name: metadata[name] for name in _KEPT if name in metadata}
    if human_weight is not None:
        weights = np.asarray(human_weight, dtype=float)
        # A log of one row has this one only.
        kept["human_weight"] = float(np.mean(weights[: max(len(weights) - 1, 1)]))
    return kept


def write_demonstrations(path: Path, demonstrations: Demonstrations, *, durable: bool = False) -> None:
    """Writes demonstrations so that `read_demonstrations` returns them; the write is atomic.

    Args:
        path: File to write.
        demonstrations: What to write.
        durable: Wait until the file is on the disk, so that it survives a power failure.

    Raises:
        InputError: The folder is not writable.
    """
    items, names = demonstrations.items, demonstrations.position_names
    positions = np.concatenate([item.positions for item in items])
    columns = {
        "demonstration": np.repeat(np.arange(len(items), dtype=np.int64), [len(item) for item in items]),
        "t": np.concatenate([item.times for item in items]),
        **{name: np.ascontiguousarray(positions[:, axis]) for axis, name in enumerate(names)},
    }
    yaws = [item.yaws for item in items if item.yaws is not None]
    if len(yaws) == len(items):
        columns["yaw"] = np.concatenate(yaws)
    description = {
        **demonstrations.metadata,
        "format": FORMAT,
        "version": VERSION,
        "scores": [item.score for item in items],
        "provenance": [dict(item.provenance) for item in items],
    }
    if names != _PLANE:
        description["position_names"] = list(names)
    table = pa.table(columns).replace_schema_metadata({METADATA_KEY: json.dumps(description).encode()})
    with replacing(path, durable=durable) as temporary:
        pq.write_table(table, temporary)


def _files(paths: Sequence[Path]) -> list[Path]:
    """The files that paths name, those of a folder in the order of their names."""
    files: list[Path] = []
    for path in paths:
        inside = sorted(pathlib.Path(path).glob("*.parquet")) if os.path.isdir(path) else [path]
        if not inside:
            raise InputError(path, "", "must be a file, or a folder with Parquet files")
        files += inside
    return files


def _read_table(path: Path) -> tuple[pa.Table, dict[str, Any]]:
    """The table of a Parquet file and its metadata, of a known format and version."""
    if not os.path.isfile(path):
        raise InputError(path, "", "must be a file that exists")
    try:
        table = pq.read_table(path)
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(path, "", f"must be a whole Parquet file ({reason})") from error
    text = (table.schema.metadata or {}).get(METADATA_KEY)
    if text is None:
        return table, {}
    try:
        description = json.loads(text)
    except ValueError:
        description = None
    if not isinstance(description, dict):
        raise InputError(path, "metadata", "must be a JSON object")
    if description.get("format") not in (FORMAT, LOG_FORMAT):
        raise InputError(path, "format", f"must be {FORMAT} or {LOG_FORMAT}", description.get("format"))
    version = description.get("version")
    newest = SEVERAL_VERSION if description["format"] == LOG_FORMAT else VERSION
    if not isinstance(version, int) or version < 1 or version > newest:
        raise InputError(path, "version", f"must be at most {newest}, the newest supported", version)
    return table, description


def _scenario_name(description: Mapping[str, Any]) -> str | None:
    scenario = description.get("scenario")
    return scenario.get("name") if isinstance(scenario, dict) else scenario


def _check_scenario(path: Path, description: Mapping[str, Any], expected: str | None) -> None:
    got = _scenario_name(description)
    if expected is not None and got is not None and got != expected:
        raise InputError(path, "scenario", f"must be {expected!r}", repr(got))


def _position_names(path: Path, table: pa.Table, description: Mapping[str, Any]) -> tuple[str, ...]:
    if not description and "z" in table.column_names:
        return (*_PLANE, "z")
    # A log describes its robot.
    robot = description.get("robot")
    holder = robot if isinstance(robot, dict) else description
    names = holder.get("position_names", list(_PLANE))
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise InputError(path, "position_names", "must be a list of column names", names)
    return tuple(names)


def _column(path: Path, table: pa.Table, name: str) -> NDArray[Any]:
    if name not in table.column_names:
        have = ", ".join(table.column_names) or "none"
        raise InputError(path, name, "must be among the columns", have)
    values: NDArray[Any] = table[name].to_numpy()
    if values.dtype.kind not in "iuf":
        raise InputError(path, name, "must hold numbers", table.schema.field(name).type)
    return values


def _read_file(
    path: Path, table: pa.Table, description: Mapping[str, Any], score_column: str | None
) -> list[Demonstration]:
    ids = _column(path, table, "demonstration")
    if not table.num_rows:
        raise InputError(path, "", "must hold at least one demonstration", "no rows")
    fractional = np.flatnonzero(~np.isfinite(ids) | (ids != np.rint(ids)))
    if len(fractional):
        got = f"{ids[fractional[0]]} in row {fractional[0]}"
        raise InputError(path, "demonstration", "must be a whole number in every row", got)
    order = np.argsort(ids, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(ids[order])) + 1)
    scores = description.get("scores") or [None] * len(groups)
    provenance = description.get("provenance") or [{}] * len(groups)
    for name, values in (("scores", scores), ("provenance", provenance)):
        if not isinstance(values, list) or len(values) != len(groups):
            raise InputError(path, name, f"must have one entry for each of {len(groups)} demonstrations")
    if not all(map(_is_score, scores)):
        raise InputError(path, "scores", "must be finite numbers or null")
    if any(not isinstance(origin, dict) for origin in provenance):
        raise InputError(path, "provenance", "must be JSON objects")
    if score_column is not None:
        scores = _column_scores(path, table, groups, score_column)
    names = _position_names(path, table, description)
    times = _column(path, table, "t")
    positions = np.stack([_column(path, table, name) for name in names], axis=-1)
    yaws = _column(path, table, "yaw") if "yaw" in table.column_names else None
    return [
        Demonstration(
            times=times[rows],
            positions=positions[rows],
            yaws=None if yaws is None else yaws[rows],
            position_names=names,
            score=None if score is None else float(score),
            provenance=origin,
            source=f"{os.fspath(path)}: demonstration {int(ids[rows[0]])}",
        )
        for rows, score, origin in zip(groups, scores, provenance, strict=True)
    ]


def _is_score(value: Any) -> bool:
    try:
        return value is None or (not isinstance(value, bool | str) and math.isfinite(float(value)))
    except (TypeError, OverflowError):
        return False


def _column_scores(path: Path, table: pa.Table, groups: Sequence[NDArray[np.intp]], name: str) -> list[float]:
    values = _column(path, table, name)
    scores = []
    for index, rows in enumerate(groups):
        score = float(values[rows[0]])
        if not np.isfinite(score) or np.any(values[rows] != score):
            expected = f"must be one finite number throughout demonstration {index}"
            raise InputError(path, name, expected, f"{score} to {values[rows].max()}")
        scores.append(score)
    return scores


def _read_logs(
    path: str,
    table: pa.Table,
    description: Mapping[str, Any],
    score_column: str | None,
    number: int | None,
    failed: list[InputError] | None,
) -> list[Demonstration]:
    """The demonstrations of a log, or the one of the trial that is named."""
    read = []
    for trial, (rows, described) in split_table(path, table, description, number).items():
        source = path if trial is None else f"{path}#{trial}"
        error = _failure(source, rows, described)
        if error is None:
            read.append(_read_log(source, rows, described, score_column))
        elif failed is None:
            raise error
        else:
            failed.append(error)
    return read


def _failure(path: str, table: pa.Table, description: Mapping[str, Any]) -> InputError | None:
    """Why a trial is not a demonstration; None if it is one."""
    if "contact" not in table.column_names:
        return InputError(path, "contact", "must be among the columns", ", ".join(table.column_names))
    status = description.get("status")
    if status != "reached":
        return InputError(path, "status", 'must be "reached" for a log to be a demonstration', repr(status))
    contact = np.flatnonzero(table["contact"].to_numpy())
    if len(contact):
        when = _column(path, table, "t")[contact[0]]
        expected = "must be false throughout for a log to be a demonstration"
        return InputError(path, "contact", expected, f"contact at {when:g} s")
    return None


def _read_log(
    path: str, table: pa.Table, description: Mapping[str, Any], score_column: str | None
) -> Demonstration:
    """The demonstration of a trial that reached the goal without contact."""
    names = _position_names(path, table, description)
    score = None
    if score_column is not None:
        (score,) = _column_scores(path, table, [np.arange(table.num_rows)], score_column)
    weight = _column(path, table, "human_weight") if "human_weight" in table.column_names else None
    return Demonstration(
        times=_column(path, table, "t"),
        positions=np.stack([_column(path, table, name) for name in names], axis=-1),
        yaws=_column(path, table, "yaw") if "yaw" in table.column_names else None,
        position_names=names,
        score=score,
        provenance=provenance_of_trial(description, weight),
        source=path,
    )
