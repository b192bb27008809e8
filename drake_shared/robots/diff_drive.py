"""A differential-drive robot as data: its sizes, limits and kinematics."""

import dataclasses
from pathlib import Path

from drake_shared.common.files import models_directory


@dataclasses.dataclass(kw_only=True)
class DiffDrive:
    """A differential-drive robot with a circular footprint; the defaults are the Pioneer P3-DX."""

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

    @property
    def max_wheel_speed(self) -> float:
        """In [rad/s]."""
        return self.max_speed / self.wheel_radius

    @property
    def max_wheel_acceleration(self) -> float:
        """In [rad/s^2]."""
        return self.max_acceleration / self.wheel_radius

    def wheel_speeds(self, speed: float, yaw_rate: float) -> tuple[float, float]:
        """Wheel speeds (left, right), in [rad/s], that drive at ``speed`` [m/s] and ``yaw_rate`` [rad/s].

        Where a wheel would be too fast both are scaled alike, which keeps the radius of the turn.
        """
        turn = 0.5 * self.track * yaw_rate
        left, right = (speed - turn) / self.wheel_radius, (speed + turn) / self.wheel_radius
        fastest = max(abs(left), abs(right))
        if fastest > self.max_wheel_speed:
            scale = self.max_wheel_speed / fastest
            return left * scale, right * scale
        return left, right

    def twist(self, left: float, right: float) -> tuple[float, float]:
        """Speed, in [m/s], and yaw rate, in [rad/s], of the wheel speeds, in [rad/s]."""
        half = 0.5 * self.wheel_radius
        return half * (left + right), self.wheel_radius / self.track * (right - left)

    def model_path(self) -> Path:
        """Where the SDF file is."""
        given = Path(self.model)
        return given if given.is_file() else models_directory() / "robots" / self.model
