"""Messages of the protocol are parsed, everything else is rejected."""

import json

import pytest

from drake_shared.cockpit.messages import (
    MAX_BYTES,
    Engage,
    MessageError,
    Move,
    Release,
    SetAssist,
    SetStick,
    Setup,
    parse,
)
from drake_shared.systems.mouse_input import StickSettings

SETUP = {
    "type": "setup",
    "scenario": "doorway",
    "learner": None,
    "arbitration": "blend",
    "confidence_gain": 20,
    "route": "left",
    "rumble": True,
    "tone": False,
    "resistance": 0.5,
}
MOVE = {"type": "move", "x": 1, "y": -2.5, "forward": 0.5, "turn": -1}


def test_parses_the_messages_of_the_page():
    assert parse(json.dumps(MOVE)) == Move(x=1.0, y=-2.5, forward=0.5, turn=-1.0)
    assert parse('{"type": "engage"}') == Engage()
    assert parse('{"type": "release"}') == Release()
    assert parse('{"type": "assist", "on": false}') == SetAssist(False)
    stick = {"type": "stick", "gain": 0.002, "dead_zone": 0.1, "return_time": 1}
    expected = StickSettings(gain=0.002, dead_zone=0.1, return_time=1.0)
    assert parse(json.dumps(stick)) == SetStick(expected)
    fields = {name: value for name, value in SETUP.items() if name != "type"}
    assert parse(json.dumps(SETUP)) == Setup(**fields)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "nonsense",
        "[1, 2]",
        "null",
        "7",
        "[" * 1000,
        '{"type": "move"}',
        '{"type": ["move"]}',
        '{"type": "drive"}',
        '{"type": "engage", "as": "root"}',
        '{"type": "assist", "on": 1}',
        '{"type": "stick", "gain": 0, "dead_zone": 0, "return_time": 0}',
        '{"type": "stick", "gain": 0.01, "dead_zone": 1, "return_time": 0}',
        '{"type": "stick", "gain": 0.01, "dead_zone": 0, "return_time": -1}',
        *(
            json.dumps(MOVE).replace('"x": 1', f'"x": {bad}')
            for bad in ("NaN", "Infinity", "-Infinity", "1e999", "1" + 400 * "0", '"1"', "true", "null", "[]")
        ),
        json.dumps(MOVE | {"forward": 1.01}),
        json.dumps(MOVE | {"turn": -2}),
        json.dumps(MOVE | {"z": 0}),
        json.dumps(SETUP | {"resistance": 1.5}),
        json.dumps(SETUP | {"tone": 0}),
        json.dumps(SETUP | {"scenario": None}),
        json.dumps(SETUP | {"confidence_gain": 0}),
    ],
)
def test_rejects_everything_else(text):
    assert len(text) <= MAX_BYTES
    with pytest.raises(MessageError):
        parse(text)


def test_the_longest_message_of_the_page_is_far_below_the_limit():
    widest = MOVE | {"x": -123456789.12345678, "y": 123456789.12345678, "forward": -0.99, "turn": 0.99}
    assert 4 * len(json.dumps(widest)) < MAX_BYTES
