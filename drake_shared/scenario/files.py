"""Reads scenarios: from a YAML file, by name, or from the metadata of a log."""

import dataclasses
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydrake.common.yaml import yaml_dump, yaml_load_data, yaml_load_typed

from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.scenario.checks import check_obstacle_path, check_scenario
from drake_shared.scenario.obstacles import position_at
from drake_shared.scenario.scenario import Scenario


def load_scenario(path: str | os.PathLike[str] | None = None) -> Scenario:
    """Reads and checks a scenario.

    Args:
        path: A YAML file, or the name of one in models/scenarios; the two-obstacle task if None.

    Raises:
        InputError: The file is missing or is not a scenario, or `check_scenario` fails.
    """
    given = "two_obstacles" if path is None else os.fspath(path)
    file = Path(given)
    if not file.is_file():
        shipped = {item.stem: item for item in (models_directory() / "scenarios").glob("*.yaml")}
        if given not in shipped:
            raise InputError(given, "", f"must be a scenario file, or one of: {', '.join(sorted(shipped))}")
        file = shipped[given]
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(file, "", f"cannot be read as a scenario: {error}") from error
    return _read_scenario(text, source=file)


def scenario_from_dict(data: Mapping[str, Any], *, source: str | os.PathLike[str] = "scenario") -> Scenario:
    """The scenario whose ``dataclasses.asdict`` is ``data``, as logs hold it.

    Raises:
        InputError: ``data`` is not a scenario, or `check_scenario` fails.
    """
    try:
        given = dict(data)
        given["obstacles"] = [
            {"_tag": "!Box" if "length" in item else "!Circle", **item} for item in given.get("obstacles", [])
        ]
        text = yaml_dump(json.loads(json.dumps(given)))
    except (TypeError, ValueError) as error:
        raise InputError(source, "", f"cannot be read as a scenario: {error}") from error
    return _read_scenario(text, source=source)


def _read_scenario(text: str, *, source: str | os.PathLike[str]) -> Scenario:
    """Reads and checks the scenario of a YAML text."""
    text += "\n"  # yaml_load_typed takes an empty text for a missing argument.
    try:
        scenario: Scenario = yaml_load_typed(schema=Scenario, data=text)
    except Exception as error:  # It raises RuntimeError, yaml.YAMLError, TypeError and others.
        raise InputError(source, _field_at_fault(text), f"cannot be read: {error}") from error
    for item in scenario.obstacles:
        if item.path and math.isnan(item.x) and math.isnan(item.y):
            check_obstacle_path(item, source)
            item.x, item.y = position_at(item, 0.0)
    check_scenario(scenario, source=source)
    return scenario


def _field_at_fault(text: str) -> str:
    """The first field that yaml_load_typed refuses; empty if it is not a single field.

    Its errors do not name the field. Since every field has a default, each can be tried alone.
    """
    fields: list[str] = []
    tried: Any = Scenario()
    while dataclasses.is_dataclass(tried):
        try:
            given = yaml_load_data(text)
        except Exception:  # Not YAML.
            break
        for name, value in given.items() if isinstance(given, dict) else ():
            alone = yaml_dump({name: value})
            try:
                yaml_load_typed(schema=type(tried), data=alone)
            except Exception:  # As above.
                fields.append(str(name))
                tried, text = getattr(tried, str(name), None), yaml_dump(value)
                break
        else:
            break
    return ".".join(fields)
