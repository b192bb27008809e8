"""The systems that inject faults, one step at a time."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.systems.channel_fault import ChannelFault
from drake_shared.systems.intention import empty_intention
from drake_shared.systems.learner_fault import LearnerFault
from drake_shared.systems.pose_fault import PoseFault
from drake_shared.systems.wheel_slip import WheelSlip

PERIOD = 0.05


class Bench:
    """A system and its Context; each step gives its inputs, returns its outputs and makes its updates."""

    def __init__(self, system):
        self.system, self.context, self.count = system, system.CreateDefaultContext(), 0

    def step(self, **inputs) -> dict:
        self.context.SetTime(self.count * PERIOD)
        self.count += 1
        for name, value in inputs.items():
            self.system.GetInputPort(name).FixValue(self.context, value)
        ports = [self.system.get_output_port(index) for index in range(self.system.num_output_ports())]
        outputs = {port.get_name(): port.Eval(self.context) for port in ports}
        outputs = {name: value.copy() if hasattr(value, "copy") else value for name, value in outputs.items()}
        after = self.context.Clone()
        self.system.CalcForcedUnrestrictedUpdate(self.context, after.get_mutable_state())
        discrete = self.system.AllocateDiscreteVariables()
        self.system.CalcForcedDiscreteVariableUpdate(self.context, discrete)
        self.context.SetTimeStateAndParametersFrom(after)
        self.context.SetDiscreteState(discrete)
        return outputs


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (ChannelFault, {"sent": "received"}),
        (PoseFault, {"pose": "seen_pose"}),
        (PoseFault, {"pose": "shown_pose"}),
        (LearnerFault, {"confidence": "late_confidence", "intention": "late_intention"}),
    ],
)
def test_without_a_fault_all_passes_unchanged_and_at_once(make, names):
    system = make()
    bench = Bench(system)
    random = np.random.default_rng(0)
    for count in range(4):
        inputs = {}
        for index in range(system.num_input_ports()):
            port = system.get_input_port(index)
            # The least chance is the likeliest to be taken for a fault.
            highest = 0.0 if port.get_name() == "chance" else 1.0
            inputs[port.get_name()] = random.uniform(0.0, highest, port.size())
        if "intention" in inputs:
            inputs["intention"] = dataclasses.replace(empty_intention(2), time=float(count))
        outputs = bench.step(**inputs)
        for name, output in names.items():
            if name == "intention":
                assert outputs[output].time == count
            else:
                np.testing.assert_array_equal(outputs[output], inputs[name])


def test_faults_step_with_the_control_and_the_ground_changes_twice_a_second():
    def period(system):
        return system.GetUniquePeriodicDiscreteUpdateAttribute().period_sec()

    assert [period(make()) for make in (ChannelFault, PoseFault, LearnerFault)] == [PERIOD] * 3
    assert period(WheelSlip(slip=0.1)) == 0.5


def test_the_error_of_a_pose_is_white_noise_and_a_drift_that_adds_up():
    bench = Bench(PoseFault(noise=0.1, yaw_noise=0.2, drift=0.3, period=PERIOD))
    pose = np.array([1.0, 2.0, 3.0])
    drawn = [[1.0, -2.0, 3.0, 4.0, -5.0], [0.0, 0.0, 0.0, 1.0, 1.0], [-1.0, 1.0, 1.0, 0.0, 0.0]]
    errors = [bench.step(pose=pose, noise=noise, chance=[0.5])["seen_pose"] - pose for noise in drawn]
    errors.append(bench.step()["seen_pose"] - pose)
    # After a second of steps the standard deviation of the drift is 0.3 m.
    step = 0.3 * np.sqrt(PERIOD)
    np.testing.assert_allclose(errors[0], 0.0)
    np.testing.assert_allclose(errors[1], [0.1 + 4.0 * step, -0.2 - 5.0 * step, 0.6])
    np.testing.assert_allclose(errors[2], [5.0 * step, -4.0 * step, 0.0], atol=1e-12)
    np.testing.assert_allclose(errors[3], [-0.1 + 5.0 * step, 0.1 - 4.0 * step, 0.2])


def test_a_wheel_loses_its_share_of_the_command_on_each_patch_of_ground():
    slip = WheelSlip(slip=0.4, patch=0.3)
    assert slip.GetUniquePeriodicDiscreteUpdateAttribute().period_sec() == 0.3
    bench = Bench(slip)
    command = [10.0, -5.0]
    # At the start nothing slips.
    first = bench.step(wheel_command=command, chance=[0.5, 1.0])
    np.testing.assert_array_equal(first["slipped_command"], command)
    second = bench.step(wheel_command=command, chance=[0.0, 0.0])
    np.testing.assert_allclose(second["slipped_command"], [10.0 * 0.8, -5.0 * 0.6])
    np.testing.assert_array_equal(bench.step(wheel_command=command)["slipped_command"], command)


@pytest.mark.parametrize("share", [-0.1, 1.1])
def test_a_slip_that_is_no_share_is_refused(share):
    with pytest.raises(InputError) as caught:
        WheelSlip(slip=share)
    assert caught.value.field == "slip"
    for edge in (0.0, 1.0):
        WheelSlip(slip=edge)


def test_a_late_learner_is_heard_after_its_delay_in_whole_periods():
    bench = Bench(LearnerFault(delay=0.12, period=PERIOD))
    heard = []
    for step in range(6):
        intention = dataclasses.replace(empty_intention(2), time=float(step))
        outputs = bench.step(intention=intention, confidence=[0.1 * step + 0.1], chance=[0.9])
        heard.append((outputs["late_intention"].time, outputs["late_confidence"].item()))
    # 0.12 s are three periods; before, nothing has arrived.
    assert heard[:3] == [(0.0, 0.0)] * 3
    assert heard[3:] == [(0.0, pytest.approx(0.1)), (1.0, pytest.approx(0.2)), (2.0, pytest.approx(0.3))]


def test_a_learner_that_fails_gives_nan_in_its_share_of_the_steps():
    bench = Bench(LearnerFault(nan=0.3, period=PERIOD))
    known = dataclasses.replace(empty_intention(2), mean=np.ones((1, 2)))
    failed = []
    for chance in (0.2, 0.3, 0.29, 0.9):
        outputs = bench.step(intention=known, confidence=[0.7], chance=[chance])
        assert np.isnan(outputs["late_intention"].mean).all() == np.isnan(outputs["late_confidence"].item())
        failed.append(bool(np.isnan(outputs["late_confidence"].item())))
    # A chance counts in the step after it was drawn, and never in the first one.
    assert failed == [False, True, False, True]


def test_in_a_gap_of_the_localisation_the_pose_before_it_is_shown():
    bench = Bench(PoseFault(nan=0.3, period=PERIOD))
    seen, shown = [], []
    for step, chance in enumerate((0.2, 0.1, 0.3, 0.9)):
        outputs = bench.step(pose=[float(step), 1.0, 2.0], noise=np.zeros(5), chance=[chance])
        seen.append(outputs["seen_pose"])
        shown.append(outputs["shown_pose"][0])
    assert [bool(np.isnan(pose).all()) for pose in seen] == [False, True, True, False]
    assert shown == [0.0, 0.0, 0.0, 3.0]
