"""A manipulator as data: its model, limits, and the velocity of its tip as command."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.robots.robot import scaled_length

# For a robot of the size of the Pioneer P3-DX: within this distance, in [m], a target has no direction, and
# below this speed, in [m/s], a command has none.
_AT_TARGET = 0.01
_LEAST_SPEED = 0.03


# Not frozen: Drake's yaml_load_typed assigns the fields.
@dataclasses.dataclass(kw_only=True)
class Arm:
    """A manipulator that is driven by the velocity of its tip; the defaults are arm7, which ships.

    Its command is the velocity [vx, vy, vz] of the tip in [m/s], world frame. Its configuration is the
    position [x, y, z] of the tip in [m], world frame, followed by the joint positions [joint_1, ...] in
    [rad], from base to tip. The orientation of the tip stays that at home. It is a
    `drake_shared.robots.Robot`.
    """

    position_names: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    command_names: ClassVar[tuple[str, ...]] = ("vx", "vy", "vz")
    command_units: ClassVar[tuple[str, ...]] = ("m/s", "m/s", "m/s")

    model: str = "arm7.urdf"
    """URDF or SDF file: a path, or the name of one in models/robots."""
    base: str = "link0"
    """Link that is fixed at the origin of the world."""
    tip: str = "tip"
    """Link or frame whose origin is the tip."""
    home: list[float] = dataclasses.field(
        default_factory=lambda: [0.0, 0.045, 0.0, -1.2174, 0.0, 1.8792, 0.0]
    )
    """Joint positions at the start of a trial, in [rad]; the posture that the arm prefers."""
    max_speed: float = 0.25
    """Of the tip, in [m/s]."""
    max_joint_acceleration: float = 10.0
    """Of each joint, in [rad/s^2]."""
    link_radius: float = 0.09
    """Of the links, in [m]; tolerances in metres scale with it."""

    def __post_init__(self) -> None:
        for name in ("max_speed", "max_joint_acceleration", "link_radius"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError("robot", name, "must be positive and finite", value)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """One for each joint, from base to tip."""
        return tuple(f"joint_{index}" for index in range(1, len(self.home) + 1))

    @property
    def configuration_names(self) -> tuple[str, ...]:
        """Of the position, then of the joints."""
        return (*self.position_names, *self.joint_names)

    @property
    def speed_names(self) -> tuple[str, ...]:
        """Of the joints' speeds, in [rad/s]."""
        return tuple(f"{name}_speed" for name in self.joint_names)

    @property
    def command_limits(self) -> tuple[float, ...]:
        """In [m/s]; the norm of a command is limited too."""
        return (self.max_speed,) * 3

    @property
    def characteristic_length(self) -> float:
        """Radius of the links, in [m]."""
        return self.link_radius

    def position(self, configuration: Sequence[float]) -> tuple[float, ...]:
        """Position (x, y, z) of the tip, in [m]."""
        return tuple(configuration[:3])

    def speed(self, command: Sequence[float]) -> float:
        """Norm of the tip's velocity, in [m/s]."""
        return math.hypot(*command)

    def rollout(
        self, configuration: Sequence[float], command: Sequence[float], horizon: float
    ) -> tuple[float, ...]:
        """Position (x, y, z) of the tip, in [m], after ``horizon`` s of a constant velocity."""
        return tuple([x + horizon * v for x, v in zip(configuration[:3], command, strict=True)])

    def limited(self, velocity: Sequence[float]) -> tuple[float, ...]:
        """``velocity`` (3,), in [m/s], made shorter where the tip cannot be as fast."""
        scale = min(1.0, self.max_speed / max(math.hypot(*velocity), 1e-9))
        return tuple([scale * v for v in velocity])

    def command_toward(
        self, configuration: Sequence[float], target: Sequence[float], duration: float
    ) -> tuple[float, ...]:
        """Velocity, in [m/s], straight to ``target`` (x, y, z)."""
        offset = [goal - x for goal, x in zip(target, configuration[:3], strict=True)]
        distance = math.hypot(*offset)
        if not math.isfinite(distance):
            return (math.nan,) * 3
        if distance < scaled_length(self, _AT_TARGET):
            return (0.0,) * 3
        return self.limited([x / duration for x in offset])

    def conflict_angle(self, a: Sequence[float], b: Sequence[float]) -> float:
        """Angle between two velocities, in [rad]; NaN if either hardly moves."""
        norms = math.hypot(*a), math.hypot(*b)
        if not min(norms) > scaled_length(self, _LEAST_SPEED):
            return math.nan
        cosine = sum(x * y for x, y in zip(a, b, strict=True)) / (norms[0] * norms[1])
        return math.acos(min(max(cosine, -1.0), 1.0))

    def stick_command(
        self, forward: float, left: float, *, max_speed: float, max_yaw_rate: float
    ) -> tuple[float, ...]:
        """Velocity, in [m/s], in the horizontal plane, where forward is along x."""
        return self.limited([max_speed * forward, max_speed * left, 0.0])

    def model_path(self) -> Path:
        """Where the model's file is."""
        given = Path(self.model)
        return given if given.is_file() else models_directory() / "robots" / self.model
