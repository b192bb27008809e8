"""What is known of the noise of a named person, kept in a local file."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from pathlib import Path
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing
from drake_shared.robots import Robot, describe_robot

_FIELDS = ("robot", "noises", "noise_times", "probability", "trials")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Person:
    """The noise of a person with one robot, as `drake_shared.arbitration.fusion_model.FusionModel` has it.

    Attributes:
        robot: The robot's description, as a log holds it.
        noises: Standard deviations considered, in [rad/s].
        noise_times: Time constants considered, in [s].
        probability: Of each pair of both, noise by noise.
        trials: Number of trials from which it was estimated.
    """

    robot: dict[str, Any]
    noises: tuple[float, ...]
    noise_times: tuple[float, ...]
    probability: tuple[float, ...]
    trials: int


def person_path(name: str) -> Path:
    """The file of a person: ``name`` itself if it ends with .json, else one in the user's state folder."""
    if name.endswith(".json"):
        return Path(name)
    if not name or Path(name).name != name:
        raise InputError("--person", "", "must be a name, or a file that ends with .json", repr(name))
    base = os.environ.get("XDG_STATE_HOME")
    folder = Path(base) if base else Path.home() / ".local" / "state"
    return folder / "drake_shared" / "people" / f"{name}.json"


def write_person(person: Person, path: Path) -> None:
    """Writes the file of a person, atomically."""
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(dataclasses.asdict(person), indent=1), encoding="utf-8")


def read_person(path: Path, robot: Robot) -> Person:
    """Reads the file of a person.

    Raises:
        InputError: The file cannot be read, is of another robot, or a probability is not finite.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        expected = "must be a person's file; fit-operator LOG... --person writes one"
        raise InputError(path, "", f"{expected} ({error})") from error
    if not isinstance(data, dict) or set(data) != set(_FIELDS):
        raise InputError(path, "", f"must hold the fields {', '.join(_FIELDS)}")
    if data["robot"] != json.loads(json.dumps(describe_robot(robot).to_json())):
        raise InputError(path, "robot", "must be that of the scenario: people differ from robot to robot")
    for name in _FIELDS[1:4]:
        values = data[name]
        is_list = isinstance(values, list) and bool(values)
        if not is_list or not all(_is_number(value) and 0.0 <= value < math.inf for value in values):
            raise InputError(path, name, "must be numbers that are finite and not negative", repr(values))
    count = len(data["noises"]) * len(data["noise_times"])
    if len(data["probability"]) != count or not sum(data["probability"]) > 0.0:
        raise InputError(path, "probability", f"must be {count} numbers, not all of them zero")
    return Person(
        robot=data["robot"],
        noises=tuple(data["noises"]),
        noise_times=tuple(data["noise_times"]),
        probability=tuple(data["probability"]),
        trials=int(data["trials"]),
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
