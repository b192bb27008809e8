"""What a page may say on its websocket, and nothing else."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

from drake_shared.systems.mouse_input import StickSettings

MAX_BYTES = 1024
"""Longest message that a page may send."""


class BadMessage(ValueError):  # noqa: N818 (it is not an error of ours)
    """A message that no page of ours sends; its text says what is wrong with it."""


@dataclasses.dataclass(frozen=True, slots=True)
class Engage:
    """Wants the driver's seat."""


@dataclasses.dataclass(frozen=True, slots=True)
class Release:
    """Lets go of the controls, which stops the trial."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """Where mouse, keys and gamepad are; sent at every move, and every 50 ms as a sign of life.

    ``x`` (right) and ``y`` (down the screen) are counts since the page engaged; ``forward`` and ``turn``
    (positive to the left) are in [-1, 1].
    """

    x: float
    y: float
    forward: float
    turn: float


@dataclasses.dataclass(frozen=True, slots=True)
class SetStick:
    """Sets gain, dead zone and return time."""

    stick: StickSettings


@dataclasses.dataclass(frozen=True, slots=True)
class SetAssist:
    """Switches the agent's part on or off, for trials to come."""

    on: bool


Message = Engage | Release | Move | SetStick | SetAssist

_COUNTS = (-1e9, 1e9)
_AXIS = (-1.0, 1.0)


def parse(text: str) -> Message:
    """Reads a message.

    Raises:
        BadMessage: It is no JSON object, of no known type, or a field is missing, unknown, of the wrong
            type, not finite or out of range.
    """
    try:
        fields = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise BadMessage("a message must be JSON") from error
    if not isinstance(fields, dict):
        raise BadMessage("a message must be a JSON object")
    kind = fields.pop("type", None)
    if kind == "move":
        _expect(fields, "x", "y", "forward", "turn")
        return Move(
            x=_number(fields, "x", *_COUNTS),
            y=_number(fields, "y", *_COUNTS),
            forward=_number(fields, "forward", *_AXIS),
            turn=_number(fields, "turn", *_AXIS),
        )
    if kind == "engage":
        _expect(fields)
        return Engage()
    if kind == "release":
        _expect(fields)
        return Release()
    if kind == "stick":
        _expect(fields, "gain", "dead_zone", "return_time")
        return SetStick(
            StickSettings(
                gain=_number(fields, "gain", 1e-5, 0.1),
                dead_zone=_number(fields, "dead_zone", 0.0, 0.9),
                return_time=_number(fields, "return_time", 0.0, 60.0),
            )
        )
    if kind == "assist":
        _expect(fields, "on")
        if not isinstance(fields["on"], bool):
            raise BadMessage("on must be true or false")
        return SetAssist(fields["on"])
    raise BadMessage("type must be move, engage, release, stick or assist")


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def _expect(fields: dict[str, Any], *names: str) -> None:
    if set(fields) != set(names):
        raise BadMessage(f"the fields must be: {', '.join(('type', *names))}")


def _number(fields: dict[str, Any], name: str, least: float, most: float) -> float:
    value = fields[name]
    # bool is an int to Python, not to us; an int may be too large for a float.
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadMessage(f"{name} must be a number")
    if not (math.isfinite(value) if isinstance(value, float) else True) or not least <= value <= most:
        raise BadMessage(f"{name} must be from {least:g} to {most:g}")
    return float(value)
