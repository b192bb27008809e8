"""Errors are one line for the person at the keyboard, and survive the way between processes."""

import pickle
from pathlib import Path

import pytest

from drake_shared.common.errors import DrakeSharedError, InputError, RunError


def test_names_source_field_what_it_must_be_and_what_it_is():
    error = InputError(Path("task.yaml"), "goal.radius", "must be positive", -1.0)
    assert str(error) == "task.yaml: goal.radius must be positive, got -1.0"


def test_a_fault_of_the_whole_names_no_field():
    assert str(InputError("task.yaml", "", "must be a file")) == "task.yaml must be a file"


def test_text_of_many_lines_becomes_one():
    assert str(InputError("a", "b", "cannot be read:\n  line 3\n\n  column 4")) == (
        "a: b cannot be read: line 3 column 4"
    )


@pytest.mark.parametrize("error", [InputError("a.yaml", "name", "must be given", 3), RunError("it diverged")])
def test_comes_back_from_another_process_as_it_was(error):
    received = pickle.loads(pickle.dumps(error))
    assert type(received) is type(error)
    assert str(received) == str(error)


def test_bad_input_is_a_value_error_and_of_the_packages_root():
    assert issubclass(InputError, ValueError)
    assert issubclass(InputError, DrakeSharedError)
    assert not issubclass(RunError, ValueError)
