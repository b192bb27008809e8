"""Demonstrations: trajectories of the robot, their scores, how likely each is drawn, and their files.

A file is Parquet with the columns demonstration (int64), t [s], x, y [m] and, if known, yaw [rad], one row a
step. The rest is one JSON object under the key ``drake_shared`` of the schema's metadata; a file without it
is taken as it is. Logs of trials are demonstrations too (sec. III.E of Amirshirzad et al. 2022), if the trial
reached the goal without contact.
"""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.arrays import read_only
from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing, sha256_of

FORMAT = "drake_shared.demonstrations"
LOG_FORMAT = "drake_shared.log"
VERSION = 1
METADATA_KEY = b"drake_shared"
# What of a trial's metadata a demonstration of it keeps.
_TOLD = ("operator", "learner", "learner_id", "preset", "mode", "route", "then", "seed", "status")

Path = str | os.PathLike[str]
Scorer = Callable[[NDArray[np.float64]], float]
"""Takes the positions (n, 2) of one demonstration in [m]; the higher the result the better."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Demonstration:
    """One way of doing the task.

    Attributes:
        times: Shape (n,), in [s], increasing, n >= 2.
        positions: Shape (n, 2), in [m], world frame.
        yaws: Shape (n,), in [rad], or None if unknown.
        score: How good it is, the higher the better, or None if not evaluated.
        provenance: Where it comes from, in a few words that JSON can hold: what `provenance_of_trial` keeps
            of a trial, and of a file its name ("file"), its content ("sha256") and its kind ("kind").
        source: What holds it, for error messages.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    yaws: NDArray[np.float64] | None = None
    score: float | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    source: str = "demonstration"

    def __post_init__(self) -> None:
        times = read_only(self.times)
        positions = read_only(self.positions)
        yaws = None if self.yaws is None else read_only(self.yaws)
        if times.ndim != 1 or len(times) < 2:
            raise InputError(self.source, "t", "must hold at least 2 points", f"shape {times.shape}")
        if positions.shape != (len(times), 2):
            raise InputError(self.source, "x, y", f"must have shape ({len(times)}, 2)", positions.shape)
        if yaws is not None and yaws.shape != times.shape:
            raise InputError(self.source, "yaw", f"must have shape {times.shape}", yaws.shape)
        columns = {"t": times, "x": positions[:, 0], "y": positions[:, 1]}
        if yaws is not None:
            columns["yaw"] = yaws
        for name, values in columns.items():
            bad = np.flatnonzero(~np.isfinite(values))
            if len(bad):
                raise InputError(self.source, name, "must be finite", f"{values[bad[0]]} at point {bad[0]}")
        stalled = np.flatnonzero(np.diff(times) <= 0.0)
        if len(stalled):
            i = int(stalled[0])
            raise InputError(
                self.source, "t", "must increase", f"{times[i]:g} then {times[i + 1]:g} at point {i + 1}"
            )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "yaws", yaws)

    def __len__(self) -> int:
        return len(self.times)


@dataclass(frozen=True, kw_only=True, eq=False)
class Demonstrations:
    """The demonstrations of one task.

    Attributes:
        items: At least one demonstration.
        metadata: What the files say of them all, such as ``{"scenario": NAME}``.
        source: What holds them, for error messages.
    """

    items: tuple[Demonstration, ...]
    metadata: Mapping[str, Any] = field(default_factory=dict)
    source: str = "demonstrations"

    def __post_init__(self) -> None:
        object.__setattr__(self, "items", tuple(self.items))
        if not self.items:
            raise InputError(self.source, "", "must hold at least one demonstration")

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Demonstration]:
        return iter(self.items)

    def __getitem__(self, index: int) -> Demonstration:
        return self.items[index]

    @property
    def scenario(self) -> str | None:
        """Name of the scenario they were made in, or None if unknown."""
        return self.metadata.get("scenario")

    @property
    def scores(self) -> NDArray[np.float64] | None:
        """Shape (m,), or None unless every demonstration has one."""
        scores = [item.score for item in self.items if item.score is not None]
        return np.array(scores, dtype=float) if len(scores) == len(self.items) else None


def read_demonstrations(
    paths: Path | Sequence[Path], *, scenario: str | None = None, score_column: str | None = None
) -> Demonstrations:
    """Reads demonstration files and logs, one after another, into one set.

    Args:
        paths: A file or several. A log gives one demonstration.
        scenario: If given, files that name another scenario are refused.
        score_column: A column that holds each demonstration's score, the same in all of its rows.

    Raises:
        InputError: A file is missing or is not what it must be; says which, where and what.
    """
    files = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    if not files:
        raise InputError("demonstrations", "", "needs at least one file")
    items: list[Demonstration] = []
    metadata: dict[str, Any] = {}
    for path in files:
        table, description = _read_table(path)
        _check_scenario(path, description, scenario or metadata.get("scenario"))
        is_log = description.get("format") == LOG_FORMAT
        read = _read_log if is_log else _read_demonstrations
        held = {
            "kind": "log" if is_log else "demonstrations",
            "file": os.fspath(path),
            "sha256": sha256_of(path),
        }
        items += [
            dataclasses.replace(item, provenance={**item.provenance, **held})
            for item in read(path, table, description, score_column)
        ]
        named = _scenario_name(description)
        if named is not None:
            metadata["scenario"] = named
    return Demonstrations(
        items=tuple(items), metadata=metadata, source=", ".join(os.fspath(path) for path in files)
    )


def provenance_of_trial(metadata: Mapping[str, Any], human_weight: ArrayLike | None) -> dict[str, Any]:
    """Where a demonstration comes from that is a trial.

    Args:
        metadata: Of the trial.
        human_weight: Its column (n,), if known; the last row is not applied and does not count.

    Returns:
        Operator, route, seed, mode, the learner that took part ("learner_id" by the content of its file) and
        the mean "human_weight": 1 less the share of the command that autonomy made.
    """
    kept = {name: metadata[name] for name in _TOLD if name in metadata}
    if human_weight is not None:
        kept["human_weight"] = float(np.mean(np.asarray(human_weight, dtype=float)[:-1]))
    return kept


def write_demonstrations(path: Path, demonstrations: Demonstrations) -> None:
    """Writes demonstrations so that `read_demonstrations` gives them back; the file appears whole or not.

    Raises:
        InputError: The folder cannot be written to.
    """
    items = demonstrations.items
    columns = {
        "demonstration": np.repeat(np.arange(len(items), dtype=np.int64), [len(item) for item in items]),
        "t": np.concatenate([item.times for item in items]),
        "x": np.concatenate([item.positions[:, 0] for item in items]),
        "y": np.concatenate([item.positions[:, 1] for item in items]),
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
    table = pa.table(columns).replace_schema_metadata({METADATA_KEY: json.dumps(description).encode()})
    with replacing(path) as temporary:
        pq.write_table(table, temporary)


def sampling_weights(scores: ArrayLike, width: float | None = None) -> NDArray[np.float64]:
    """How likely each demonstration is drawn: Pd of Alg. 1, line 3, of Amirshirzad et al. 2022.

    A normal density over scores, centred on the best one, normalised over the demonstrations.

    Args:
        scores: Shape (m,), m >= 1; the higher the better. Negative ones are fine.
        width: Standard deviation of the density, in the unit of the scores, positive. Default: twice the
            standard deviation of the scores (ddof 0), at least 0.05.

    Returns:
        Shape (m,), summing to 1. Equal scores give equal weights.

    Raises:
        InputError: A score is not finite, or there is none, or the width is not positive.
    """
    values = np.array(scores, dtype=float)
    if values.ndim != 1 or not len(values):
        raise InputError("scores", "", "must be a list of at least one number", f"shape {values.shape}")
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InputError("scores", f"demonstration {bad[0]}", "must be finite", values[bad[0]])
    if width is None:
        width = max(2.0 * float(values.std()), 0.05)
    if not (np.isfinite(width) and width > 0.0):
        raise InputError("scores", "width", "must be positive and finite", width)
    density = np.exp(-0.5 * np.square((values - values.max()) / width))
    return density / density.sum()


def score_demonstrations(demonstrations: Demonstrations, scorer: Scorer) -> Demonstrations:
    """The same demonstrations with the scores that ``scorer`` gives to their positions.

    Raises:
        InputError: A score is not a finite number.
    """
    scored = []
    for index, item in enumerate(demonstrations):
        score = scorer(item.positions)
        try:
            value = float(score)
        except (TypeError, ValueError):
            value = np.nan
        if not np.isfinite(value):
            raise InputError(
                demonstrations.source, f"score of demonstration {index}", "must be finite", score
            )
        scored.append(dataclasses.replace(item, score=value))
    return dataclasses.replace(demonstrations, items=tuple(scored))


def load_scorer(name: str) -> Scorer:
    """The scorer that "module:function" names.

    Raises:
        InputError: There is no such function.
    """
    module_name, _, function_name = name.partition(":")
    if not (module_name and function_name):
        raise InputError("score", "", 'must be "module:function"', repr(name))
    try:
        scorer = getattr(importlib.import_module(module_name), function_name)
    except (ImportError, AttributeError) as error:
        raise InputError("score", name, f"must be a function that can be imported ({error})") from error
    if not callable(scorer):
        raise InputError("score", name, "must be callable", type(scorer).__name__)
    return scorer


def _read_table(path: Path) -> tuple[pa.Table, dict[str, Any]]:
    """The table of a Parquet file and what its metadata says, of a version that we know."""
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
    if not isinstance(version, int) or version < 1 or version > VERSION:
        raise InputError(path, "version", f"must be at most {VERSION}, the newest known here", version)
    return table, description


def _scenario_name(description: Mapping[str, Any]) -> str | None:
    scenario = description.get("scenario")
    return scenario.get("name") if isinstance(scenario, dict) else scenario


def _check_scenario(path: Path, description: Mapping[str, Any], expected: str | None) -> None:
    came = _scenario_name(description)
    if expected is not None and came is not None and came != expected:
        raise InputError(path, "scenario", f"must be {expected!r}", repr(came))


def _column(path: Path, table: pa.Table, name: str) -> NDArray[Any]:
    if name not in table.column_names:
        have = ", ".join(table.column_names) or "none"
        raise InputError(path, name, "must be among the columns", have)
    values = table[name].to_numpy()
    if values.dtype.kind not in "biuf":
        raise InputError(path, name, "must hold numbers", table.schema.field(name).type)
    return values


def _read_demonstrations(
    path: Path, table: pa.Table, description: Mapping[str, Any], score_column: str | None
) -> list[Demonstration]:
    names = ["demonstration", "t", "x", "y"] + ["yaw"] * ("yaw" in table.column_names)
    columns = {name: _column(path, table, name) for name in names}
    if not table.num_rows:
        raise InputError(path, "", "must hold at least one demonstration", "no rows")
    ids = columns["demonstration"]
    if not np.all(np.isfinite(ids)):
        raise InputError(path, "demonstration", "must be a whole number in every row")
    order = np.argsort(ids, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(ids[order])) + 1)
    scores = description.get("scores") or [None] * len(groups)
    provenance = description.get("provenance") or [{}] * len(groups)
    for name, values in (("scores", scores), ("provenance", provenance)):
        if not isinstance(values, list) or len(values) != len(groups):
            raise InputError(path, name, f"must have one entry for each of {len(groups)} demonstrations")
    if any(isinstance(score, bool) or not isinstance(score, int | float | None) for score in scores):
        raise InputError(path, "scores", "must be numbers or null", scores)
    if any(not isinstance(origin, dict) for origin in provenance):
        raise InputError(path, "provenance", "must be JSON objects")
    if score_column is not None:
        scores = _column_scores(path, _column(path, table, score_column), groups, score_column)
    items = []
    for rows, score, origin in zip(groups, scores, provenance, strict=True):
        items.append(
            Demonstration(
                times=columns["t"][rows],
                positions=np.stack([columns["x"][rows], columns["y"][rows]], axis=-1),
                yaws=columns["yaw"][rows] if "yaw" in columns else None,
                score=None if score is None else float(score),
                provenance=origin,
                source=f"{os.fspath(path)}: demonstration {int(ids[rows[0]])}",
            )
        )
    return items


def _column_scores(
    path: Path, values: NDArray[Any], groups: Sequence[NDArray[np.intp]], name: str
) -> list[float]:
    scores = []
    for index, rows in enumerate(groups):
        score = float(values[rows[0]])
        if not np.isfinite(score) or np.any(values[rows] != score):
            expected = f"must be one finite number throughout demonstration {index}"
            raise InputError(path, name, expected, f"{score} to {values[rows].max()}")
        scores.append(score)
    return scores


def _read_log(
    path: Path, table: pa.Table, description: Mapping[str, Any], score_column: str | None
) -> list[Demonstration]:
    """A log as one demonstration, if its trial reached the goal without contact."""
    columns = {name: _column(path, table, name) for name in ("t", "x", "y", "yaw", "contact")}
    status = description.get("status")
    if status != "reached":
        raise InputError(path, "status", 'must be "reached" for a log to be a demonstration', repr(status))
    if np.any(columns["contact"]):
        at = columns["t"][np.flatnonzero(columns["contact"])[0]]
        expected = "must be false throughout for a log to be a demonstration"
        raise InputError(path, "contact", expected, f"contact at {at:g} s")
    score = None
    if score_column is not None:
        rows = np.arange(table.num_rows)
        score = _column_scores(path, _column(path, table, score_column), [rows], score_column)[0]
    weight = _column(path, table, "human_weight") if "human_weight" in table.column_names else None
    return [
        Demonstration(
            times=columns["t"],
            positions=np.stack([columns["x"], columns["y"]], axis=-1),
            yaws=columns["yaw"],
            score=score,
            provenance=provenance_of_trial(description, weight),
            source=os.fspath(path),
        )
    ]
