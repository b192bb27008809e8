"""Reads scenarios: from a YAML file, by name, or from the metadata of a log."""

import functools
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from pydrake.common.yaml import yaml_dump, yaml_load_typed

from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.common.suggestions import suggestion
from drake_shared.common.yaml_document import parse_yaml, read_yaml
from drake_shared.scenario.checks import check_obstacle_path, check_scenario
from drake_shared.scenario.fields import check_fields
from drake_shared.scenario.obstacles import position_at
from drake_shared.scenario.scenario import Scenario


def load_scenario(path: str | os.PathLike[str] | None = None) -> Scenario:
    """Reads and checks a scenario.

    Args:
        path: A YAML file, or the name of one in models/scenarios; the two-obstacle task if None.
            scenes-1/scene_07, for example, is a scene of the frozen benchmark, in models/benchmark.

    Raises:
        InputError: The file is missing or is not a scenario, or `check_scenario` fails.

    Returns:
        The path of the robot's model is relative to the file (or to the working folder, if there is none
        beside the file), and absolute in what is returned.
    """
    given = "two_obstacles" if path is None else os.fspath(path)
    file = Path(given)
    if not file.is_file():
        scenes = scene_set(Path(given).parent.name) if given.count("/") == 1 else {}
        if Path(given).name in scenes:
            return scenario_from_dict(scenes[Path(given).name], source=given)
        shipped = shipped_scenarios()
        if given not in shipped:
            expected = f"must be a scenario file, or one of: {', '.join(shipped)}"
            raise InputError(given, "", f"{expected}{suggestion(given, shipped)}")
        file = shipped[given]
    scenario = _read_scenario(read_yaml(file, "a scenario"), source=file)
    # Logs are read in other folders, and hold no more of the file than its path.
    for folder in (file.parent, Path()):
        model = folder / scenario.robot.model
        if model.is_file():
            scenario.robot.model = os.path.abspath(model)
            break
    check_scenario(scenario, source=file)
    return scenario


def shipped_scenarios() -> dict[str, Path]:
    """The files in models/scenarios by the names under which `load_scenario` finds them."""
    return {file.stem: file for file in sorted((models_directory() / "scenarios").glob("*.yaml"))}


@functools.cache
def scene_set(name: str) -> dict[str, dict[str, Any]]:
    """The scenes of a set in models/benchmark by name, for `scenario_from_dict`; none if it is unknown."""
    file = scene_set_file(name)
    if not file.is_file():
        return {}
    return {scene["name"]: scene for scene in json.loads(file.read_text(encoding="utf-8"))}


def scene_set_file(name: str) -> Path:
    """Where the scenes of a set are."""
    return models_directory() / "benchmark" / f"{name}.json"


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
        if "home" in given.get("robot", {}):
            given["robot"] = {"_tag": "!Arm", **given["robot"]}
        text = yaml_dump(json.loads(json.dumps(given)))
    except (TypeError, ValueError) as error:
        raise InputError(source, "", f"cannot be read as a scenario: {error}") from error
    scenario = _read_scenario(text, source=source, with_lines=False)
    check_scenario(scenario, source=source)
    return scenario


def _read_scenario(text: str, *, source: str | os.PathLike[str], with_lines: bool = True) -> Scenario:
    """The scenario of a YAML text, before `check_scenario`."""
    root = parse_yaml(text, source=source, what="a scenario")
    if not isinstance(root, yaml.MappingNode):
        raise InputError(source, "", "cannot be read as a scenario: it must be fields with values")
    check_fields(root, Scenario, source=source, with_lines=with_lines)
    try:
        scenario: Scenario = yaml_load_typed(schema=Scenario, data=text)
    except Exception as error:  # It raises RuntimeError, yaml.YAMLError, TypeError and others.
        raise InputError(source, "", f"cannot be read as a scenario: {error}") from error
    if scenario.goals and "goal" not in {key.value for key, _ in root.value}:
        scenario.goal = scenario.goals[0]
    for item in scenario.obstacles:
        if item.path and math.isnan(item.x) and math.isnan(item.y):
            check_obstacle_path(item, source)
            item.x, item.y = position_at(item, 0.0)
    return scenario
