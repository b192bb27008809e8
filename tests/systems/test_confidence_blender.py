"""ConfidenceBlender: eq. (2) by hand, and what happens where there is nothing to blend."""

import math

import numpy as np
import pytest

from drake_shared.arbitration.authority import Authority
from drake_shared.common.errors import RunError
from drake_shared.systems.confidence_blender import ConfidenceBlender


def blended(human, autonomous, confidence, mode=None) -> tuple[np.ndarray, float]:
    """Shared command and human weight."""
    dut = ConfidenceBlender()
    context = dut.CreateDefaultContext()
    if mode is not None:
        dut.SetDriver(context, mode)
    dut.GetInputPort("human_command").FixValue(context, human)
    dut.GetInputPort("autonomous_command").FixValue(context, autonomous)
    dut.GetInputPort("confidence").FixValue(context, [confidence])
    weight = dut.GetOutputPort("human_weight").Eval(context)
    return dut.GetOutputPort("shared_command").Eval(context).copy(), weight.item()


def test_equation_2_by_hand():
    command, weight = blended([4.0, 0.0], [0.0, 8.0], 0.25)
    assert weight == 0.75
    np.testing.assert_allclose(command, [3.0, 2.0])


@pytest.mark.parametrize("confidence", [0.0, 0.123, 0.5, 1.0])
def test_equal_commands_blend_to_themselves(confidence):
    command, _ = blended([3.7, -1.9], [3.7, -1.9], confidence)
    np.testing.assert_allclose(command, [3.7, -1.9], rtol=1e-15)


def test_an_unsure_agent_leaves_the_drive_to_the_human_bit_for_bit():
    command, weight = blended([3.7, -1.9], [9.1, 2.2], 0.0)
    assert weight == 1.0
    np.testing.assert_array_equal(command, [3.7, -1.9])


def test_a_sure_agent_drives():
    command, weight = blended([3.7, -1.9], [9.1, 2.2], 1.0)
    assert weight == 0.0
    np.testing.assert_array_equal(command, [9.1, 2.2])


@pytest.mark.parametrize("authority", [None, Authority()], ids=["plain", "authority"])
@pytest.mark.parametrize("confidence", [-0.5, 1.5, math.inf, -math.inf])
def test_a_confidence_out_of_range_is_refused_with_the_systems_name_and_the_time(confidence, authority):
    dut = ConfidenceBlender(authority=authority)
    dut.set_name("blender")
    context = dut.CreateDefaultContext()
    context.SetTime(1.25)
    dut.GetInputPort("human_command").FixValue(context, [1.0, 1.0])
    dut.GetInputPort("autonomous_command").FixValue(context, [2.0, 2.0])
    dut.GetInputPort("confidence").FixValue(context, [confidence])
    with pytest.raises(RunError, match=r"blender.*confidence.*1\.25"):
        dut.GetOutputPort("human_weight").Eval(context)


@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("wheel", [0, 1])
@pytest.mark.parametrize("mode", ["shared", "human", "agent"])
def test_without_a_command_of_the_agent_the_human_drives(nothing, wheel, mode):
    autonomous = [1.0, 1.0]
    autonomous[wheel] = nothing
    command, weight = blended([3.7, -1.9], autonomous, 0.9, mode)
    assert weight == 1.0
    np.testing.assert_array_equal(command, [3.7, -1.9])


def test_an_agent_whose_wheels_are_infinite_both_ways_has_no_command():
    assert blended([1.0, 1.0], [math.inf, -math.inf], 0.9)[1] == 1.0


def test_without_a_confidence_the_human_drives():
    command, weight = blended([3.7, -1.9], [1.0, 1.0], math.nan)
    assert weight == 1.0
    np.testing.assert_array_equal(command, [3.7, -1.9])


@pytest.mark.parametrize("human", [[math.nan, 2.0], [2.0, math.inf], [math.inf, -math.inf]])
def test_a_human_command_that_is_no_number_counts_as_zero(human):
    command, weight = blended(human, [4.0, 8.0], 0.25)
    assert weight == 0.75
    np.testing.assert_allclose(command, [1.0, 2.0])
    np.testing.assert_array_equal(blended(human, [4.0, 8.0], 0.0)[0], [0.0, 0.0])


def test_in_mode_human_the_human_drives_alone():
    command, weight = blended([3.7, -1.9], [1.0, 1.0], 0.9, "human")
    assert weight == 1.0
    np.testing.assert_array_equal(command, [3.7, -1.9])


def test_in_mode_agent_the_agent_drives_alone():
    command, weight = blended([3.7, -1.9], [1.0, 2.0], 0.1, "agent")
    assert weight == 0.0
    np.testing.assert_array_equal(command, [1.0, 2.0])


def test_the_blend_lies_between_both():
    rng = np.random.default_rng(1)
    for _ in range(50):
        human, autonomous = rng.uniform(-12, 12, (2, 2))
        command, _ = blended(human, autonomous, rng.uniform())
        assert np.all(command <= np.maximum(human, autonomous) + 1e-12)
        assert np.all(command >= np.minimum(human, autonomous) - 1e-12)


def test_the_mode_belongs_to_the_context():
    dut = ConfidenceBlender()
    alone, shared = dut.CreateDefaultContext(), dut.CreateDefaultContext()
    dut.SetDriver(alone, "human")
    for context in (alone, shared):
        dut.GetInputPort("autonomous_command").FixValue(context, [0.0, 0.0])
        dut.GetInputPort("confidence").FixValue(context, [1.0])
    assert dut.GetOutputPort("human_weight").Eval(alone) == 1.0
    assert dut.GetOutputPort("human_weight").Eval(shared) == 0.0
    assert dut.GetOutputPort("human_weight").Eval(alone.Clone()) == 1.0


def test_everything_feeds_through_without_state():
    dut = ConfidenceBlender()
    weight = dut.GetOutputPort("human_weight").get_index()
    assert not dut.HasDirectFeedthrough(dut.GetInputPort("human_command").get_index(), weight)
    assert dut.HasDirectFeedthrough(dut.GetInputPort("confidence").get_index(), weight)
    assert dut.CreateDefaultContext().num_total_states() == 0


def test_refuses_a_mode_that_is_none():
    dut = ConfidenceBlender()
    with pytest.raises(ValueError, match="driver"):
        dut.SetDriver(dut.CreateDefaultContext(), "both")


@pytest.mark.parametrize(
    ("human", "idle_time", "steps", "reason"),
    [
        ([5.0, 5.0], 0.0, 40, None),
        ([0.0, 0.0], 1.5, 1, "hands_off"),
        ([-5.0, -5.0], 0.0, 40, "conflict"),
    ],
)
def test_the_reason_for_giving_up_control_is_hands_off_or_a_conflict(step, human, idle_time, steps, reason):
    dut = ConfidenceBlender(authority=Authority(conflict_time=1.0, hands_off_time=1.0))
    context = dut.CreateDefaultContext()
    inputs = {
        "human_command": human,
        "autonomous_command": [5.0, 5.0],
        "confidence": [1.0],
        "idle_time": [idle_time],
    }
    for name, value in inputs.items():
        dut.GetInputPort(name).FixValue(context, value)
    for _ in range(steps):
        step(dut, context)
    assert dut.release_reason(context) == reason
    for driver in ("human", "agent"):
        dut.SetDriver(context, driver)
        assert dut.release_reason(context) is None


def test_without_an_authority_control_is_never_given_up():
    dut = ConfidenceBlender()
    assert dut.release_reason(dut.CreateDefaultContext()) is None
