"""Faults injected into the whole loop: what each does, and that NaN never reaches the plant."""

import numpy as np
import pytest

from drake_shared.arbitration.authority import Authority
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.faults import Faults
from drake_shared.simulation.trial import Simulation, TrialSettings, read_log, write_log
from drake_shared.systems.pose_fault import PoseFault
from drake_shared.systems.safety_filter import SafetyFilter

NONE = Faults()
SETTINGS = TrialSettings(route="left_right", seed=3)


@pytest.fixture(scope="module")
def learner(_two_obstacles, route_learner):
    return route_learner(_two_obstacles, "left_right", variance=0.015, gain=40.0)


@pytest.fixture(scope="module")
def run(_two_obstacles, learner):
    def run(faults=NONE, *, settings=SETTINGS, end="duration", **options):
        config = SharedControlConfig(faults=faults, end=end, **options)
        return Simulation(_two_obstacles, learner=learner, config=config).run(settings)

    return run


@pytest.fixture(scope="module")
def sound(run):
    return run()


def test_without_faults_there_are_no_more_systems_and_the_same_bits(scenario, learner, sound):
    plain = Simulation(scenario, learner=learner, config=SharedControlConfig())
    none = Simulation(scenario, learner=learner, config=SharedControlConfig(faults=Faults(), end="duration"))
    names = [[item.get_name() for item in each.diagram.GetSystems()] for each in (plain, none)]
    assert names[0] == names[1]
    trial = none.run(SETTINGS)
    assert list(trial.columns) == list(sound.columns)
    for name, values in sound.columns.items():
        np.testing.assert_array_equal(trial[name], values)


def test_what_a_seed_draws_for_the_operator_does_not_depend_on_faults(run, sound):
    # A fault that does nothing in the time looked at: the operator's noise must be the one of before.
    trial = run(Faults(freeze_time=10.0, freeze=1.0))
    np.testing.assert_array_equal(trial["human_left"][:200], sound["human_left"][:200])


def test_the_log_names_the_faults_and_holds_what_arrived_beside_what_is_true(run, tmp_path):
    trial = run(Faults(delay=0.2, pose_noise=0.05, late_learner=0.1, slip=0.3))
    np.testing.assert_array_equal(trial["received_left"][4:], trial["human_left"][:-4])
    np.testing.assert_array_equal(trial["heard_confidence"][2:], trial["confidence"][:-2])
    error = trial["seen_x"] - trial["x"]
    assert 0.04 < error[1:].std() < 0.06
    kept = trial["slipped_left"][trial["shared_left"] > 0] / trial["shared_left"][trial["shared_left"] > 0]
    assert kept.min() < 0.8
    assert kept.min() >= 0.7 - 1e-9
    assert kept.max() <= 1.0
    write_log(trial, tmp_path / "log.parquet")
    told = read_log(tmp_path / "log.parquet").metadata["faults"]
    assert told == {"delay": 0.2, "pose_noise": 0.05, "slip": 0.3, "late_learner": 0.1}


def test_drift_grows_and_leaves_the_true_pose_alone(run, sound):
    trial = run(Faults(pose_drift=0.1))
    error = np.hypot(trial["seen_x"] - trial["x"], trial["seen_y"] - trial["y"])
    assert error[:20].max() < error[-20:].min()
    np.testing.assert_array_equal(trial["seen_yaw"], trial["yaw"])
    steps = np.hypot(np.diff(trial["x"]), np.diff(trial["y"]))
    assert steps.max() <= 0.05 * 1.2 + 1e-9  # What is true moves as a robot does.


def test_noise_and_drift_are_of_the_position_wherever_it_is_in_the_configuration():
    class YawFirst(DiffDrive):
        configuration_names = ("yaw", "x", "y")

    fault = PoseFault(noise=0.1, yaw_noise=0.01, drift=1.0, robot=YawFirst(), period=0.04)
    context = fault.CreateDefaultContext()
    fault.get_input_port(0).FixValue(context, [3.0, 1.0, 2.0])
    fault.GetInputPort("noise").FixValue(context, [1.0, 1.0, 1.0, 0.0, 2.0])
    fault.GetInputPort("chance").FixValue(context, [0.5])
    context.SetDiscreteState(fault.EvalUniquePeriodicDiscreteUpdate(context))
    seen = fault.GetOutputPort("seen_pose").Eval(context)
    np.testing.assert_allclose(seen, [3.01, 1.1, 2.1 + 0.2 * 2.0], atol=1e-12)


@pytest.mark.parametrize("safety", [None, 0.05])
@pytest.mark.parametrize("authority", [Authority(enabled=False), Authority()])
@pytest.mark.parametrize("source", ["human_nan", "learner_nan", "pose_nan"])
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_nan_never_reaches_the_plant(run, source, share, authority, safety):
    trial = run(Faults(**{source: share}), authority=authority, safety_clearance=safety)
    seen = {"human_nan": "received_left", "learner_nan": "heard_confidence", "pose_nan": "seen_x"}[source]
    assert np.isnan(trial[seen]).mean() == pytest.approx(share, abs=0.1)  # The fault is there at all.
    for name in ("shared_left", "shared_right", "human_left", "human_weight", "x", "y", "yaw", "wheel_left"):
        assert np.isfinite(trial[name]).all(), name
    if safety is not None:
        assert np.isfinite(trial.commands("safe")).all()
        assert not trial["contact"].any()


def test_the_human_drives_on_where_the_learner_fails(run):
    trial = run(Faults(learner_nan=1.0))
    np.testing.assert_array_equal(trial["human_weight"][1:], 1.0)
    assert trial.status == "reached"
    assert not trial["contact"].any()


@pytest.mark.parametrize("authority", [Authority(enabled=False), Authority()])
def test_a_pose_that_is_no_number_hands_over_to_the_human_in_that_very_step(run, authority):
    trial = run(Faults(pose_nan=0.3), authority=authority)
    gap = np.isnan(trial["seen_x"])
    np.testing.assert_array_equal(trial["human_weight"][gap], 1.0)
    assert trial["human_weight"][~gap].min() < 0.9
    assert trial.status == "reached"


def test_a_safety_filter_that_does_not_know_where_the_robot_is_brakes_it(scenario):
    dut = SafetyFilter(robot=scenario.robot)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("pose").FixValue(context, [np.nan, 0.0, 0.0])
    dut.GetInputPort("wheel_command").FixValue(context, [5.0, 5.0])
    np.testing.assert_array_equal(dut.GetOutputPort("safe_command").Eval(context), 0.0)


def test_a_frozen_command_is_driven_on_with(run):
    trial = run(Faults(freeze_time=2.0, freeze=1.0), settings=TrialSettings(driver="human"))
    frozen = trial.commands("shared")[40:60]
    np.testing.assert_array_equal(frozen, np.tile(trial.commands("human")[39], (20, 1)))


def test_the_same_seed_gives_the_same_faults_and_another_one_others(run):
    faults = Faults(jitter=0.3, loss=0.3, pose_noise=0.02, slip=0.2, learner_nan=0.1)
    first, again, other = (
        run(faults, settings=TrialSettings(route="left_right", seed=seed), end="reached")
        for seed in (1, 1, 2)
    )
    for name, values in first.columns.items():
        np.testing.assert_array_equal(again[name], values)
    assert not np.array_equal(first["seen_x"][:50], other["seen_x"][:50])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"delay": -0.1}, "delay must be a finite number, not negative"),
        ({"jitter": float("nan")}, "jitter must be a finite number"),
        ({"delay": 3.0}, "delay must be at most 2 s, got 3"),
        ({"loss": 1.5}, "loss must be at most 1, got 1.5"),
        ({"freeze_time": 2.0}, "freeze_time"),
        ({"loss": 1.0, "delay": 0.1}, "delay"),
        ({"human_nan": 1.0, "loss": 0.1}, "loss"),
        ({"pose_nan": 1.0, "pose_drift": 0.1}, "pose_drift"),
        ({"learner_nan": 1.0, "late_learner": 0.1}, "late_learner"),
        ({"pose_noise": 1e308}, "pose_noise must be at most 1000"),
    ],
)
def test_faults_that_make_no_sense_are_refused(given, said):
    with pytest.raises(InputError, match=said):
        Faults(**given)


def test_faults_of_someone_who_takes_no_part_are_refused():
    Faults(delay=0.1, learner_nan=0.1).check_driver("shared")
    with pytest.raises(InputError, match="late_learner"):
        Faults(late_learner=0.1).check_driver("human")
    with pytest.raises(InputError, match="delay"):
        Faults(delay=0.1).check_driver("agent")
    with pytest.raises(InputError, match="freeze_time must be before the end of the trial at 15 s"):
        Faults(freeze_time=15.0, freeze=1.0).check_duration(15.0)
