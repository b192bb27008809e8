"""The messages that a page may send on its websocket; see docs/websocket_protocol.md."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

from drake_shared.systems.mouse_input import StickSettings

MAX_BYTES = 1024
"""Largest size of a message from a page, in bytes."""


class MessageError(ValueError):
    """A message violates the protocol; the text names the violation."""


@dataclasses.dataclass(frozen=True, slots=True)
class Engage:
    """Requests the driver lock."""


@dataclasses.dataclass(frozen=True, slots=True)
class Release:
    """Releases the driver lock, which stops the trial."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """State of mouse, keys and gamepad; sent at every change, and every 50 ms as a heartbeat.

    ``x`` (to the right) and ``y`` (down the screen) are counts since the page engaged; ``forward`` and
    ``turn`` (positive to the left) are the axes of keys and gamepad, in [-1, 1].
    """

    x: float
    y: float
    forward: float
    turn: float


@dataclasses.dataclass(frozen=True, slots=True)
class Brake:
    """Asks for a stop: ``lifted`` while no finger is on the touch stick, ``paused`` on request."""

    lifted: bool
    paused: bool


@dataclasses.dataclass(frozen=True, slots=True)
class Recentre:
    """Moves the virtual stick to its centre."""


@dataclasses.dataclass(frozen=True, slots=True)
class SetStick:
    """Sets gain, dead zone and return time of the virtual stick."""

    stick: StickSettings


@dataclasses.dataclass(frozen=True, slots=True)
class SetAssist:
    """Switches the agent on or off, from the next trial on."""

    on: bool


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """Chooses what the next trials are; see `drake_shared.cockpit.trial_choices`."""

    scenario: str
    learner: str | None
    arbitration: str
    confidence_gain: float | None
    route: str | None


@dataclasses.dataclass(frozen=True, slots=True)
class Train:
    """Trains a learner on the drives of this session."""


@dataclasses.dataclass(frozen=True, slots=True)
class Discard:
    """Deletes the log of a drive."""

    number: int


Request = Setup | Train | Discard
"""What the session does between trials."""
Message = Engage | Release | Move | Brake | Recentre | SetStick | SetAssist | Request

_COUNTS = (-1e9, 1e9)
_AXIS = (-1.0, 1.0)
_TYPES = (
    *("move", "engage", "release", "brake", "recentre", "stick"),
    *("assist", "setup", "train", "discard"),
)


def parse(text: str) -> Message:
    """Parses a message.

    Raises:
        MessageError: The text is not a JSON object, the type is unknown, or a field is missing, unknown, of
            the wrong type, not finite or out of range.
    """
    try:
        fields = json.loads(text, parse_constant=_reject_constant)
    except (ValueError, RecursionError) as error:
        raise MessageError("a message must be JSON") from error
    if not isinstance(fields, dict):
        raise MessageError("a message must be a JSON object")
    kind = fields.pop("type", None)
    if kind == "move":
        _check_names(fields, "x", "y", "forward", "turn")
        return Move(
            x=_number(fields, "x", *_COUNTS),
            y=_number(fields, "y", *_COUNTS),
            forward=_number(fields, "forward", *_AXIS),
            turn=_number(fields, "turn", *_AXIS),
        )
    if kind == "engage":
        _check_names(fields)
        return Engage()
    if kind == "release":
        _check_names(fields)
        return Release()
    if kind == "brake":
        _check_names(fields, "lifted", "paused")
        return Brake(lifted=_flag(fields, "lifted"), paused=_flag(fields, "paused"))
    if kind == "recentre":
        _check_names(fields)
        return Recentre()
    if kind == "stick":
        _check_names(fields, "gain", "dead_zone", "return_time")
        return SetStick(
            StickSettings(
                gain=_number(fields, "gain", 1e-5, 0.1),
                dead_zone=_number(fields, "dead_zone", 0.0, 0.9),
                return_time=_number(fields, "return_time", 0.0, 60.0),
            )
        )
    if kind == "assist":
        _check_names(fields, "on")
        return SetAssist(_flag(fields, "on"))
    if kind == "setup":
        _check_names(fields, "scenario", "learner", "arbitration", "confidence_gain", "route")
        gain = fields["confidence_gain"]
        return Setup(
            scenario=_name(fields, "scenario"),
            learner=None if fields["learner"] is None else _name(fields, "learner"),
            arbitration=_name(fields, "arbitration"),
            confidence_gain=None if gain is None else _number(fields, "confidence_gain", 1e-6, 1e9),
            route=None if fields["route"] is None else _name(fields, "route"),
        )
    if kind == "train":
        _check_names(fields)
        return Train()
    if kind == "discard":
        _check_names(fields, "number")
        return Discard(int(_number(fields, "number", 1, 1e9)))
    raise MessageError(f"type must be {', '.join(_TYPES)}")


def _name(fields: dict[str, Any], name: str) -> str:
    value = fields[name]
    if not isinstance(value, str):
        raise MessageError(f"{name} must be text")
    return value


def _reject_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")


def _check_names(fields: dict[str, Any], *names: str) -> None:
    if set(fields) != set(names):
        raise MessageError(f"the fields must be: {', '.join(('type', *names))}")


def _flag(fields: dict[str, Any], name: str) -> bool:
    value = fields[name]
    if not isinstance(value, bool):
        raise MessageError(f"{name} must be true or false")
    return value


def _number(fields: dict[str, Any], name: str, low: float, high: float) -> float:
    value = fields[name]
    # bool is a subclass of int; an int may be too large for a float.
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MessageError(f"{name} must be a number")
    if not low <= value <= high:  # False for NaN as well.
        raise MessageError(f"{name} must be from {low:g} to {high:g}")
    return float(value)
