"""Errors are one line of text, name the field at fault, and survive the transfer between processes."""

import pickle
from pathlib import Path

import pytest

from drake_shared.common.errors import DrakeSharedError, InputError, RunError


def test_text_holds_source_field_expectation_and_value():
    error = InputError(Path("task.yaml"), "goal.radius", "must be positive", -1.0)
    assert str(error) == "task.yaml: goal.radius must be positive, got -1.0"
    assert (error.source, error.field) == ("task.yaml", "goal.radius")


def test_an_error_of_the_whole_file_has_no_field():
    assert str(InputError("task.yaml", "", "must be a file")) == "task.yaml must be a file"


def test_several_lines_become_one():
    assert str(InputError("a", "b", "cannot be read:\n  line 3\n\n  column 4")) == (
        "a: b cannot be read: line 3 column 4"
    )


@pytest.mark.parametrize("error", [InputError("a.yaml", "name", "must be given", 3), RunError("it diverged")])
def test_an_error_is_the_same_in_another_process(error):
    received = pickle.loads(pickle.dumps(error))
    assert type(received) is type(error)
    assert str(received) == str(error)
    assert vars(received) == vars(error)


def test_bad_input_is_a_value_error_and_a_failed_run_is_not():
    assert issubclass(InputError, ValueError)
    assert issubclass(InputError, DrakeSharedError)
    assert not issubclass(RunError, ValueError)
