"""The contract between a robot and shared control."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from drake_shared.common.errors import InputError

# Tolerances in metres were chosen for the Pioneer P3-DX, whose characteristic length this is, in [m].
_REFERENCE_LENGTH = 0.267


@runtime_checkable
class Robot(Protocol):
    """A robot as data and arithmetic; `drake_shared.robots.DiffDrive` is one.

    The output port ``pose`` of a robot's plant holds a configuration. The position of a configuration, of
    size D, is what learners learn and predict; a command, of size M, is what arbitration blends.

    Attributes:
        configuration_names: Names of the elements of a configuration, such as ("x", "y", "yaw").
        position_names: Names of the D coordinates of the position, all in [m], world frame; also the columns
            of demonstrations. "x", "y" and "z" are drawn along those axes.
        command_names: Names of the M elements of a command; the log has a column for each, such as
            ``human_left``.
        command_units: Unit of each element of a command, such as ("rad/s", "rad/s").
        command_limits: Largest absolute value of each element of a command.
        speed_names: Columns of the log for the plant's output of its own speeds, such as ("wheel_left",
            "wheel_right"); as many as that port has elements.
        characteristic_length: Radius of the body, in [m]; tolerances in metres scale with it.
    """

    @property
    def configuration_names(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def position_names(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def command_names(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def command_units(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def command_limits(self) -> tuple[float, ...]: ...  # noqa: D102
    @property
    def speed_names(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def characteristic_length(self) -> float: ...  # noqa: D102

    def position(self, configuration: Sequence[float]) -> tuple[float, ...]:
        """Position (D,), in [m], of a configuration."""
        ...

    def speed(self, command: Sequence[float]) -> float:
        """Speed of the position under a command (M,), in [m/s]."""
        ...

    def rollout(
        self, configuration: Sequence[float], command: Sequence[float], horizon: float
    ) -> tuple[float, ...]:
        """Position (D,), in [m], to which ``command`` (M,), held for ``horizon`` s, leads."""
        ...

    def command_toward(
        self, configuration: Sequence[float], target: Sequence[float], duration: float
    ) -> tuple[float, ...]:
        """Command (M,) that moves toward the position ``target`` (D,), to be there in ``duration`` s.

        It is within the limits. Zero at the target; NaN where the target is not finite.
        """
        ...

    def conflict_angle(self, a: Sequence[float], b: Sequence[float]) -> float:
        """Angle between the motions of two commands (M,), in [rad], from 0 to pi.

        NaN if either hardly moves.
        """
        ...

    def stick_command(
        self, forward: float, left: float, *, max_speed: float, max_yaw_rate: float
    ) -> tuple[float, ...]:
        """Command (M,), within the limits, of a stick with two axes.

        Args:
            forward: Deflection away from the driver, in [-1, 1].
            left: Deflection to the left, in [-1, 1].
            max_speed: Speed at full deflection, in [m/s].
            max_yaw_rate: Yaw rate at full deflection, in [rad/s]; for robots that turn.
        """
        ...


def scaled_length(robot: Robot, length: float) -> float:
    """A length in [m] that was chosen for the Pioneer P3-DX, scaled to the size of ``robot``."""
    return length * (robot.characteristic_length / _REFERENCE_LENGTH)


def check_robot(robot: object) -> None:
    """Checks that ``robot`` fulfils the contract `Robot`.

    Raises:
        InputError: It lacks a member, has names that are empty or repeated, lacks a unit or a limit for an
            element of its command, or a limit or the characteristic length is not positive and finite.
    """
    name = type(robot).__name__
    members = sorted(item for item in vars(Robot) if not item.startswith("_"))
    missing = [item for item in members if not hasattr(robot, item)]
    if missing:
        raise InputError("robot", "", f"must be a Robot; {name} lacks {', '.join(missing)}")
    assert isinstance(robot, Robot)
    for field, names in (
        ("configuration_names", robot.configuration_names),
        ("position_names", robot.position_names),
        ("command_names", robot.command_names),
    ):
        if not names or len(set(names)) != len(names) or not all(names):
            raise InputError("robot", f"{name}.{field}", "must be distinct names, at least one", names)
    for field, values in (("command_units", robot.command_units), ("command_limits", robot.command_limits)):
        if len(values) != len(robot.command_names):
            expected = f"must have {len(robot.command_names)} elements, as command_names has"
            raise InputError("robot", f"{name}.{field}", expected, values)
    for field, lengths in (
        ("command_limits", robot.command_limits),
        ("characteristic_length", (robot.characteristic_length,)),
    ):
        if not all(math.isfinite(value) and value > 0.0 for value in lengths):
            raise InputError("robot", f"{name}.{field}", "must be positive and finite", lengths)
