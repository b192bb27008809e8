"""A channel that is slow, loses samples, freezes or garbles: each by itself, sample by sample."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import VectorLogSink

from drake_shared.systems.channel_fault import ChannelFault
from drake_shared.systems.recorded_input import RecordedInput

SENT = np.column_stack((np.arange(1.0, 101.0), -np.arange(1.0, 101.0)))


def received(chance=(1.0, 0.0, 1.0), **faults) -> np.ndarray:
    """Shape (100,): numbers of the samples received, one a step of 0.05 s; sample k is sent at step k."""
    builder = DiagramBuilder()
    operator = builder.AddSystem(RecordedInput(commands=SENT))
    channel = builder.AddNamedSystem("channel", ChannelFault(**faults))
    sink = builder.AddSystem(VectorLogSink(2, 0.05))
    builder.Connect(operator.get_output_port(), channel.GetInputPort("sent"))
    builder.Connect(channel.get_output_port(), sink.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    own = channel.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    drawn = np.broadcast_to(chance, (100, 3))
    for k in range(100):
        channel.GetInputPort("chance").FixValue(own, drawn[k])  # Read by the update before step k.
        simulator.AdvanceTo(0.05 * k)
    rows = sink.FindLog(simulator.get_context()).data()
    np.testing.assert_array_equal(rows[0], -rows[1])
    return rows[0]


def test_without_faults_every_sample_arrives_at_once():
    np.testing.assert_array_equal(received(), np.arange(1, 101))


@pytest.mark.parametrize(("delay", "steps"), [(0.05, 1), (0.5, 10), (0.12, 3)])
def test_a_delay_shifts_all_by_whole_steps(delay, steps):
    got = received(delay=delay)
    np.testing.assert_array_equal(got[:steps], 0.0)
    np.testing.assert_array_equal(got[steps:], np.arange(1, 101 - steps))


def test_jitter_never_goes_back_to_an_older_sample():
    chance = np.random.default_rng(0).uniform(size=(100, 3))
    got = received(chance, jitter=0.5)
    assert (np.diff(got) >= 0).all()
    late = np.arange(1, 101) - got
    assert late.max() > 2
    assert late.max() <= 10


def test_what_is_lost_leaves_the_last_sample_in_place():
    chance = np.ones((100, 3))
    chance[20:30, 0] = 0.1
    got = received(chance, loss=0.2)
    np.testing.assert_array_equal(got[:20], np.arange(1, 21))
    np.testing.assert_array_equal(got[20:30], 20)
    np.testing.assert_array_equal(got[30:], np.arange(31, 101))


def test_frozen_input_stands_still_and_then_goes_on():
    got = received(freeze_time=1.0, freeze=0.5)
    np.testing.assert_array_equal(got[20:30], 20)
    np.testing.assert_array_equal(got[30:], np.arange(31, 101))


def test_nan_takes_the_place_of_a_sample_and_is_not_held():
    chance = np.ones((100, 3))
    chance[50, 2] = 0.0
    got = received(chance, nan=0.5)
    assert np.flatnonzero(np.isnan(got)).tolist() == [50]
    assert got[51] == 52
