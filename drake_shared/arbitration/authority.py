"""How much of the control the human keeps, whatever the agent's confidence."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from drake_shared.common.elementwise import FLOATS, Elementwise, Real, Reals
from drake_shared.common.errors import InputError

# A command whose elements are all below this, in its own units, is not a command.
_ZERO_COMMAND = 1e-6
# Times are sums of periods: rounding must not delay what is due by one step.
_TIME_SLACK = 1e-9


@dataclasses.dataclass(frozen=True, kw_only=True)
class Authority:
    """Limits on what the agent takes from the human; a time or rate that is None is off.

    Raises:
        InputError: A value is out of range, or two of them contradict each other.
    """

    enabled: bool = True
    """False: confidence alone decides, eq. (2)."""
    floor: float = 0.1
    """Least human weight w, from 0 to 1."""
    conflict_angle: float = 0.5
    """Commands conflict where the angle between their motions is larger, in rad."""
    agreement_angle: float = 0.5
    """Commands agree where that angle is smaller, in rad."""
    conflict_time: float | None = 0.3
    """After a conflict of this duration w rises to 1, in s."""
    agreement_time: float = 0.2
    """After agreement of this duration the agent takes part again, in s."""
    release_time: float = 0.3
    """Time in which w rises from 0 to 1 in a conflict, in s."""
    weight_rate: float | None = 4.0
    """Largest change of w, in 1/s."""
    command_rate: float | None = 40.0
    """Largest change of each element of the shared command, in its unit per s. The default is more than the
    wheels of the Pioneer follow (15.4 rad/s^2), so it does not delay a human who brakes."""
    hands_off_time: float | None = 1.0
    """After this time without a human command w rises to 1, so that the robot stops, in s."""
    stop_time: float = 0.7
    """Time in which w rises from 0 to 1 then, in s."""

    def __post_init__(self) -> None:
        if not isinstance(self.enabled, bool):
            raise InputError("authority", "enabled", "must be true or false", repr(self.enabled))
        optional = ("conflict_time", "weight_rate", "command_rate", "hands_off_time")
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name == "enabled" or (value is None and field.name in optional):
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
            expected = "must be at most conflict_angle"
            raise InputError("authority", "agreement_angle", expected, self.agreement_angle)
        for name in ("release_time", "stop_time"):
            time = getattr(self, name)
            if self.weight_rate is not None and time * self.weight_rate < 1.0:
                raise InputError("authority", name, "must be at least 1 / weight_rate", time)

    def to_json(self) -> dict[str, Any] | None:
        """What a log holds of it: None if it is disabled, else its numbers."""
        if not self.enabled:
            return None
        return {name: value for name, value in dataclasses.asdict(self).items() if name != "enabled"}


@dataclasses.dataclass(slots=True)
class AuthorityState:
    """What one control step passes to the next; arrays in place of numbers hold it for many trials.

    Attributes:
        weight: w.
        conflict_time: How long the commands have been in conflict, in [s].
        agreement_time: How long they have agreed, in [s].
        released: 1 while the agent gives up control because of a conflict, else 0.
        idle_time: How long the human has given no command, in [s].
        command: Shape (M,), the shared command.
    """

    weight: Real
    conflict_time: Real
    agreement_time: Real
    released: Real
    idle_time: Real
    command: Sequence[Real]

    @classmethod
    def initial(cls, size: int, *, idle_time: float = math.inf) -> AuthorityState:
        """Before the first step: the human drives (w = 1), and the robot rests.

        Args:
            size: M.
            idle_time: Time since the human touched the controls, in [s]; infinite if never.
        """
        return cls(1.0, 0.0, 0.0, 0.0, idle_time, [0.0] * size)

    def to_list(self) -> list[Real]:
        """Shape (5 + M,)."""
        times = [self.conflict_time, self.agreement_time, self.released, self.idle_time]
        return [self.weight, *times, *self.command]

    @classmethod
    def from_list(cls, values: Reals) -> AuthorityState:
        """Inverse of `to_list`."""
        weight, conflict_time, agreement_time, released, idle_time, *command = values
        return cls(weight, conflict_time, agreement_time, released, idle_time, command)


def next_times(
    authority: Authority,
    before: AuthorityState,
    *,
    angle: Real,
    human: Reals,
    idle_time: float | None,
    period: float,
    xp: Elementwise = FLOATS,
) -> AuthorityState:
    """Updates the times of conflict, agreement and idleness by one step; weight and command stay.

    Args:
        authority: The limits.
        before: State of the step before.
        angle: Between the motions of both commands, in [rad]; NaN if one of them hardly moves, which is
            neither conflict nor agreement.
        human: The human's command (M,).
        idle_time: Time since the human touched the controls, in [s]; None if it is not measured. Then the
            time counts for which the command has been zero.
        period: Duration of the step, in [s].
        xp: For numbers or arrays.
    """
    conflict_time = xp.where(angle > authority.conflict_angle, before.conflict_time + period, 0.0)
    agreement_time = xp.where(angle < authority.agreement_angle, before.agreement_time + period, 0.0)
    released = before.released
    if authority.conflict_time is not None:
        stays = agreement_time < authority.agreement_time - _TIME_SLACK
        begins = conflict_time >= authority.conflict_time - _TIME_SLACK
        released = 1.0 * xp.where(released > 0.5, stays, begins)
    drives = xp.isfinite(sum(human)) & (xp.largest(map(abs, human)) > _ZERO_COMMAND)
    idle = xp.where(drives, 0.0, before.idle_time + period if idle_time is None else idle_time)
    return AuthorityState(before.weight, conflict_time, agreement_time, released, idle, before.command)


def is_hands_off(authority: Authority, state: AuthorityState) -> Any:
    """Whether the human has given no command for the hands-off time."""
    time = authority.hands_off_time
    return time is not None and state.idle_time >= time - _TIME_SLACK


def limited_weight(
    authority: Authority, state: AuthorityState, weight: Real, period: float, xp: Elementwise = FLOATS
) -> Real:
    """The weight applied in this step, where confidence alone gives ``weight``.

    It is at least the floor, rises to 1 after a conflict or without a human command, and moves from
    ``state.weight`` no faster than its rate.
    """
    released, hands_off = state.released > 0.5, is_hands_off(authority, state)
    rate = math.inf if authority.weight_rate is None else authority.weight_rate
    rate = xp.where(
        released, 1.0 / authority.release_time, xp.where(hands_off, 1.0 / authority.stop_time, rate)
    )
    weight = xp.where(released | hands_off, 1.0, xp.maximum(weight, authority.floor))
    most = rate * period
    return xp.minimum(xp.maximum(weight, state.weight - most), state.weight + most)


def limited_command(
    authority: Authority,
    before: Reals,
    command: Sequence[Real],
    period: float,
    xp: Elementwise = FLOATS,
) -> Sequence[Real]:
    """As far from ``before`` (M,) straight toward ``command`` (M,) as the command rate allows."""
    if authority.command_rate is None:
        return command
    changes = [new - old for new, old in zip(command, before, strict=True)]
    furthest = xp.largest(map(abs, changes))
    most = authority.command_rate * period
    if xp.all(furthest <= most):
        return command
    share = most / xp.maximum(furthest, most)
    return [
        xp.where(furthest <= most, new, old + share * change)
        for new, old, change in zip(command, before, changes, strict=True)
    ]
