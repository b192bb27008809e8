"""The messages that a page may send on its websocket; see docs/websocket_protocol.md."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
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


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Lift:
    """Third axis of an arm's tip: ``up`` in [-1, 1]; ``vertical`` lets the stick move up and sideways."""

    up: float
    vertical: bool


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
    rumble: bool = False
    tone: bool = False
    resistance: float = 0.0


@dataclasses.dataclass(frozen=True, slots=True)
class Train:
    """Trains a learner on the drives of this session."""


@dataclasses.dataclass(frozen=True, slots=True)
class Discard:
    """Deletes the log of a drive."""

    number: int


Request = Setup | Train | Discard
"""What the session does between trials."""
Message = Engage | Release | Move | Lift | Brake | Recentre | SetStick | SetAssist | Request
Reader = Callable[[str, Any], Any]
"""Returns the value of a field, given its name and what JSON holds; raises MessageError."""


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
    if not isinstance(kind, str) or kind not in _MESSAGES:
        raise MessageError(f"type must be {', '.join(_MESSAGES)}")
    make, readers = _MESSAGES[kind]
    if set(fields) != set(readers):
        raise MessageError(f"the fields must be: {', '.join(('type', *readers))}")
    return make(**{name: read(name, fields[name]) for name, read in readers.items()})


def _reject_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise MessageError(f"{name} must be text")
    return value


def _flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise MessageError(f"{name} must be true or false")
    return value


def _number(low: float, high: float) -> Reader:
    def read(name: str, value: Any) -> float:
        # bool is a subclass of int; an int may be too large for a float.
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise MessageError(f"{name} must be a number")
        if not low <= value <= high:  # False for NaN as well.
            raise MessageError(f"{name} must be from {low:g} to {high:g}")
        return float(value)

    return read


def _index(name: str, value: Any) -> int:
    return int(_number(1, 1e9)(name, value))


def _optional(read: Reader) -> Reader:
    return lambda name, value: None if value is None else read(name, value)


def _set_stick(**settings: float) -> SetStick:
    return SetStick(StickSettings(**settings))


_COUNT = _number(-1e9, 1e9)
_AXIS = _number(-1.0, 1.0)

_MESSAGES: dict[str, tuple[Callable[..., Message], dict[str, Reader]]] = {
    "move": (Move, {"x": _COUNT, "y": _COUNT, "forward": _AXIS, "turn": _AXIS}),
    "lift": (Lift, {"up": _AXIS, "vertical": _flag}),
    "engage": (Engage, {}),
    "release": (Release, {}),
    "brake": (Brake, {"lifted": _flag, "paused": _flag}),
    "recentre": (Recentre, {}),
    "stick": (
        _set_stick,
        {"gain": _number(1e-5, 0.1), "dead_zone": _number(0.0, 0.9), "return_time": _number(0.0, 60.0)},
    ),
    "assist": (SetAssist, {"on": _flag}),
    "setup": (
        Setup,
        {
            "scenario": _text,
            "learner": _optional(_text),
            "arbitration": _text,
            "confidence_gain": _optional(_number(1e-6, 1e9)),
            "route": _optional(_text),
            "rumble": _flag,
            "tone": _flag,
            "resistance": _number(0.0, 1.0),
        },
    ),
    "train": (Train, {}),
    "discard": (Discard, {"number": _index}),
}
"""What makes a message of each type, and what reads its fields."""
