"""A task has the same key, arguments and value wherever it runs."""

import hashlib
import json
import math

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.simulation.runner import Task


def test_the_key_depends_only_on_function_and_arguments():
    task = Task("example_tasks:walk", {"seed": 1, "seconds": 0.5})
    assert task.key == Task("example_tasks:walk", {"seconds": 0.5, "seed": 1}).key
    assert (
        len(
            {
                task.key,
                Task("example_tasks:walk", {"seed": 1}).key,
                Task("example_tasks:spin", task.arguments).key,
            }
        )
        == 3
    )
    # From the definition: if keys change, no folder of results can be resumed.
    text = '["example_tasks:walk",{"seed":1}]'
    assert Task("example_tasks:walk", {"seed": 1}).key == hashlib.sha256(text.encode()).hexdigest()[:24]


def test_arguments_are_converted_to_plain_values_at_once():
    task = Task("example_tasks:walk", {"b": (1, np.float64(0.1)), "a": np.arange(2)})
    assert task.arguments == {"a": [0, 1], "b": [1, 0.1]}
    assert type(task.arguments["b"][1]) is float


def test_a_value_is_the_same_as_read_from_a_file():
    value = Task("example_tasks:extremes").run()
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
    ("function", "arguments", "named"),
    [
        ("example_tasks.walk", {}, "task: function .* example_tasks.walk"),
        ("example_tasks:walk; x", {}, "task: function"),
        ("example_tasks:walk", {"seed": {1}}, "example_tasks:walk: arguments"),
        ("example_tasks:walk", [1], "example_tasks:walk: arguments"),
    ],
)
def test_a_malformed_task_is_bad_input(function, arguments, named):
    with pytest.raises(InputError, match=named):
        Task(function, arguments)


@pytest.mark.parametrize("function", ["nowhere:walk", "example_tasks:nothing", "example_tasks:__doc__"])
def test_a_missing_function_is_bad_input(function):
    with pytest.raises(InputError, match="task: function"):
        Task(function).run()
