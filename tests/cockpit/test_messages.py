"""What a page may say: everything else is refused, with a reason."""

import json

import pytest

from drake_shared.cockpit.messages import (
    MAX_BYTES,
    BadMessage,
    Engage,
    Move,
    Release,
    SetAssist,
    SetStick,
    parse,
)
from drake_shared.systems.mouse_input import StickSettings

MOVE = {"type": "move", "x": 1, "y": -2.5, "forward": 0.5, "turn": -1}


def test_reads_what_the_page_sends():
    assert parse(json.dumps(MOVE)) == Move(x=1.0, y=-2.5, forward=0.5, turn=-1.0)
    assert parse('{"type": "engage"}') == Engage()
    assert parse('{"type": "release"}') == Release()
    assert parse('{"type": "assist", "on": false}') == SetAssist(False)
    stick = {"type": "stick", "gain": 0.002, "dead_zone": 0.1, "return_time": 1}
    expected = StickSettings(gain=0.002, dead_zone=0.1, return_time=1.0)
    assert parse(json.dumps(stick)) == SetStick(expected)


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
    ],
)
def test_refuses_everything_else(text):
    assert len(text) <= MAX_BYTES
    with pytest.raises(BadMessage):
        parse(text)


def test_what_the_page_sends_is_far_below_the_limit():
    widest = MOVE | {"x": -123456789.12345678, "y": 123456789.12345678, "forward": -0.99, "turn": 0.99}
    assert 4 * len(json.dumps(widest)) < MAX_BYTES
