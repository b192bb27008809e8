"""What a log keeps of a robot: the names, units and limits of its values."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.robots.diff_drive import DiffDrive
from drake_shared.robots.robot import Robot


@dataclasses.dataclass(frozen=True, kw_only=True)
class RobotDescription:
    """Names, units and limits of a robot's configuration and command; see `Robot` for the attributes.

    Attributes:
        type: Name of the robot's class.
    """

    type: str
    configuration_names: tuple[str, ...]
    position_names: tuple[str, ...]
    command_names: tuple[str, ...]
    command_units: tuple[str, ...]
    command_limits: tuple[float, ...]
    speed_names: tuple[str, ...]

    def columns(self, who: str) -> tuple[str, ...]:
        """Columns of a log for the command of ``who``, such as ("human_left", "human_right")."""
        return tuple(f"{who}_{name}" for name in self.command_names)

    def to_json(self) -> dict[str, Any]:
        """The form in which the metadata of a log hold it."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in dataclasses.asdict(self).items()
        }


def describe_robot(robot: Robot) -> RobotDescription:
    """The description of ``robot``."""
    return RobotDescription(
        type=type(robot).__name__,
        configuration_names=tuple(robot.configuration_names),
        position_names=tuple(robot.position_names),
        command_names=tuple(robot.command_names),
        command_units=tuple(robot.command_units),
        command_limits=tuple(float(limit) for limit in robot.command_limits),
        speed_names=tuple(robot.speed_names),
    )


def described_robot(
    metadata: Mapping[str, Any], *, source: str | os.PathLike[str] = "log"
) -> RobotDescription:
    """The robot of a log.

    Logs of version 0.1.0 have no description: their robot is the differential drive of their scenario, or
    the Pioneer P3-DX without a scenario.

    Args:
        metadata: Of the log.
        source: The log, for the message of an error.

    Raises:
        InputError: A field is missing or has another type.
    """
    data = metadata.get("robot")
    if data is None:
        try:
            return describe_robot(DiffDrive(**metadata.get("scenario", {}).get("robot", {})))
        except (TypeError, AttributeError) as error:
            raise InputError(source, "scenario.robot", f"must be a differential drive: {error}") from error
    try:
        names = {
            field.name: tuple(map(str, data[field.name]))
            for field in dataclasses.fields(RobotDescription)
            if field.name not in ("type", "command_limits")
        }
        limits = tuple(map(float, data["command_limits"]))
        return RobotDescription(type=str(data["type"]), command_limits=limits, **names)
    except (KeyError, TypeError, ValueError) as error:
        fields = ", ".join(field.name for field in dataclasses.fields(RobotDescription))
        raise InputError(source, "robot", f"must be an object with {fields}: {error!r}") from error


def require_diff_drive(metadata: Mapping[str, Any], purpose: str) -> RobotDescription:
    """The robot of a log that must be a differential drive.

    Args:
        metadata: Of the log.
        purpose: For the message of an error, such as "to be drawn".

    Raises:
        InputError: The robot is another one, or its description is invalid.
    """
    robot = described_robot(metadata)
    if robot.type != DiffDrive.__name__:
        raise InputError("the log", "robot.type", f"must be {DiffDrive.__name__} {purpose}", robot.type)
    return robot
