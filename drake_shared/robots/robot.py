"""What shared control needs to know of a robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

# Tolerances in metres were chosen for the Pioneer P3-DX, whose characteristic length this is, in [m].
_REFERENCE_LENGTH = 0.267


@runtime_checkable
class Robot(Protocol):
    """A robot as data and arithmetic; `drake_shared.robots.DiffDrive` is one.

    A configuration is what the plant's output ``pose`` holds. Its position, of size D, is what learners learn
    and predict; its command, of size M, is what arbitration blends.

    Attributes:
        configuration_names: Names of the elements of a configuration, such as ("x", "y", "yaw").
        position_names: Names of the D coordinates of the position, all in [m], world frame; also the columns
            of demonstrations.
        command_names: Names of the M elements of a command; the log has a column for each, such as
            ``human_left``.
        command_units: Unit of each element of a command, such as ("rad/s", "rad/s").
        command_limits: Largest absolute value of each element of a command.
        speed_names: Columns of the log for the plant's output of its own speeds, such as ("wheel_left",
            "wheel_right"); as many as that port has elements.
        characteristic_length: Size of the body, in [m]; tolerances in metres scale with it.
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


def scaled_length(robot: Robot, length: float) -> float:
    """A length in [m] that was chosen for the Pioneer P3-DX, scaled to the size of ``robot``."""
    return length * (robot.characteristic_length / _REFERENCE_LENGTH)
