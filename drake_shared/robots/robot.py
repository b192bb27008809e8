"""The contract between a robot and shared control."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

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
    """Checks that ``robot`` fulfils the contract `Robot`; its functions are called at configuration zero.

    Raises:
        InputError: It lacks a member, has names that are empty or repeated, lacks a unit or a limit for an
            element of its command, or a limit or the characteristic length is not positive and finite; or a
            function raises an exception or returns something of another size, or not finite.
    """
    name = type(robot).__name__
    members = sorted(item for item in vars(Robot) if not item.startswith("_"))
    missing = [item for item in members if not hasattr(robot, item)]
    if missing:
        raise InputError("robot", "", f"must be a Robot; {name} lacks {', '.join(missing)}")
    assert isinstance(robot, Robot)
    names = ("configuration_names", "position_names", "command_names")
    for field in (*names, "command_units", "speed_names"):
        texts = getattr(robot, field)
        if not (isinstance(texts, tuple | list) and all(isinstance(item, str) for item in texts)):
            raise InputError("robot", f"{name}.{field}", "must be a tuple of text", texts)
        if field in names and (not texts or len(set(texts)) != len(texts) or not all(texts)):
            raise InputError("robot", f"{name}.{field}", "must be distinct names, at least one", texts)
    size = len(robot.command_names)
    if len(robot.command_units) != size:
        expected = f"must have {size} elements, as command_names has"
        raise InputError("robot", f"{name}.command_units", expected, robot.command_units)
    _check_numbers(robot, "command_limits", robot.command_limits, size, positive=True)
    _check_numbers(robot, "characteristic_length", (robot.characteristic_length,), 1, positive=True)
    _check_functions(robot)


def _check_functions(robot: Robot) -> None:
    start = (0.0,) * len(robot.configuration_names)
    command = tuple([0.5 * limit for limit in robot.command_limits])
    positions, commands = len(robot.position_names), len(robot.command_names)
    speed = {"max_speed": 1e-3 * robot.characteristic_length, "max_yaw_rate": 1e-3}
    for field, size, arguments, options in (
        ("position", positions, (start,), {}),
        ("rollout", positions, (start, command, 1.0), {}),
        ("command_toward", commands, (start, (0.0,) * positions, 1.0), {}),
        ("stick_command", commands, (1.0, 1.0), speed),
        ("speed", 0, (command,), {}),
        ("conflict_angle", 0, (command, command), {}),
    ):
        try:
            found = getattr(robot, field)(*arguments, **options)
        except Exception as error:  # A robot of another package may fail in any way.
            reason = f"{type(error).__name__}: {error}"
            raise InputError("robot", f"{type(robot).__name__}.{field}", f"fails ({reason})") from error
        if field != "conflict_angle" or found == found:
            _check_numbers(robot, field, found if size else (found,), size or 1)


def _check_numbers(robot: Robot, field: str, values: Any, size: int, *, positive: bool = False) -> None:
    """Checks that ``values`` are ``size`` finite numbers."""
    try:
        right = len(values) == size and all(
            math.isfinite(item) and (item > 0.0 or not positive) for item in values
        )
    except TypeError:
        right = False
    if not right:
        kind = "positive and finite" if positive else "finite"
        expected = f"must be {size} {kind} number{'s' if size > 1 else ''}"
        raise InputError("robot", f"{type(robot).__name__}.{field}", expected, values)
