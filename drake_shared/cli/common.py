"""Shared by several commands: the learner, and results as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from drake_shared.common.console import say
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner, load_learner
from drake_shared.learners.storage import learner_id, shipped_learners
from drake_shared.scenario import Scenario


def parquet_files(paths: Sequence[Path]) -> list[Path]:
    """The files among ``paths``, and the Parquet files in the folders among them, by name.

    Raises:
        InputError: A folder has none.
    """
    files: list[Path] = []
    for path in paths:
        found = sorted(path.glob("*.parquet")) if path.is_dir() else [path]
        if not found:
            raise InputError(path, "", "must hold at least one Parquet file")
        files += found
    return files


def choose_model(scenario: Scenario, model: Path | None, preset: str) -> Path:
    """The learner's file: ``model``, or the one that ships for the scenario and preset.

    Raises:
        InputError: ``model`` is None and none ships.
    """
    if model is not None:
        return model
    shipped = shipped_model(scenario.name, preset)
    if shipped is None:
        expected = f"must be given: no learner ships for scenario {scenario.name!r}"
        expected += "; train makes one, and a human drives without (--driver human)"
        raise InputError("--model", "", expected)
    return shipped


def shipped_model(scenario: str, preset: str) -> Path | None:
    """The file of the learner that ships for a scenario and preset; None if there is none."""
    return shipped_learners().get(f"{scenario}_{preset}")


def open_learner(scenario: Scenario, model: Path | None, preset: str) -> tuple[Learner, Path]:
    """Loads the learner of `choose_model`; a warning says if it was trained for another scenario."""
    path = choose_model(scenario, model, preset)
    return load_learner_for(scenario.name, path), path


def load_learner_for(scenario: str, path: Path) -> Learner:
    """Loads a learner; a warning says if it was trained for another scenario than ``scenario``."""
    learner = load_learner(path)
    taught = learner.metadata.get("scenario")
    if taught not in (None, scenario):
        say(f"warning: {path} was taught scenario {taught!r}, not {scenario!r}")
    return learner


def learner_of_log(metadata: Mapping[str, Any], model: Path | None) -> Learner | None:
    """Loads the learner of a logged trial: ``model`` if it is given, else the shipped or named file.

    Returns:
        None if the trial had no learner, or its file is not found.

    Raises:
        InputError: The named file now holds another learner.
    """
    if model is not None:
        return load_learner_for(metadata["scenario"]["name"], model)
    identity, named = metadata.get("learner_id"), metadata.get("learner_file")
    if identity is None:
        return None
    for file in shipped_learners().values():
        if learner_id(file) == identity:
            return load_learner(file)
    if named is None or not Path(named).is_file():
        return None
    if learner_id(named) != identity:
        raise InputError(named, "", "is no longer the learner of this log; give another with --model")
    return load_learner(named)


def print_json(value: Any) -> None:
    """Prints one JSON object to standard output; NaN and infinity become null."""
    print(json.dumps(_plain(value), allow_nan=False))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
