"""A differential-drive robot as data: its sizes, limits and kinematics."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from drake_shared.common.elementwise import FLOATS, Elementwise, Real, Reals
from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.robots.robot import scaled_length

# Lever, in [m], by which a yaw rate counts as a speed when the angle between two twists is taken.
_LEVER = 0.5
# A twist slower than this, in [m/s], has no direction.
_LEAST_SPEED = 0.05
# Within this distance of a target, in [m], the direction to it means nothing.
_AT_TARGET = 0.01
# Yaw rate per angle to a target that lies behind, in [1/s].
_TURN_GAIN = 2.0


@dataclasses.dataclass(kw_only=True)
class DiffDrive:
    """A differential-drive robot with a circular footprint; the defaults are the Pioneer P3-DX.

    Its configuration is [x, y, yaw] in [m, m, rad], world frame, its command the wheel speeds [left, right]
    in [rad/s]. It is a `drake_shared.robots.Robot`. Its kinematics take arrays in place of numbers too, with
    ``xp`` as `drake_shared.common.elementwise.ARRAYS`.
    """

    configuration_names: ClassVar[tuple[str, ...]] = ("x", "y", "yaw")
    position_names: ClassVar[tuple[str, ...]] = ("x", "y")
    command_names: ClassVar[tuple[str, ...]] = ("left", "right")
    command_units: ClassVar[tuple[str, ...]] = ("rad/s", "rad/s")
    speed_names: ClassVar[tuple[str, ...]] = ("wheel_left", "wheel_right")

    model: str = "pioneer_p3dx.sdf"
    """SDF file: a path, or the name of one in models/robots."""
    footprint_radius: float = 0.267
    """Swing radius about the middle of the axle, in [m]."""
    wheel_radius: float = 0.0975
    """In [m]."""
    track: float = 0.33
    """Distance between the wheels, in [m]."""
    max_speed: float = 1.2
    """Of each wheel along the floor, in [m/s]."""
    max_acceleration: float = 1.5
    """Of each wheel along the floor, in [m/s^2]."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name != "model" and not (math.isfinite(value) and value > 0.0):
                raise InputError("robot", field.name, "must be positive and finite", value)

    @property
    def max_wheel_speed(self) -> float:
        """In [rad/s]."""
        return self.max_speed / self.wheel_radius

    @property
    def max_wheel_acceleration(self) -> float:
        """In [rad/s^2]."""
        return self.max_acceleration / self.wheel_radius

    def wheel_speeds(self, speed: Real, yaw_rate: Real, xp: Elementwise = FLOATS) -> tuple[Real, Real]:
        """Wheel speeds (left, right), in [rad/s], that drive at ``speed`` [m/s] and ``yaw_rate`` [rad/s].

        Where a wheel would be too fast both are scaled alike, which keeps the radius of the turn.
        """
        turn = 0.5 * self.track * yaw_rate
        left, right = (speed - turn) / self.wheel_radius, (speed + turn) / self.wheel_radius
        limit = self.max_speed / self.wheel_radius
        scale = limit / xp.maximum(xp.maximum(abs(left), abs(right)), limit)
        return left * scale, right * scale

    def twist(self, left: Real, right: Real) -> tuple[Real, Real]:
        """Speed, in [m/s], and yaw rate, in [rad/s], of the wheel speeds, in [rad/s]."""
        half = 0.5 * self.wheel_radius
        return half * (left + right), self.wheel_radius / self.track * (right - left)

    @property
    def command_limits(self) -> tuple[float, float]:
        """Of each wheel, in [rad/s]."""
        return self.max_wheel_speed, self.max_wheel_speed

    @property
    def characteristic_length(self) -> float:
        """The footprint's radius, in [m]."""
        return self.footprint_radius

    def position(self, configuration: Sequence[float]) -> tuple[float, float]:
        """Position (x, y), in [m], of the middle of the axle."""
        x, y, _ = configuration
        return x, y

    def speed(self, command: Reals) -> Real:
        """Speed along the robot's direction, in [m/s], without its sign."""
        return abs(self.twist(*command)[0])

    def rollout(
        self, configuration: Reals, command: Reals, horizon: Real, xp: Elementwise = FLOATS
    ) -> tuple[Real, Real]:
        """Position (x, y), in [m], at the end of the arc that ``command`` drives in ``horizon`` s."""
        x, y, yaw = configuration
        speed, yaw_rate = self.twist(*command)
        half = 0.5 * yaw_rate * horizon
        chord = speed * horizon * sine_ratio(half, xp)
        return x + chord * xp.cos(yaw + half), y + chord * xp.sin(yaw + half)

    def stick_command(
        self, forward: float, left: float, *, max_speed: float, max_yaw_rate: float
    ) -> tuple[float, float]:
        """Wheel speeds, in [rad/s]: forward deflection is speed, deflection to the left is yaw rate.

        Args:
            forward: In [-1, 1].
            left: In [-1, 1].
            max_speed: Speed at full deflection, in [m/s].
            max_yaw_rate: Yaw rate at full deflection, in [rad/s].
        """
        return self.wheel_speeds(max_speed * forward, max_yaw_rate * left)

    def command_toward(
        self, configuration: Reals, target: Reals, duration: Real, xp: Elementwise = FLOATS
    ) -> tuple[Real, Real]:
        """Wheel speeds, in [rad/s], along the arc to ``target`` (x, y) that starts in the robot's direction.

        This is pure pursuit (Coulter 1992). The robot first turns to a target that lies behind it.
        """
        x, y, yaw = configuration
        target_x, target_y = target
        dx, dy = target_x - x, target_y - y
        distance = xp.hypot(dx, dy)
        bearing = xp.remainder(xp.arctan2(dy, dx) - yaw, math.tau)
        # The chord of length d at angle b belongs to an arc of length d b/sin b and curvature 2 sin b/d.
        speed, turn = distance / sine_ratio(bearing, xp) / duration, 2.0 * bearing / duration
        behind = abs(bearing) > 0.5 * math.pi
        if xp.any(behind):
            speed, turn = xp.where(behind, 0.0, speed), xp.where(behind, _TURN_GAIN * bearing, turn)
        left, right = self.wheel_speeds(speed, turn, xp)
        least = scaled_length(self, _AT_TARGET)
        drives = (distance >= least) & (distance < math.inf)
        if xp.all(drives):
            return left, right
        rests = xp.where(distance < least, 0.0, math.nan)
        return xp.where(drives, left, rests), xp.where(drives, right, rests)

    def conflict_angle(self, a: Reals, b: Reals, xp: Elementwise = FLOATS) -> Real:
        """Angle between two commands as twists (v, lever * yaw rate), in [rad].

        NaN if either hardly moves.
        """
        scale = scaled_length(self, 1.0)
        lever, least = scale * _LEVER, scale * _LEAST_SPEED
        speed, yaw_rate = self.twist(*a)
        other_speed, other_yaw_rate = self.twist(*b)
        turn, other_turn = lever * yaw_rate, lever * other_yaw_rate
        across = speed * other_turn - turn * other_speed
        angle = abs(xp.arctan2(across, speed * other_speed + turn * other_turn))
        moves = (xp.hypot(speed, turn) > least) & (xp.hypot(other_speed, other_turn) > least)
        return xp.where(moves, angle, math.nan)

    def model_path(self) -> Path:
        """Where the SDF file is."""
        given = Path(self.model)
        return given if given.is_file() else models_directory() / "robots" / self.model


def sine_ratio(angle: Real, xp: Elementwise = FLOATS) -> Real:
    """sin(angle) / angle, the ratio of a chord to its arc of twice that angle, in [rad]; 1 at 0."""
    # Of 1e-8 it is 1 to the last bit.
    angle = xp.maximum(abs(angle), 1e-8)
    return xp.sin(angle) / angle
