"""Faults that are injected into command channel, pose, wheels and learner, as data."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from drake_shared.common.errors import InputError

LONGEST = 2.0
"""Largest delay, in [s]: systems store no more of the past."""
LARGEST = 1000.0
"""Largest error of the pose, in [m] or [rad]: squares of larger ones may overflow."""

_CHANNEL = ("delay", "jitter", "loss", "freeze", "human_nan")
_LEARNER = ("late_learner", "learner_nan")
_SHARES = ("loss", "human_nan", "pose_nan", "learner_nan", "slip")
_DELAYS = ("delay", "jitter", "late_learner")
_ERRORS = ("pose_noise", "yaw_noise", "pose_drift")
_POSE = (*_ERRORS, "pose_nan")
# Where the first is 1, nothing is left that the others could change.
_HIDES: dict[str, tuple[str, ...]] = {
    "loss": ("delay", "jitter", "freeze"),
    "human_nan": ("delay", "jitter", "loss", "freeze"),
    "pose_nan": _ERRORS,
    "learner_nan": ("late_learner",),
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Faults:
    """Size of each fault; 0 is none.

    Raises:
        InputError: A value is out of range, or two of them contradict each other.
    """

    delay: float = 0.0
    """Delay of the human's command, in s."""
    jitter: float = 0.0
    """Further delay of each sample of it, uniform from 0 to this, in s."""
    loss: float = 0.0
    """Share of its samples that are lost, from 0 to 1."""
    freeze_time: float = 0.0
    """Time at which the received command freezes, in s."""
    freeze: float = 0.0
    """Duration for which it is frozen, in s."""
    human_nan: float = 0.0
    """Share of steps in which NaN is received instead of the command, from 0 to 1."""
    pose_noise: float = 0.0
    """Standard deviation of white noise on the measured x and y, in m."""
    yaw_noise: float = 0.0
    """Standard deviation of white noise on the measured yaw, in rad."""
    pose_drift: float = 0.0
    """Random walk of the measured x and y: standard deviation after 1 s, in m; it grows with the square root
    of time."""
    pose_nan: float = 0.0
    """Share of steps in which the measured pose is NaN, from 0 to 1."""
    slip: float = 0.0
    """Largest share of its command that a wheel loses, from 0 to 1."""
    late_learner: float = 0.0
    """Delay of the learner's output, in s."""
    learner_nan: float = 0.0
    """Share of steps in which the learner's output is NaN, from 0 to 1."""

    def __post_init__(self) -> None:
        for name, value in dataclasses.asdict(self).items():
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (is_number and math.isfinite(value) and value >= 0.0):
                raise InputError("faults", name, "must be a finite number, not negative", repr(value))
        for names, most, unit in ((_SHARES, 1.0, ""), (_DELAYS, LONGEST, " s"), (_ERRORS, LARGEST, "")):
            for name in names:
                if getattr(self, name) > most:
                    raise InputError("faults", name, f"must be at most {most:g}{unit}", getattr(self, name))
        if self.freeze_time and not self.freeze:
            raise InputError("faults", "freeze_time", "requires freeze", self.freeze_time)
        for hiding, hidden in _HIDES.items():
            for name in hidden:
                if getattr(self, hiding) == 1.0 and getattr(self, name):
                    expected = f"has no effect where {hiding} is 1"
                    raise InputError("faults", name, expected, getattr(self, name))

    def __bool__(self) -> bool:
        """Whether there is any fault."""
        return self != Faults()

    @property
    def on_channel(self) -> bool:
        """Whether the human's command is affected."""
        return self._any(_CHANNEL)

    @property
    def on_pose(self) -> bool:
        """Whether the measured pose is affected."""
        return self._any(_POSE)

    @property
    def on_learner(self) -> bool:
        """Whether the learner's output is affected."""
        return self._any(_LEARNER)

    def _any(self, names: tuple[str, ...]) -> bool:
        return any(getattr(self, name) for name in names)

    def check_driver(self, driver: str, *, source: str = "config") -> None:
        """Checks that the faults can have an effect where ``driver`` drives.

        Raises:
            InputError: A fault affects only someone who takes no part.
        """
        without_effect = {"human": _LEARNER, "agent": _CHANNEL}
        for name in without_effect.get(driver, ()):
            if getattr(self, name):
                expected = f"has no effect where the {driver} drives alone"
                raise InputError(source, f"faults.{name}", expected, getattr(self, name))

    def check_duration(self, duration: float, *, source: str = "config") -> None:
        """Checks that the faults begin before the end of a trial of ``duration`` s.

        Raises:
            InputError: The command would freeze after the end.
        """
        if self.freeze_time >= duration:
            expected = f"must be before the end of the trial at {duration:g} s"
            raise InputError(source, "faults.freeze_time", expected, self.freeze_time)

    def to_json(self) -> dict[str, Any]:
        """The faults that are not 0, as a log holds them."""
        return {name: value for name, value in dataclasses.asdict(self).items() if value}
