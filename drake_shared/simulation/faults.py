"""What goes wrong on purpose, with channel, pose, wheels and learner, as plain numbers."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from drake_shared.common.errors import InputError

LONGEST = 2.0
"""Of any delay, in [s]: systems remember no further back."""
LARGEST = 1000.0
"""Of any error of the pose, in [m] or [rad]: what is further off is no pose, and overflows when squared."""

_CHANNEL = ("delay", "jitter", "loss", "freeze", "human_nan")
_LEARNER = ("late_learner", "learner_nan")
_SHARES = ("loss", "human_nan", "pose_nan", "learner_nan", "slip")
_DELAYS = ("delay", "jitter", "late_learner")
_ERRORS = ("pose_noise", "yaw_noise", "pose_drift")
_POSE = (*_ERRORS, "pose_nan")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Faults:
    """How badly each thing goes wrong; 0 is not at all.

    Attributes:
        delay: Of the human's command on its way, in [s].
        jitter: Further delay of each of its samples, spread evenly from 0 to this, in [s].
        loss: Share of its samples that never arrive.
        freeze_time, freeze: When what arrives of it stops changing, in [s], and for how long, in [s].
        human_nan: Share of steps in which NaN arrives in its place.
        pose_noise: Standard deviation of the noise on x and y as they are seen, in [m], fresh in each step.
        yaw_noise: The same of yaw, in [rad].
        pose_drift: x and y as they are seen wander off: standard deviation after 1 s, in [m]; it grows with
            the square root of time.
        pose_nan: Share of steps in which the pose is seen as NaN.
        slip: Largest share of its command that a wheel loses; see
            :class:`~drake_shared.systems.wheel_slip.WheelSlip`.
        late_learner: How long what the learner says takes to arrive, in [s].
        learner_nan: Share of steps in which it says NaN.

    Raises:
        InputError: A number is out of range, or two of them make no sense together.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    freeze_time: float = 0.0
    freeze: float = 0.0
    human_nan: float = 0.0
    pose_noise: float = 0.0
    yaw_noise: float = 0.0
    pose_drift: float = 0.0
    pose_nan: float = 0.0
    slip: float = 0.0
    late_learner: float = 0.0
    learner_nan: float = 0.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            sound = isinstance(value, int | float) and not isinstance(value, bool)
            if not (sound and math.isfinite(value) and value >= 0.0):
                raise InputError("faults", field.name, "must be a finite number, not negative", repr(value))
        for names, most, unit in ((_SHARES, 1.0, ""), (_DELAYS, LONGEST, " s"), (_ERRORS, LARGEST, "")):
            for name in names:
                if getattr(self, name) > most:
                    raise InputError("faults", name, f"must be at most {most:g}{unit}", getattr(self, name))
        if self.freeze_time and not self.freeze:
            raise InputError("faults", "freeze_time", "needs freeze, for how long", self.freeze_time)
        if self.loss == 1.0:
            # Of samples that never arrive nothing else can be said.
            for name in ("delay", "jitter", "freeze"):
                if getattr(self, name):
                    raise InputError(
                        "faults", name, "makes no sense where every sample is lost", getattr(self, name)
                    )
        for name, others in (
            ("human_nan", ("delay", "jitter", "loss", "freeze")),
            ("pose_nan", _ERRORS),
            ("learner_nan", ("late_learner",)),
        ):
            for other in others:
                if getattr(self, name) == 1.0 and getattr(self, other):
                    raise InputError(
                        "faults", other, f"makes no sense where {name} is 1", getattr(self, other)
                    )

    @property
    def on_channel(self) -> bool:
        """Whether the human's command suffers."""
        return self._any(_CHANNEL)

    @property
    def on_pose(self) -> bool:
        """Whether the pose that is seen suffers."""
        return self._any(_POSE)

    @property
    def on_learner(self) -> bool:
        """Whether what the learner says suffers."""
        return self._any(_LEARNER)

    def _any(self, names: tuple[str, ...]) -> bool:
        return any(getattr(self, name) for name in names)

    def check(self, *, mode: str, duration: float, source: str = "faults") -> None:
        """Makes sure that the faults can show in trials of a mode and a duration, in [s].

        Raises:
            InputError: They strike someone who takes no part, or begin after the end.
        """
        idle = {"human": (_LEARNER, "the human drives"), "agent": (_CHANNEL, "the agent drives")}
        names, who = idle.get(mode, ((), ""))
        for name in names:
            if getattr(self, name):
                raise InputError(source, name, f"makes no sense where {who} alone", getattr(self, name))
        if self.freeze_time >= duration:
            expected = f"must be before the end of the trial at {duration:g} s"
            raise InputError(source, "freeze_time", expected, self.freeze_time)

    def to_json(self) -> dict[str, Any]:
        """As a log keeps it: those that there are."""
        return {name: value for name, value in dataclasses.asdict(self).items() if value}


def parse_faults(text: str) -> Faults:
    """What name=value of :class:`Faults`, such as "delay=0.2,loss=0.1", means.

    Raises:
        InputError: A name is unknown, or a value is not what it must be.
    """
    names = [field.name for field in dataclasses.fields(Faults)]
    given: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = (item.strip() for item in part.partition("="))
        if name not in names:
            raise InputError("faults", "", f"must be name=value of {', '.join(names)}", repr(part))
        if name in given:
            raise InputError("faults", name, "must be given once")
        try:
            given[name] = float(value)
        except ValueError as error:
            raise InputError("faults", name, "must be a number", repr(value)) from error
    return Faults(**given)
