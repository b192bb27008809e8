"""The systems, wired: the shared-control loop of Fig. 1 of Amirshirzad et al. 2022 as one Diagram."""

from __future__ import annotations

import dataclasses
from typing import Any

from pydrake.common import RandomDistribution
from pydrake.geometry import Meshcat, MeshcatVisualizer, MeshcatVisualizerParams, Role, SceneGraph
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import Multiplexer, RandomSource, VectorLogSink

from drake_shared.arbitration.authority import Authority
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.learners.no_learner import NoLearner
from drake_shared.scenario import Scenario
from drake_shared.scenario.obstacles import register_obstacles
from drake_shared.simulation.fault_injection import FaultInjection
from drake_shared.simulation.faults import Faults
from drake_shared.systems.arbiters import DEFAULT, check_arbiter, describe_arbiter, make_arbiter
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.dynamic_plant import DynamicPlant
from drake_shared.systems.intention_estimator import IntentionEstimator
from drake_shared.systems.intention_visualizer import IntentionVisualizer
from drake_shared.systems.moving_obstacles import AddMovingObstacles
from drake_shared.systems.safety_filter import SafetyFilter
from drake_shared.systems.surrogate_operator import SurrogateOperator
from drake_shared.systems.waypoint_controller import WaypointController

LOG_COLUMNS = (
    *("x", "y", "yaw"),
    *("human_left", "human_right"),
    *("autonomous_left", "autonomous_right"),
    *("shared_left", "shared_right"),
    *("wheel_left", "wheel_right"),
    *("confidence", "human_weight", "mean_variance", "clearance", "contact"),
    *("moved_by_pose", "moved_by_command"),
)
# What the robot is told, if a safety filter stands between.
SAFETY_COLUMNS = ("safe_left", "safe_right")


@dataclasses.dataclass(frozen=True, kw_only=True)
class SharedControl:
    """The parts of a shared-control loop in a diagram.

    Attributes:
        operator: The human input source.
        estimator: Predicts where the person is heading.
        controller: Steers the way predicted.
        blender: Divides the control.
        arbitration: Its name and its whole configuration, as a log keeps them.
        plant: The robot: a :class:`DynamicPlant` if the scenario's ``plant`` is dynamic.
        scene_graph: Holds the obstacles.
        log_sink: Logs ``columns``, one row a control period.
        columns: Names of the logged values; those that operator, safety filter and faults add come last.
        safety_filter: Keeps the robot clear of obstacles, if asked for.
    """

    operator: LeafSystem
    estimator: IntentionEstimator
    controller: WaypointController
    blender: LeafSystem
    arbitration: dict[str, Any]
    plant: DiffDrivePlant
    scene_graph: SceneGraph
    log_sink: VectorLogSink
    columns: tuple[str, ...]
    safety_filter: SafetyFilter | None = None


def AddSharedControl(
    builder: DiagramBuilder,
    *,
    scenario: Scenario,
    learner: Learner | None = None,
    operator: LeafSystem | None = None,
    arbiter: LeafSystem | str = DEFAULT,
    authority: Authority | bool | None = None,
    look_ahead: float = 0.6,
    safety_clearance: float | None = None,
    faults: Faults | None = None,
    meshcat: Meshcat | None = None,
) -> SharedControl:
    """Adds the whole loop to ``builder``; :func:`MakeSharedControlDiagram` says what the arguments mean."""
    period = scenario.control_period
    operator = operator or SurrogateOperator(scenario=scenario)
    preset = None if learner is None else learner.preset
    learner = learner or NoLearner(scenario.duration)

    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    register_obstacles(scene_graph, scenario.static_obstacles)
    AddMovingObstacles(builder, scene_graph, scenario.obstacles)
    operator = builder.AddNamedSystem("operator", operator)
    estimator = builder.AddNamedSystem(
        "intention_estimator", IntentionEstimator(learner=learner, robot=scenario.robot, period=period)
    )
    controller = builder.AddNamedSystem(
        "waypoint_controller", WaypointController(robot=scenario.robot, look_ahead=look_ahead)
    )
    if isinstance(arbiter, str):
        blender = make_arbiter(arbiter, scenario, preset=preset, authority=authority)
        arbitration = describe_arbiter(blender, arbiter)
    else:
        if authority is not None:
            raise InputError("authority", "", "must be left out where a system divides the control")
        blender = arbiter
        check_arbiter(blender, type(blender).__name__)
        arbitration = describe_arbiter(blender)
    known = "confidence_blender" if isinstance(blender, ConfidenceBlender) else "arbiter"
    blender = builder.AddNamedSystem(known, blender)
    # The looks of the robot cost time in every step, and serve only those who look.
    plant = builder.AddNamedSystem("diff_drive_plant", _plant(scenario, scene_graph if meshcat else None))
    pose = plant.GetOutputPort("pose")
    human = operator.GetOutputPort("human_command")
    autonomous = controller.GetOutputPort("autonomous_command")
    shared = blender.GetOutputPort("shared_command")
    weight = blender.GetOutputPort("human_weight")
    injected = FaultInjection(builder, faults, period)
    received = injected.channel(human)
    seen, shown_pose = injected.pose(pose)
    intention, confidence = injected.learner(
        estimator.GetOutputPort("intention"), estimator.GetOutputPort("confidence")
    )

    builder.Connect(seen, estimator.GetInputPort("pose"))
    builder.Connect(received, estimator.GetInputPort("human_command"))
    builder.Connect(seen, controller.GetInputPort("pose"))
    builder.Connect(intention, controller.GetInputPort("intention"))
    builder.Connect(received, blender.GetInputPort("human_command"))
    builder.Connect(autonomous, blender.GetInputPort("autonomous_command"))
    builder.Connect(confidence, blender.GetInputPort("confidence"))
    if blender.HasInputPort("idle_time") and operator.HasOutputPort("idle_time"):
        builder.Connect(operator.GetOutputPort("idle_time"), blender.GetInputPort("idle_time"))
    safety_filter, applied = None, shared
    if safety_clearance is not None:
        safety_filter = builder.AddNamedSystem(
            "safety_filter",
            SafetyFilter(
                robot=scenario.robot,
                clearance=safety_clearance,
                period=period,
                obstacles=scenario.obstacles,
            ),
        )
        builder.Connect(seen, safety_filter.GetInputPort("pose"))
        builder.Connect(plant.GetOutputPort("wheel_speed"), safety_filter.GetInputPort("wheel_speed"))
        builder.Connect(shared, safety_filter.GetInputPort("wheel_command"))
        builder.Connect(scene_graph.get_query_output_port(), safety_filter.GetInputPort("geometry_query"))
        applied = safety_filter.GetOutputPort("safe_command")
    builder.Connect(injected.wheels(applied), plant.GetInputPort("wheel_command"))
    builder.Connect(scene_graph.get_query_output_port(), plant.GetInputPort("geometry_query"))
    # The operator's command is state, so what it reads of the loop reaches it one step late.
    offered = {"pose": shown_pose, "human_weight": weight, "shared_command": shared}
    for name, port in offered.items():
        if operator.HasInputPort(name):
            builder.Connect(port, operator.GetInputPort(name))
    # Chance last: what a seed draws for the noise does not depend on it.
    drawn = {"noise": RandomDistribution.kGaussian, "chance": RandomDistribution.kUniform}
    for name, distribution in drawn.items():
        if operator.HasInputPort(name):
            port = operator.GetInputPort(name)
            source = builder.AddNamedSystem(
                f"operator_{name}", RandomSource(distribution, port.size(), period)
            )
            builder.Connect(source.get_output_port(), port)
    injected.add_chance()

    logged = [pose, human, autonomous, shared, plant.GetOutputPort("wheel_speed")]
    logged += [estimator.GetOutputPort("confidence"), weight, estimator.GetOutputPort("mean_variance")]
    logged += [plant.GetOutputPort("clearance"), plant.GetOutputPort("contact")]
    logged += [estimator.GetOutputPort("influence")]
    columns: tuple[str, ...] = LOG_COLUMNS
    for name, extra in getattr(operator, "log_columns", {}).items():
        logged.append(operator.GetOutputPort(name))
        columns += tuple(extra)
    if safety_filter is not None:
        logged.append(applied)
        columns += SAFETY_COLUMNS
    for names, extra in injected.logged.items():
        logged.append(extra)
        columns += names
    multiplexer = builder.AddNamedSystem("log_multiplexer", Multiplexer([port.size() for port in logged]))
    for index, port in enumerate(logged):
        builder.Connect(port, multiplexer.get_input_port(index))
    log_sink = builder.AddNamedSystem("log_sink", VectorLogSink(len(columns), period))
    builder.Connect(multiplexer.get_output_port(), log_sink.get_input_port())

    if meshcat is not None:
        builder.Connect(
            plant.GetOutputPort("geometry_pose"), scene_graph.get_source_pose_port(plant.source_id())
        )
        looks = MeshcatVisualizerParams(role=Role.kIllustration, prefix="scene", publish_period=period)
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, looks)
        visualizer = builder.AddNamedSystem(
            "intention_visualizer",
            IntentionVisualizer(meshcat=meshcat, robot=scenario.robot, period=2 * period),
        )
        shown = {
            "pose": pose,
            "intention": estimator.GetOutputPort("intention"),
            "human_weight": weight,
            "human_command": human,
            "autonomous_command": autonomous,
            "shared_command": shared,
        }
        for name, port in shown.items():
            builder.Connect(port, visualizer.GetInputPort(name))
    return SharedControl(
        operator=operator,
        estimator=estimator,
        controller=controller,
        blender=blender,
        arbitration=arbitration,
        plant=plant,
        scene_graph=scene_graph,
        log_sink=log_sink,
        columns=columns,
        safety_filter=safety_filter,
    )


def _plant(scenario: Scenario, scene_graph: SceneGraph | None) -> DiffDrivePlant:
    robot, start, period = scenario.robot, scenario.start, scenario.control_period
    if scenario.plant == "kinematic":
        moving = any(item.path for item in scenario.obstacles)
        return DiffDrivePlant(
            robot=robot, start=start, period=period, scene_graph=scene_graph, obstacles_move=moving
        )
    return DynamicPlant(
        robot=robot, obstacles=scenario.obstacles, start=start, period=period, scene_graph=scene_graph
    )


def MakeSharedControlDiagram(
    scenario: Scenario,
    *,
    learner: Learner | None = None,
    operator: LeafSystem | None = None,
    arbiter: LeafSystem | str = DEFAULT,
    authority: Authority | bool | None = None,
    look_ahead: float = 0.6,
    safety_clearance: float | None = None,
    faults: Faults | None = None,
    meshcat: Meshcat | None = None,
) -> Diagram:
    """Wires the shared-control loop for ``scenario``.

    The systems are named operator, intention_estimator, waypoint_controller, confidence_blender (arbiter, if
    another one divides the control), diff_drive_plant, scene_graph and log_sink;
    ``diagram.GetSubsystemByName`` finds them.

    Args:
        scenario: The task.
        learner: Any object with the learners' ``predict``; without one the human drives alone.
        operator: Any LeafSystem with an output port ``human_command`` (2), [left, right] in [rad/s], that
            is state. Input ports named ``pose``, ``human_weight``, ``shared_command``, ``noise`` (Gaussian)
            or ``chance`` (uniform) are connected if it has them, and so is an output port ``idle_time`` (1),
            the time since the controls were last touched, in [s], that is state. An attribute ``log_columns``
            (port name to column names) adds columns to the log. A :class:`SurrogateOperator` if None.
        arbiter: Who divides the control: a name or a system, see `drake_shared.systems.arbiters`.
        authority: What "blend" leaves to the human: True is the default, False nothing; by the learner's
            preset if None: nothing with "paper" and without a learner.
        look_ahead: Of the agent's controller, in [s].
        safety_clearance: If given, a :class:`SafetyFilter` named safety_filter keeps it, in [m], and what
            the robot is told is logged as safe_left and safe_right.
        faults: What goes wrong on purpose. Only the systems that it takes are inserted (channel_fault,
            pose_fault, learner_fault, wheel_slip), and what they let through is logged as received_left and
            _right, seen_x, _y and _yaw, heard_confidence, slipped_left and _right; the other columns hold
            what is true: what the human gave, where the robot is, what the learner said. Operator, agent and
            safety filter go by the pose that is seen; the plant does not.
        meshcat: Shows scene and intention there, if given.

    Raises:
        InputError: There is no arbiter of that name, or it lacks a port or has no authority to be set; the
            robot's SDF file cannot be used.
    """
    builder = DiagramBuilder()
    parts = AddSharedControl(
        builder,
        scenario=scenario,
        learner=learner,
        operator=operator,
        arbiter=arbiter,
        authority=authority,
        look_ahead=look_ahead,
        safety_clearance=safety_clearance,
        faults=faults,
        meshcat=meshcat,
    )
    diagram = builder.Build()
    diagram.set_name("shared_control")
    for part in (parts.operator, parts.estimator):
        assert diagram.GetSubsystemByName(part.get_name()) is part
    return diagram


def shared_control_context(system: LeafSystem, root: Context) -> Context:
    """The part of a root Context that belongs to ``system``, to be changed before a trial."""
    return system.GetMyMutableContextFromRoot(root)
