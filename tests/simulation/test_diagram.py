"""The loop as a diagram: its graph, what it takes as operator and learner, and that nothing lags."""

import re

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, DiscreteStateIndex, LeafSystem

from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import motion, speeds_after
from drake_shared.simulation.config import SharedControlConfig, config_for
from drake_shared.simulation.diagram import AddSharedControl, MakeSharedControlDiagram
from drake_shared.simulation.log import log_columns
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.intention import empty_intention
from drake_shared.systems.recorded_input import RecordedInput

NAMES = (
    "operator",
    "intention_estimator",
    "waypoint_controller",
    "confidence_blender",
    "diff_drive_plant",
    "scene_graph",
    "log_sink",
)


class Follower(LeafSystem):
    """An operator of someone's own: it sees all that the loop offers, and lets go as the agent takes over."""

    log_columns = {"seen": ("seen_weight", "seen_left", "seen_right")}  # noqa: RUF012

    def __init__(self, period: float = 0.05):
        super().__init__()
        self.DeclareVectorInputPort("pose", 3)
        self.DeclareVectorInputPort("human_weight", 1)
        self.DeclareVectorInputPort("shared_command", 2)
        self.DeclareDiscreteState(2)
        self.DeclareDiscreteState(3)
        self.DeclareStateOutputPort("human_command", DiscreteStateIndex(0))
        self.DeclareStateOutputPort("seen", DiscreteStateIndex(1))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context, state):
        weight = self.GetInputPort("human_weight").Eval(context)
        state.set_value(0, 2.0 + 3.0 * np.repeat(weight, 2))
        state.set_value(1, [*weight, *self.GetInputPort("shared_command").Eval(context)])


class Mute(LeafSystem):
    """An operator with the one port that it must have."""

    def __init__(self):
        super().__init__()
        self.DeclareDiscreteState([3.0, 4.0])
        self.DeclareStateOutputPort("human_command", DiscreteStateIndex(0))


def wiring(diagram) -> set[tuple[str, str]]:
    """The connections of a diagram's graph, as pairs of "system.port"."""
    graph = diagram.GetGraphvizString()
    names, ports = {}, {}
    for node, body in re.findall(r"(s\d+) \[shape=none.*?label=<(.*?)>\];", graph, re.DOTALL):
        names[node] = re.search(r"name=(\S+)", body)[1]
        for port, label in re.findall(r'PORT="([uy]\d+)"[^>]*>([^<]+)</TD>', body):
            ports[f"{node}:{port}"] = label
    edges = re.findall(r"(s\d+):(y\d+):e -> (s\d+):(u\d+):w", graph)
    return {(f"{names[a]}.{ports[f'{a}:{y}']}", f"{names[b]}.{ports[f'{b}:{u}']}") for a, y, b, u in edges}


def test_the_graph_reads_like_the_figure(scenario):
    edges = wiring(MakeSharedControlDiagram(scenario))
    assert edges >= {
        ("diff_drive_plant.pose", "operator.pose"),
        ("diff_drive_plant.pose", "intention_estimator.pose"),
        ("diff_drive_plant.pose", "waypoint_controller.pose"),
        ("intention_estimator.intention", "waypoint_controller.intention"),
        ("intention_estimator.confidence", "confidence_blender.confidence"),
        ("operator.human_command", "confidence_blender.human_command"),
        ("operator.human_command", "intention_estimator.human_command"),
        ("waypoint_controller.autonomous_command", "confidence_blender.autonomous_command"),
        ("confidence_blender.shared_command", "diff_drive_plant.wheel_command"),
        ("scene_graph.query", "diff_drive_plant.geometry_query"),
    }
    into_plant = {edge for edge in edges if edge[1].startswith("diff_drive_plant.")}
    assert len(into_plant) == 2


def test_systems_are_found_by_their_names(scenario):
    diagram = MakeSharedControlDiagram(scenario)
    assert diagram.get_name() == "shared_control"
    for name in NAMES:
        assert diagram.GetSubsystemByName(name).get_name() == name


def test_joins_a_larger_diagram(scenario):
    builder = DiagramBuilder()
    parts = AddSharedControl(builder, scenario=scenario)
    builder.ExportOutput(parts.plant.GetOutputPort("pose"), "pose")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(3.0)
    assert diagram.GetOutputPort("pose").Eval(simulator.get_context())[0] > 0.2


def test_the_diagram_itself_lets_nothing_through(scenario):
    assert not MakeSharedControlDiagram(scenario).HasAnyDirectFeedthrough()


def test_takes_any_system_with_a_human_command(open_floor):
    trial = Simulation(open_floor, operator=Mute(), config=config_for(None, end="duration")).run(
        TrialSettings()
    )
    np.testing.assert_array_equal(trial.commands("human"), np.tile([3.0, 4.0], (301, 1)))
    np.testing.assert_array_equal(trial["wheel_right"][10:], 4.0)
    assert trial.metadata["operator"] == "Mute"


def test_an_operator_may_see_what_became_of_its_command_one_step_late(open_floor, route_learner):
    learner = route_learner(open_floor, variance=0.08, gain=40.0)
    simulation = Simulation(open_floor, learner=learner, operator=Follower())
    assert ("confidence_blender.human_weight", "operator.human_weight") in wiring(simulation.diagram)
    trial = simulation.run(TrialSettings())
    np.testing.assert_array_equal(trial["seen_weight"][1:], trial["human_weight"][:-1])
    np.testing.assert_array_equal(trial["seen_left"][1:], trial["shared_left"][:-1])
    np.testing.assert_allclose(trial["human_left"][1:], 2.0 + 3.0 * trial["human_weight"][:-1])


def test_columns_that_the_operator_adds_come_last(open_floor):
    simulation = Simulation(open_floor, operator=Follower())
    assert simulation.parts.columns == (*log_columns(DiffDrive()), "seen_weight", "seen_left", "seen_right")


def test_takes_any_object_with_the_learners_predict(scenario, route_learner):
    learner = route_learner(scenario, "left_left")
    diagram = MakeSharedControlDiagram(scenario, learner=learner)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(1.0)
    assert len(learner.calls) >= 20


def test_without_a_learner_the_human_drives_alone(scenario):
    trial = Simulation(scenario).run(TrialSettings())
    np.testing.assert_array_equal(trial["human_weight"], 1.0)
    np.testing.assert_array_equal(trial.commands("shared"), trial.commands("human"))
    assert np.isnan(trial.commands("autonomous")).all()


@pytest.fixture(scope="module")
def shared_trial(_two_obstacles, route_learner):
    """A trial in which both take part: the variance falls from 0.2 to 0.001 m^2 along the way."""
    variance = np.linspace(0.2, 0.001, 151)[:, None]
    learner = route_learner(_two_obstacles, "left_right", variance=variance, gain=40.0)
    simulation = Simulation(_two_obstacles, learner=learner, config=config_for("paper", end="duration"))
    return simulation.run(TrialSettings(route="left_right"))


def test_a_log_has_the_columns_of_the_contract_and_a_row_more_than_steps(shared_trial):
    assert len(shared_trial["t"]) == 301
    np.testing.assert_allclose(shared_trial["t"], 0.05 * np.arange(301), atol=1e-12)
    promised = (
        "t x y yaw human_left human_right autonomous_left autonomous_right shared_left shared_right "
        "wheel_left wheel_right confidence human_weight mean_variance clearance contact"
    )
    assert list(shared_trial.columns)[:17] == promised.split()
    assert all(len(values) == 301 for values in shared_trial.columns.values())
    assert shared_trial["contact"].dtype == bool


def test_in_each_row_the_shared_command_is_the_blend_of_both(shared_trial):
    weight = shared_trial["human_weight"][:, None]
    assert weight.min() == 0.0
    assert weight.max() > 0.7
    np.testing.assert_array_equal(weight[:, 0], 1.0 - shared_trial["confidence"])
    np.testing.assert_array_equal(
        shared_trial.commands("shared"),
        weight * shared_trial.commands("human") + (1.0 - weight) * shared_trial.commands("autonomous"),
    )


def test_each_row_follows_from_the_one_before_without_lag(shared_trial, scenario):
    """What is logged at t_k is what the plant applies from t_k on: pose and wheels follow bit for bit."""
    robot, trial = scenario.robot, shared_trial
    for k in range(300):
        pose = (trial["x"][k], trial["y"][k], trial["yaw"][k])
        wheels = (trial["wheel_left"][k], trial["wheel_right"][k])
        limit = robot.max_wheel_speed
        command = tuple(np.clip(trial.commands("shared")[k], -limit, limit).tolist())
        *_, (x, y, yaw) = motion(robot, pose, wheels, command, 0.05)
        assert (trial["x"][k + 1], trial["y"][k + 1], trial["yaw"][k + 1]) == (x, y, yaw)
        reached = speeds_after(robot, wheels, command, 0.05)
        assert (trial["wheel_left"][k + 1], trial["wheel_right"][k + 1]) == reached


def test_clearance_in_each_row_is_that_of_its_pose(shared_trial, scenario):
    gaps = [np.hypot(*(shared_trial.positions - (item.x, item.y)).T) - 0.25 for item in scenario.obstacles]
    np.testing.assert_allclose(shared_trial["clearance"], np.min(gaps, axis=0) - 0.267, atol=1e-12)


def test_contact_in_each_row_is_of_the_step_that_led_to_it(scenario):
    straight_on = RecordedInput(commands=np.full((300, 2), 6.0))
    trial = Simulation(scenario, operator=straight_on, config=config_for(None, end="duration")).run(
        TrialSettings()
    )
    first = np.flatnonzero(trial["contact"])[0]
    assert 0 < first < 300
    assert trial["clearance"][first] < 1e-5
    assert trial["clearance"][first - 1] > 1e-3
    assert np.all(trial["clearance"] >= 0)


def test_meshcat_adds_the_looks_and_the_visualizer_and_changes_no_bit(open_floor, route_learner):
    from pydrake.geometry import MeshcatParams

    from drake_shared.simulation.scene_drawing import start_quiet_meshcat

    meshcat = start_quiet_meshcat(MeshcatParams(host="localhost", show_stats_plot=False))
    open_floor.duration = 2.0
    learner = route_learner(open_floor)
    watched = Simulation(open_floor, learner=learner, meshcat=meshcat)
    edges = wiring(watched.diagram)
    assert ("intention_estimator.intention", "intention_visualizer.intention") in edges
    assert ("confidence_blender.human_weight", "intention_visualizer.human_weight") in edges
    trial, unseen = (each.run(TrialSettings()) for each in (watched, Simulation(open_floor, learner=learner)))
    for name, values in unseen.columns.items():
        np.testing.assert_array_equal(trial[name], values)
    assert meshcat.HasPath("/drake/intention/halo/human")
    assert meshcat.HasPath("/drake/scene/robot")


class Plant(LeafSystem):
    """A plant of someone's own: x is the sum of the left commands."""

    def __init__(self):
        super().__init__()
        command = self.DeclareVectorInputPort("wheel_command", 2)
        pose, speed = self.DeclareDiscreteState(3), self.DeclareDiscreteState(2)
        self.DeclareStateOutputPort("pose", pose)
        self.DeclareStateOutputPort("wheel_speed", speed)

        def update(context, state):
            pose = context.get_discrete_state(0).value()
            state.set_value(0, [pose[0] + 0.01 * command.Eval(context)[0], 0.0, 0.0])
            state.set_value(1, command.Eval(context))

        self.DeclarePeriodicDiscreteUpdateEvent(0.05, 0.0, update)


class Steady(LeafSystem):
    """A controller of someone's own, which always gives the same command."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorInputPort("pose", 3)
        self.DeclareAbstractInputPort("intention", Value(empty_intention(2)))
        self.DeclareVectorOutputPort("autonomous_command", 2, lambda _, out: out.set_value([2.0, 2.0]))


class Curious(Mute):
    """An operator with an input that the loop does not have."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorInputPort("lidar", 8)


def test_takes_a_plant_and_a_controller(open_floor, route_learner):
    simulation = Simulation(
        open_floor,
        learner=route_learner(open_floor),
        operator=Mute(),
        plant=Plant(),
        controller=Steady(),
        config=SharedControlConfig(arbitration="halves"),
    )
    trial = simulation.run(TrialSettings())
    np.testing.assert_array_equal(trial.commands("autonomous"), 2.0)
    np.testing.assert_allclose(np.diff(trial["x"]), 0.01 * trial["shared_left"][:-1])
    np.testing.assert_array_equal(trial["clearance"], np.inf)
    assert not trial["contact"].any()


@pytest.mark.parametrize(
    ("role", "system", "port"),
    [
        ("plant", Mute(), "command"),
        ("controller", Mute(), "pose"),
        ("operator", Plant(), "human_command"),
        ("operator", Curious(), "lidar"),
        ("arbiter", Mute(), "human_command"),
    ],
)
def test_a_system_with_the_wrong_ports_is_refused_by_name(scenario, role, system, port):
    with pytest.raises(InputError, match=rf"{role}.*{type(system).__name__}.*{port}"):
        MakeSharedControlDiagram(scenario, **{role: system})


def test_two_loops_fit_in_one_builder_under_two_prefixes(scenario, route_learner):
    builder = DiagramBuilder()
    loops = {
        prefix: AddSharedControl(
            builder,
            scenario=scenario,
            learner=route_learner(scenario),
            config=SharedControlConfig(driver=driver),
            prefix=prefix,
        )
        for prefix, driver in (("left_", "human"), ("right_", "agent"))
    }
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(1.0)
    weights = [parts.log_sink.FindLog(simulator.get_context()).data()[12] for parts in loops.values()]
    assert loops["left_"].columns[12] == "human_weight"
    np.testing.assert_array_equal(weights[0], 1.0)
    np.testing.assert_array_equal(weights[1][1:], 0.0)


def test_two_loops_of_the_same_names_are_refused(scenario):
    builder = DiagramBuilder()
    AddSharedControl(builder, scenario=scenario)
    with pytest.raises(InputError, match="prefix"):
        AddSharedControl(builder, scenario=scenario)


def test_the_diagram_exports_what_happens_in_the_loop(scenario, route_learner):
    diagram = MakeSharedControlDiagram(scenario, learner=route_learner(scenario))
    simulator = Simulator(diagram)
    simulator.AdvanceTo(2.0)
    values = {
        name: diagram.GetOutputPort(name).Eval(simulator.get_context())
        for name in ("pose", "human_command", "autonomous_command", "shared_command", "human_weight")
    }
    assert values["pose"][0] > 0.1
    weight = values["human_weight"].item()
    blend = weight * values["human_command"] + (1 - weight) * values["autonomous_command"]
    np.testing.assert_allclose(values["shared_command"], blend)
