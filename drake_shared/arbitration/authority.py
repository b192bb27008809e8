"""How much of the control the human keeps, whatever the agent's confidence does."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from drake_shared.common.errors import InputError


@dataclasses.dataclass(frozen=True, kw_only=True)
class Authority:
    """What :class:`~drake_shared.systems.confidence_blender.ConfidenceBlender` leaves to the human.

    A part that is None is off.

    Attributes:
        floor: Least w, in [0, 1].
        conflict_angle: Commands point apart where the angle between them as twists is larger, in [rad]; see
            :meth:`ConfidenceBlender`.
        agreement_angle: They agree again where it is smaller, in [rad].
        conflict_time: How long they must point apart until the agent lets go, in [s]; None: it never does.
        agreement_time: How long they must agree until it takes part again, in [s].
        release_time: Time in which w rises from 0 to 1 then, in [s].
        weight_rate: Largest change of w, in [1/s].
        command_rate: Largest change of either wheel's shared command, in [rad/s^2]. The default is above what
            the wheels of the Pioneer follow (15.4), so that it costs a human who brakes nothing.
        hands_off_time: How long a human must give nothing until the robot is brought to rest, in [s]; None:
            the agent drives on alone.
        stop_time: Time in which w rises from 0 to 1 then, in [s].

    Raises:
        InputError: A number is out of range, or two of them contradict each other.
    """

    floor: float = 0.1
    conflict_angle: float = 0.5
    agreement_angle: float = 0.5
    conflict_time: float | None = 0.3
    agreement_time: float = 0.2
    release_time: float = 0.3
    weight_rate: float | None = 4.0
    command_rate: float | None = 40.0
    hands_off_time: float | None = 1.0
    stop_time: float = 0.7

    def __post_init__(self) -> None:
        optional = ("conflict_time", "weight_rate", "command_rate", "hands_off_time")
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value is None and field.name in optional:
                continue
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise InputError("authority", field.name, "must be a finite number", repr(value))
            if field.name != "floor" and not value > 0.0:
                raise InputError("authority", field.name, "must be positive", value)
        if not 0.0 <= self.floor <= 1.0:
            raise InputError("authority", "floor", "must be from 0 to 1", self.floor)
        if self.conflict_angle > math.pi:
            raise InputError("authority", "conflict_angle", "must be at most pi", self.conflict_angle)
        if self.agreement_angle > self.conflict_angle:
            raise InputError(
                "authority", "agreement_angle", "must be at most conflict_angle", self.agreement_angle
            )
        for name in ("release_time", "stop_time"):
            if self.weight_rate is not None and getattr(self, name) * self.weight_rate < 1.0:
                raise InputError(
                    "authority",
                    name,
                    "must be at least 1 / weight_rate, or w cannot rise in it",
                    getattr(self, name),
                )

    def to_json(self) -> dict[str, Any]:
        """As a log keeps it."""
        return dataclasses.asdict(self)


def authority_for(preset: str | None) -> Authority | None:
    """What learners of a preset share the control with: none for "paper" and without a learner."""
    return None if preset in (None, "paper") else Authority()


def parse_authority(text: str) -> Authority | bool:
    """What "on", "off" or changes to the defaults such as "floor=0.3,conflict_time=off" mean.

    Raises:
        InputError: A name is unknown, or a value is not what it must be.
    """
    if text in ("on", "off"):
        return text == "on"
    names = [field.name for field in dataclasses.fields(Authority)]
    given: dict[str, float | None] = {}
    for part in text.split(","):
        name, _, value = (item.strip() for item in part.partition("="))
        if name not in names:
            raise InputError(
                "authority", "", f"must be on, off or name=value of {', '.join(names)}", repr(part)
            )
        if name in given:
            raise InputError("authority", name, "must be given once")
        try:
            given[name] = None if value == "off" else float(value)
        except ValueError as error:
            raise InputError("authority", name, "must be a number", repr(value)) from error
    return Authority(**given)  # type: ignore[arg-type]
