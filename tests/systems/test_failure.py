"""What becomes of an exception in a system from outside."""

import gc
import weakref

import pytest
from pydrake.systems.framework import LeafSystem

from drake_shared.common.errors import RunError
from drake_shared.systems.failure import reraise


class OwnError(Exception):
    """Of the system from outside."""


class Fails(LeafSystem):
    """Has an output that cannot be computed."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorOutputPort("output", 1, self._calc)

    def _calc(self, context, output):
        raise OwnError


def evaluate():
    dut = Fails()
    try:
        dut.GetOutputPort("output").Eval(dut.CreateDefaultContext())
    except OwnError as error:
        reraise(error, 2.0)


def test_the_innermost_system_is_named():
    with pytest.raises(RunError, match=r"\(Fails\).*OwnError.*2\.0") as caught:
        evaluate()
    assert isinstance(caught.value.__cause__, OwnError)


def convert():
    try:
        float("half")
    except ValueError as error:
        reraise(error, 2.0, Fails())


def test_the_system_that_caught_it_is_named_if_no_other_raised_it():
    with pytest.raises(RunError, match=r"\(Fails\).*ValueError"):
        convert()


def test_nothing_is_left_of_a_failure_once_it_is_handled():
    gc.collect()
    gc.disable()
    try:
        try:
            evaluate()
        except RunError as error:
            left = weakref.ref(error), weakref.ref(error.__cause__)
        assert [reference() for reference in left] == [None, None]
    finally:
        gc.enable()
