"""A task is the same wherever it runs: its key, its arguments, its value."""

import json
import math

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.simulation.runner import Task


def test_the_key_depends_on_function_and_arguments_alone():
    task = Task("chores:walk", {"seed": 1, "seconds": 0.5})
    assert task.key == Task("chores:walk", {"seconds": 0.5, "seed": 1}).key
    assert len({task.key, Task("chores:walk", {"seed": 1}).key, Task("chores:spin", task.arguments).key}) == 3
    # By hand, from the definition: a key that changes makes every folder of results useless.
    assert Task("chores:walk", {"seed": 1}).key == "a9652908264f9a6e63aa6fd9"


def test_arguments_are_what_another_process_would_get():
    task = Task("chores:walk", {"b": (1, np.float64(0.1)), "a": np.arange(2)})
    assert task.arguments == {"a": [0, 1], "b": [1, 0.1]}
    assert type(task.arguments["b"][1]) is float


def test_a_value_is_what_would_be_read_from_a_file():
    value = Task("chores:extremes").run()
    assert list(value) == ["z", "a", "count", "flag", "pair", "7"]
    assert value["z"][:2] == [math.inf, -math.inf]
    assert math.isnan(value["z"][2])
    assert math.copysign(1.0, value["z"][3]) == -1.0
    assert value["z"][4:] == [5e-324, 0.1]
    assert (value["a"], value["count"], value["flag"], value["pair"]) == (
        float(np.float32(0.1)),
        3,
        True,
        [1, 2],
    )
    assert json.dumps(json.loads(json.dumps(value))) == json.dumps(value)


@pytest.mark.parametrize(
    ("function", "arguments", "said"),
    [
        ("chores.walk", {}, 'task: function must be "package.module:name", got chores.walk'),
        ("chores:walk; x", {}, "must be"),
        ("chores:walk", {"seed": {1}}, "arguments must be what JSON can say"),
        ("chores:walk", [1], "arguments must be given by name"),
    ],
)
def test_what_cannot_be_sent_is_refused_at_once(function, arguments, said):
    with pytest.raises(InputError, match=said):
        Task(function, arguments)


@pytest.mark.parametrize("function", ["nowhere:walk", "chores:nothing", "chores:__doc__"])
def test_a_function_that_is_not_there_is_bad_input(function):
    with pytest.raises(InputError, match="task: function must be"):
        Task(function).run()
