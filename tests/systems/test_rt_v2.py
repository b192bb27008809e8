"""Robot-Trajectron's rule as an arbiter of the diagram."""

import dataclasses
import math

import numpy as np
import pytest
from pydrake.common.value import Value

from drake_shared.common.errors import InputError
from drake_shared.learners import Modes, load_learner
from drake_shared.learners.mixture.learner import MixtureLearner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.robots import DiffDrive
from drake_shared.scenario import load_scenario
from drake_shared.scenario.obstacles import Circle
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.lockstep.support import unsupported
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.intention import Intention
from drake_shared.systems.rt_v2 import RobotTrajectron

ROBOT = DiffDrive()
SCENARIO = load_scenario("two_obstacles")
CONFIG = SharedControlConfig(arbitration="rt-v2")


@pytest.fixture(scope="module")
def mixture():
    """An expert for each route, made of the shipped learner without training."""
    cnmp = load_learner("two_obstacles")
    experts = tuple(
        dataclasses.replace(cnmp, demonstrations=cnmp.demonstrations[route : route + 1], weights=np.ones(1))
        for route in range(3)
    )
    return MixtureLearner(
        experts=experts,
        shares=np.full(3, 1 / 3),
        leanings=np.ones(3),
        noise=0.1,
        confidence_gain=cnmp.confidence_gain,
        metadata=cnmp.metadata,
    )


def test_a_driver_is_brought_to_the_goal_and_keeps_a_share(mixture):
    simulation = Simulation(SCENARIO, learner=mixture, config=CONFIG)
    trial = simulation.run(TrialSettings(route="left_left", behaviour=Behaviour()))
    assert trial.status == "reached"
    weight = trial["human_weight"]
    assert ((weight >= 0.0) & (weight <= 1.0)).all()
    assert 0.0 < weight.mean() < 1.0
    assert trial.metadata["arbitration"]["configuration"] == {
        "look_ahead": 0.6,
        "command_variance": 0.05,
        "least_variance": 0.03,
    }


def test_a_learner_without_modes_is_refused():
    simulation = Simulation(SCENARIO, learner=load_learner("two_obstacles"), config=CONFIG)
    with pytest.raises(InputError) as caught:
        simulation.run(TrialSettings())
    assert caught.value.field == "learner"
    assert "\n" not in str(caught.value)


def test_it_runs_in_drake(mixture):
    assert unsupported(Simulation(SCENARIO, learner=mixture, config=CONFIG)) == "arbiter rt-v2"


@pytest.fixture
def dut(open_floor):
    return RobotTrajectron(scenario=open_floor)


GRID = np.arange(21) * 0.1


def step_of(
    dut, *modes, probability=(1.0,), time=0.35, pose=(0.0, 0.0, 0.0), human=(5.0, 4.0), variance=1e-4
):
    """w and the command, for modes that rest at the positions ``modes``, and without another agent."""
    first = min(int(GRID.searchsorted(time, side="right")), len(GRID) - 1)
    mean = np.repeat(np.array(modes, dtype=float)[:, None], len(GRID) - first, axis=1)
    spread = np.broadcast_to(variance, mean.shape).astype(float)
    predicted = Modes(probability=np.array(probability), mean=mean, variance=spread, aim=0) if modes else None
    whole = np.zeros((len(GRID), 2))
    intention = Intention(time=time, times=GRID, mean=whole, variance=whole, first=first, modes=predicted)
    context = dut.CreateDefaultContext()
    values = {
        "human_command": human,
        "autonomous_command": [1.0, 1.0],
        "confidence": [0.5],
        "pose": pose,
        "intention": Value(intention),
    }
    for name, value in values.items():
        dut.GetInputPort(name).FixValue(context, value)
    weight, command = (dut.GetOutputPort(name).Eval(context) for name in ("human_weight", "shared_command"))
    return weight.item(), command.copy()


def test_the_velocity_of_the_mode_is_corrected_by_the_command(dut):
    # The first query at least 0.6 s from now is that at 1.0 s.
    time = 1.0 - 0.35
    pose = (0.5, 0.2, 0.3)
    variance = np.array([0.08 * time**2, 0.001])
    weight, command = step_of(dut, (0.9, 0.4), pose=pose, variance=variance)
    # K = s / (s + R); a variance of less than 0.03 m^2/s^2 counts as that.
    share = np.array([0.08, 0.03]) / (np.array([0.08, 0.03]) + 0.05)
    led = np.array(ROBOT.rollout(pose, (5.0, 4.0), time))
    target = share * led + (1.0 - share) * [0.9, 0.4]
    assert weight == pytest.approx(share.mean())
    np.testing.assert_allclose(command, ROBOT.command_toward(pose, target.tolist(), time))


def test_at_the_end_of_the_prediction_its_last_position_counts(dut):
    weight, command = step_of(dut, (0.3, 0.1), time=1.7)
    assert 0.0 < weight < 1.0
    share = weight
    target = share * np.array(ROBOT.rollout((0.0, 0.0, 0.0), (5.0, 4.0), 0.3)) + (1.0 - share) * np.array(
        [0.3, 0.1]
    )
    np.testing.assert_allclose(command, ROBOT.command_toward((0.0, 0.0, 0.0), target.tolist(), 0.3))
    last, command = step_of(dut, (0.3, 0.1), time=2.0)
    assert 0.0 <= last <= 1.0
    assert np.isfinite(command).all()


@pytest.mark.parametrize(("probability", "turns_left"), [((0.6, 0.4), True), ((0.4, 0.6), False)])
def test_the_more_probable_mode_is_taken_and_a_command_toward_the_other_one_can_change_that(
    dut, probability, turns_left
):
    modes = (0.3, 0.3), (0.3, -0.3)
    _, (left, right) = step_of(dut, *modes, probability=probability, human=(0.0, 0.0))
    assert (right > left) == turns_left
    _, (left, right) = step_of(dut, *modes, probability=probability, human=(2.0, 5.0))
    assert right > left


@pytest.mark.parametrize(("gap", "taken"), [(0.07, 0), (-0.02, 1)])
def test_a_mode_that_leads_into_an_obstacle_is_not_taken_and_5_cm_beside_the_body_are_enough(
    open_floor, gap, taken
):
    """Both modes are where the driver stays at rest too; the first one is the more probable."""
    near = np.array([1.0, 0.1])
    distance = 0.3 + ROBOT.footprint_radius + gap
    open_floor.obstacles = [Circle(name="pillar", x=1.0 + distance, y=0.1, radius=0.3)]
    dut = RobotTrajectron(scenario=open_floor)
    # The corrected mode lies 5/8 of the way from where the robot stands to the mode.
    here = np.array([0.9, 0.0])
    modes = [here + (place - here) / 0.625 for place in (near, np.array([0.7, 0.3]))]
    _, command = step_of(dut, *modes, probability=(0.6, 0.4), pose=(*here, 0.0), human=(0.0, 0.0))
    expected = (near, np.array([0.7, 0.3]))[taken]
    np.testing.assert_allclose(
        command, ROBOT.command_toward((*here, 0.0), expected.tolist(), 0.65), atol=1e-9
    )


@pytest.mark.parametrize(
    "change", [{"pose": (math.nan, 0.0, 0.0)}, {"human": (math.nan, 1.0)}, {"modes": ()}]
)
def test_without_a_pose_a_command_or_modes_the_human_drives(dut, change):
    modes = change.pop("modes", [(0.3, 0.1)])
    weight, command = step_of(dut, *modes, **change)
    assert weight == 1.0
    np.testing.assert_array_equal(command, (0.0, 0.0) if "human" in change else (5.0, 4.0))


def test_modes_that_are_nan_are_left_out(dut):
    nan = (math.nan, math.nan)
    assert step_of(dut, nan)[0] == 1.0
    alone = step_of(dut, (0.3, 0.1))
    for modes in ([(0.3, 0.1), nan], [nan, (0.3, 0.1)]):
        weight, command = step_of(dut, *modes, probability=(0.5, 0.5))
        assert weight == alone[0]
        np.testing.assert_array_equal(command, alone[1])
