"""Drake's forced updates do what the periodic ones do, and a Simulator does not run them twice."""

import math

import numpy as np
import pytest
from pydrake.geometry import SceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_shared.arbitration.authority import Authority
from drake_shared.common.errors import InputError
from drake_shared.learners.no_learner import NoLearner
from drake_shared.robots import Arm, DiffDrive
from drake_shared.systems.arm_plant import ArmPlant
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.dynamic_arm_plant import DynamicArmPlant
from drake_shared.systems.dynamic_plant import DynamicPlant
from drake_shared.systems.hindsight_optimization import HindsightOptimization
from drake_shared.systems.intention_estimator import IntentionEstimator
from drake_shared.systems.leader_follower import LeaderFollower
from drake_shared.systems.mouse_input import MouseInput, MouseSample
from drake_shared.systems.posterior_fusion import PosteriorFusion
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.surrogate_operator import SurrogateOperator
from drake_shared.systems.traded_control import TradedControl

ROBOT = DiffDrive()


class Pushed:
    """A driver who holds the stick forward."""

    def latest(self) -> MouseSample:
        return MouseSample(engaged=True, engagement=1, forward=0.5, arrival=0.0)


SYSTEMS = {
    "plant": lambda scenario, learner: DiffDrivePlant(robot=ROBOT),
    "dynamic_plant": lambda scenario, learner: DynamicPlant(robot=ROBOT),
    "estimator": lambda scenario, learner: IntentionEstimator(learner=learner),
    "surrogate": lambda scenario, learner: SurrogateOperator(scenario=scenario),
    "recorded": lambda scenario, learner: RecordedInput(commands=[[1.0, 2.0], [3.0, 4.0]]),
    "mouse": lambda scenario, learner: MouseInput(robot=ROBOT, source=Pushed(), clock=lambda: 0.0),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_forced_update_is_the_periodic_one(name, scenario, route_learner):
    dut = SYSTEMS[name](scenario, route_learner(scenario, clock="progress"))
    context = dut.CreateDefaultContext()
    for index in range(dut.num_input_ports()):
        port = dut.get_input_port(index)
        if port.get_name() != "geometry_query":
            port.FixValue(context, np.full(port.size(), 0.7))
    before = [group.value().copy() for group in _groups(context.get_discrete_state())]
    forced = dut.AllocateDiscreteVariables()
    dut.CalcForcedDiscreteVariableUpdate(context, forced)
    periodic = dut.EvalUniquePeriodicDiscreteUpdate(context)
    for one, other in zip(_groups(forced), _groups(periodic), strict=True):
        np.testing.assert_array_equal(one.value(), other.value())
    changed = [not np.array_equal(old, new.value()) for old, new in zip(before, _groups(forced), strict=True)]
    assert any(changed)


def _groups(values):
    return [values.get_vector(index) for index in range(values.num_groups())]


@pytest.mark.parametrize(
    ("make", "period"),
    [
        (lambda scenario: DiffDrivePlant(robot=ROBOT), 0.05),
        (lambda scenario: DynamicPlant(robot=ROBOT), 0.05),
        (lambda scenario: ArmPlant(robot=Arm(), scene_graph=SceneGraph()), 0.05),
        (lambda scenario: DynamicArmPlant(robot=Arm(), scene_graph=SceneGraph()), 0.05),
        (lambda scenario: IntentionEstimator(learner=NoLearner(15.0)), 0.05),
        (lambda scenario: RecordedInput(), 0.05),
        (lambda scenario: MouseInput(robot=ROBOT, source=Pushed()), 0.005),
        (lambda scenario: ConfidenceBlender(authority=Authority()), 0.05),
        (lambda scenario: TradedControl(), 0.05),
        (lambda scenario: LeaderFollower(), 0.05),
        (lambda scenario: PosteriorFusion(scenario=scenario), 0.05),
        (lambda scenario: HindsightOptimization(scenario=scenario), 0.05),
    ],
)
def test_systems_step_with_the_control_by_default_and_the_mouse_ten_times_as_often(open_floor, make, period):
    timing = make(open_floor).GetUniquePeriodicDiscreteUpdateAttribute()
    assert (timing.period_sec(), timing.offset_sec()) == (period, 0.0)


def test_a_simulator_updates_once_a_period():
    builder = DiagramBuilder()
    rows = np.arange(20.0).reshape(10, 2)
    operator = builder.AddSystem(RecordedInput(commands=rows, period=0.1))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.45)
    context = operator.GetMyContextFromRoot(simulator.get_context())
    np.testing.assert_array_equal(operator.get_human_command_output_port().Eval(context), rows[5])


@pytest.mark.parametrize("period", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("name", ["plant", "estimator", "recorded", "mouse"])
def test_a_period_out_of_range_is_refused(name, period, scenario, route_learner):
    makers = {
        "plant": lambda: DiffDrivePlant(robot=ROBOT, period=period),
        "estimator": lambda: IntentionEstimator(learner=route_learner(scenario), period=period),
        "recorded": lambda: RecordedInput(period=period),
        "mouse": lambda: MouseInput(robot=ROBOT, source=Pushed(), period=period),
    }
    with pytest.raises(InputError) as caught:
        makers[name]()
    assert caught.value.field == "period"
