"""What a person feels of a conflict with the agent: as data and as arithmetic."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from drake_shared.common.errors import InputError
from drake_shared.robots import Robot

# A command whose elements are all below this share of their limits is not a command.
_ZERO_SHARE = 1e-6


@dataclasses.dataclass(frozen=True, kw_only=True)
class Feedback:
    """How a conflict between human and agent is rendered to the person; all off by default.

    Raises:
        InputError: A field has another type or is out of range.
    """

    rumble: bool = False
    """The gamepad rumbles with the strength of the conflict."""
    tone: bool = False
    """A tone rises with the strength of the conflict, on the side to which the agent turns."""
    resistance: float = 0.0
    """Share of the human's command that is lost where the agent, at full confidence, moves the opposite way,
    from 0 to 1. This changes the command."""

    def __post_init__(self) -> None:
        for name in ("rumble", "tone"):
            if not isinstance(getattr(self, name), bool):
                raise InputError("feedback", name, "must be true or false", repr(getattr(self, name)))
        is_number = isinstance(self.resistance, int | float) and not isinstance(self.resistance, bool)
        if not (is_number and 0.0 <= self.resistance <= 1.0):
            raise InputError("feedback", "resistance", "must be from 0 to 1", repr(self.resistance))

    def __bool__(self) -> bool:
        """Whether any feedback is on."""
        return self != Feedback()


def conflict(
    robot: Robot, human: Sequence[float], agent: Sequence[float], confidence: float
) -> tuple[float, tuple[float, ...]]:
    """Strength and direction of the conflict between two commands.

    Args:
        robot: Gives the limits of the commands.
        human, agent: Commands (M,).
        confidence: c_f, from 0 to 1; an agent that is not sure is not felt.

    Returns:
        The strength, confidence times the largest difference of an element as a share of its range, from 0 to
        1; and the direction (M,) from the human's command to the agent's, in shares of the limits, scaled so
        that its largest element is 1. Both are zero while the human gives no command, and where a value is
        not finite.
    """
    limits = robot.command_limits
    nothing = 0.0, (0.0,) * len(limits)
    if not all(map(math.isfinite, (*human, *agent, confidence))):
        return nothing
    if all(abs(value) <= _ZERO_SHARE * limit for value, limit in zip(human, limits, strict=True)):
        return nothing
    gaps = [(there - here) / limit for here, there, limit in zip(human, agent, limits, strict=True)]
    largest = max(map(abs, gaps))
    strength = min(max(confidence, 0.0), 1.0) * min(largest / 2.0, 1.0)
    if strength == 0.0:
        return nothing
    return strength, tuple(gap / largest for gap in gaps)


def resisted_command(
    robot: Robot, human: Sequence[float], agent: Sequence[float], confidence: float, resistance: float
) -> Sequence[float]:
    """The human's command (M,) after the resistance of the stick.

    It is scaled by 1 - resistance * confidence * angle / pi, where the angle is the one between the motions
    of both commands; it stays as it is where either command hardly moves the robot.
    """
    angle = robot.conflict_angle(human, agent)
    if not (math.isfinite(angle) and math.isfinite(confidence)):
        return human
    kept = 1.0 - resistance * min(max(confidence, 0.0), 1.0) * angle / math.pi
    return [kept * value for value in human]
