"""The base class of arbiters: its ports, who drives, and what it refuses while it runs."""

import dataclasses

import numpy as np
import pytest
from pydrake.systems.framework import LeafSystem

from drake_shared.arbitration.authority import Authority
from drake_shared.common.errors import InputError, RunError
from drake_shared.robots import DiffDrive
from drake_shared.simulation import MakeSharedControlDiagram
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.constant_weight_blender import ConstantWeightBlender
from drake_shared.systems.traded_control import TradedControl


@dataclasses.dataclass(kw_only=True)
class PointRobot(DiffDrive):
    """A point in space that is commanded by its velocity."""

    configuration_names = ("x", "y", "z")
    position_names = ("x", "y", "z")
    command_names = ("vx", "vy", "vz")
    command_units = ("m/s", "m/s", "m/s")
    command_limits = (1.0, 1.0, 1.0)
    speed_names = ("speed_x", "speed_y", "speed_z")

    def position(self, configuration):
        return tuple(configuration)

    def speed(self, command):
        return float(np.linalg.norm(command))

    def rollout(self, configuration, command, horizon):
        return tuple(np.add(configuration, np.multiply(horizon, command)))

    def command_toward(self, configuration, target, duration):
        return tuple(np.subtract(target, configuration) / duration)

    def stick_command(self, forward, left, *, max_speed, max_yaw_rate):
        return max_speed * forward, max_speed * left, 0.0

    def conflict_angle(self, a, b):
        lengths = np.linalg.norm(a) * np.linalg.norm(b)
        return float(np.arccos(np.clip(np.dot(a, b) / lengths, -1, 1))) if lengths > 0 else np.nan


class Timid(Arbiter):
    """The human drives alone near obstacles."""

    def __init__(self, **options):
        super().__init__(optional_inputs=self.OPTIONAL_INPUTS, **options)

    def DoCalcWeight(self, context):
        return 1.0 if self.GetInputPort("clearance").Eval(context).item() < 0.3 else 0.25


class Wrong(Arbiter):
    """Returns what a weight must not be from 2 s on."""

    def __init__(self, weight):
        super().__init__()
        self._weight = weight

    def DoCalcWeight(self, context):
        return self._weight if context.get_time() >= 2.0 else 0.5


class WrongCommand(Arbiter):
    """Gives a command that it must not give from 2 s on."""

    def __init__(self, command):
        super().__init__()
        self._command = command

    def DoCalcWeight(self, context):
        return 0.5

    def DoCalcCommand(self, context, weight, human, autonomous):
        return self._command if context.get_time() >= 2.0 else human


class Foreign(LeafSystem):
    """The ports of an arbiter without its base class."""

    def __init__(self, weight=0.5, command=1.0):
        super().__init__()
        for name, size in (("human_command", 2), ("autonomous_command", 2), ("confidence", 1)):
            self.DeclareVectorInputPort(name, size)

        def from_2_s(context, output, value):
            output.set_value(np.full(output.size(), value if context.get_time() >= 2.0 else 0.5))

        self.DeclareVectorOutputPort("human_weight", 1, lambda c, out: from_2_s(c, out, weight))
        self.DeclareVectorOutputPort("shared_command", 2, lambda c, out: from_2_s(c, out, command))


def fixed(dut, human, autonomous, confidence=0.75):
    context = dut.CreateDefaultContext()
    dut.get_human_command_input_port().FixValue(context, human)
    dut.get_autonomous_command_input_port().FixValue(context, autonomous)
    dut.get_confidence_input_port().FixValue(context, [confidence])
    return context


@pytest.mark.parametrize(
    "make",
    [
        ConfidenceBlender,
        ConstantWeightBlender,
        TradedControl,
        lambda **options: ConfidenceBlender(authority=Authority(), initial_idle_time=0.0, **options),
    ],
)
@pytest.mark.parametrize("driver", ["human", "agent"])
def test_any_arbiter_leaves_either_driver_alone_for_commands_of_any_size(make, driver):
    dut = make(robot=PointRobot(), driver=driver)
    human, agent = [0.1, 0.2, 0.3], [0.3, -0.1, 0.0]
    context = fixed(dut, human, agent)
    assert dut.GetDriver(context) == driver
    command = dut.get_shared_command_output_port().Eval(context)
    np.testing.assert_array_equal(command, human if driver == "human" else agent)
    assert dut.get_human_weight_output_port().Eval(context).item() == (driver == "human")
    dut.SetDriver(context, "shared")
    shared = dut.get_shared_command_output_port().Eval(context)
    assert not np.array_equal(shared, command) or isinstance(dut, TradedControl)


def test_the_agent_does_not_drive_before_anyone_was_there(step):
    dut = ConfidenceBlender(authority=Authority())
    context = fixed(dut, [0.0, 0.0], [6.0, 6.0], 1.0)
    for _ in range(40):
        np.testing.assert_array_equal(dut.get_shared_command_output_port().Eval(context), 0.0)
        assert dut.release_reason(context) == "hands_off"
        step(dut, context)
    dut.get_human_command_input_port().FixValue(context, [3.0, 3.0])
    for _ in range(40):
        step(dut, context)
    assert dut.get_human_weight_output_port().Eval(context).item() == pytest.approx(0.1)


@pytest.mark.parametrize("confidence", [-0.01, 1.01, np.inf])
def test_a_confidence_out_of_range_is_refused_by_the_name_of_the_input(confidence):
    dut = ConfidenceBlender()
    context = fixed(dut, [1.0, 2.0], [3.0, 2.0], confidence)
    with pytest.raises(RunError, match="confidence"):
        dut.get_human_weight_output_port().Eval(context)


def test_forced_and_periodic_updates_are_the_same():
    dut = ConfidenceBlender(authority=Authority())
    context = fixed(dut, [1.0, 2.0], [3.0, 2.0])
    forced = dut.AllocateDiscreteVariables()
    dut.CalcForcedDiscreteVariableUpdate(context, forced)
    periodic = dut.EvalUniquePeriodicDiscreteUpdate(context)
    np.testing.assert_array_equal(forced.value(0), periodic.value(0))
    assert not np.array_equal(forced.value(0), context.get_discrete_state_vector().value())


def test_optional_inputs_are_connected(scenario, route_learner):
    learner = route_learner(scenario, variance=1e-5)
    trial = Simulation(scenario, learner=learner, arbiter=Timid()).run(TrialSettings(route="left_right"))
    near = trial["clearance"] < 0.3
    assert 0.1 < near.mean() < 0.9
    np.testing.assert_array_equal(trial["human_weight"], np.where(near, 1.0, 0.25))


@pytest.mark.parametrize(
    ("arbiter", "said"),
    [
        (Wrong(7.0), "Wrong.*human_weight.*7"),
        (Wrong(-0.25), "Wrong.*human_weight.*-0.25"),
        (Wrong(np.nan), "Wrong.*human_weight.*nan"),
        (Wrong(None), "Wrong.*TypeError"),
        (WrongCommand([np.nan, 0.0]), "WrongCommand.*shared_command.*nan"),
        (WrongCommand([0.0, 0.0, 0.0]), "WrongCommand.*size"),
        (Foreign(weight=1.5), "Foreign.*human_weight.*1.5"),
        (Foreign(weight=-0.25), "Foreign.*human_weight.*-0.25"),
        (Foreign(weight=np.nan), "Foreign.*human_weight.*nan"),
        (Foreign(command=np.nan), "Foreign.*shared_command.*nan"),
    ],
)
def test_an_output_out_of_range_ends_the_trial_with_the_systems_name_and_the_time(
    scenario, route_learner, arbiter, said
):
    simulation = Simulation(scenario, learner=route_learner(scenario), arbiter=arbiter)
    with pytest.raises(RunError, match=rf"{said}.*t = 2\.0"):
        simulation.run(TrialSettings(route="left_right"))


class FromTheStart(WrongCommand):
    """Fails at once."""

    def DoCalcCommand(self, context, weight, human, autonomous):
        return self._command


class WithInput(WrongCommand):
    """Has an input that no diagram connects."""

    def __init__(self):
        super().__init__([0.0, 0.0])
        self.DeclareVectorInputPort("lidar", 5)


class FromTheStartWeight(Wrong):
    """Fails at once."""

    def DoCalcWeight(self, context):
        return self._weight


@pytest.mark.parametrize(
    ("arbiter", "field"),
    [
        (FromTheStart([np.inf, 0.0]), "shared_command"),
        (FromTheStart(None), "shared_command"),
        (FromTheStartWeight(-1.0), "human_weight"),
        (FromTheStartWeight("half"), "human_weight"),
        (WithInput(), "lidar"),
    ],
)
def test_an_arbiter_that_breaks_the_contract_is_refused_when_it_is_wired(scenario, arbiter, field):
    with pytest.raises(InputError) as caught:
        MakeSharedControlDiagram(scenario, arbiter=arbiter)
    assert caught.value.field == field


def test_a_system_is_named_after_its_class():
    assert ConfidenceBlender().get_name() == "confidence_blender"
    assert Timid().get_name() == "timid"


def test_an_error_names_the_arbiter_and_its_type():
    dut = Wrong(7.0)
    dut.set_name("left_arm")
    context = fixed(dut, [0.0, 0.0], [0.0, 0.0])
    context.SetTime(2.0)
    with pytest.raises(RunError, match=r"left_arm \(Wrong\)"):
        dut.get_human_weight_output_port().Eval(context)


@pytest.mark.parametrize("driver", ["human", "agent"])
def test_an_arbiter_that_is_no_subclass_leaves_either_driver_alone(scenario, route_learner, driver):
    simulation = Simulation(scenario, learner=route_learner(scenario), arbiter=Foreign())
    trial = simulation.run(TrialSettings(route="left_right", driver=driver))
    alone = trial.commands("human" if driver == "human" else "autonomous")
    np.testing.assert_array_equal(trial.commands("shared"), alone)
    np.testing.assert_array_equal(trial["human_weight"], float(driver == "human"))


@pytest.mark.parametrize("options", [{"period": -1.0}, {"period": np.nan}, {"driver": "both"}])
def test_bad_arguments_are_refused(options):
    with pytest.raises(InputError, match=next(iter(options))):
        ConfidenceBlender(**options)


def test_options_reach_the_arbiter_and_unknown_ones_are_refused(scenario, route_learner):
    learner = route_learner(scenario)
    parts = Simulation(
        scenario, learner=learner, config=SharedControlConfig(arbitration="traded:threshold=0.7")
    ).parts
    assert parts.arbitration["configuration"] == {"threshold": 0.7, "margin": 0.05}
    for text, named in (("traded:treshold=0.7", "threshold"), ("blend:floor=1", "blend")):
        with pytest.raises(InputError, match=named):
            Simulation(scenario, learner=learner, config=SharedControlConfig(arbitration=text))
    with pytest.raises(InputError, match="threshold"):
        Simulation(scenario, learner=learner, config=SharedControlConfig(arbitration="traded:threshold=2"))
