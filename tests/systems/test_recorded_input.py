"""RecordedInput: each row at its period, and nothing after the end."""

import math

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.systems.recorded_input import RecordedInput

ROWS = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])


def played(dut: RecordedInput, context, step, count: int) -> list[list[float]]:
    commands = []
    for index in range(count):
        context.SetTime(0.05 * index)
        commands.append(dut.GetOutputPort("human_command").Eval(context).tolist())
        step(dut, context)
    return commands


def test_gives_row_k_from_period_k_and_zero_after_the_end(step):
    dut = RecordedInput(commands=ROWS, period=0.05)
    assert played(dut, dut.CreateDefaultContext(), step, 5) == [*ROWS.tolist(), [0, 0], [0, 0]]


def test_rows_are_not_shifted_by_rounding_however_long_the_recording(step):
    rows = np.random.default_rng(1).normal(size=(2000, 2))
    dut = RecordedInput(commands=rows, period=0.05)
    assert played(dut, dut.CreateDefaultContext(), step, 2000) == rows.tolist()


def test_each_context_plays_its_own_recording(step):
    dut = RecordedInput(period=0.05)
    silent, other = dut.CreateDefaultContext(), dut.CreateDefaultContext()
    dut.SetRecording(other, ROWS)
    assert played(dut, silent, step, 2) == [[0, 0], [0, 0]]
    assert played(dut, other, step, 2) == ROWS[:2].tolist()


def test_what_is_done_to_the_rows_afterwards_does_not_matter(step):
    rows = ROWS.copy()
    dut = RecordedInput(commands=rows, period=0.05)
    rows[:] = 9.0
    assert played(dut, dut.CreateDefaultContext(), step, 3) == ROWS.tolist()


def test_the_command_is_state():
    dut = RecordedInput(commands=ROWS)
    assert dut.num_input_ports() == 0
    assert not dut.HasAnyDirectFeedthrough()


@pytest.mark.parametrize("commands", [np.zeros((3, 3)), np.zeros(4), [[1.0, math.nan]], [[1.0, math.inf]]])
def test_commands_of_another_shape_or_not_finite_are_refused(commands):
    dut = RecordedInput()
    for play in (
        lambda: RecordedInput(commands=commands),
        lambda: dut.SetRecording(dut.CreateDefaultContext(), commands),
    ):
        with pytest.raises(InputError) as caught:
            play()
        assert caught.value.field == "commands"
