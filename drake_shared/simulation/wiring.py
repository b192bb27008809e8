"""Adds the systems of a shared-control loop to a diagram and connects them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

from pydrake.common import RandomDistribution
from pydrake.geometry import Meshcat, MeshcatVisualizer, MeshcatVisualizerParams, Role, SceneGraph
from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import ConstantVectorSource, Multiplexer, RandomSource, VectorLogSink

from drake_shared.arbitration.path_repair import make_path_repair
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.learners.no_learner import NoLearner
from drake_shared.robots import Arm, DiffDrive, Robot, check_robot
from drake_shared.scenario import Scenario
from drake_shared.scenario.obstacles import register_obstacles
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.fault_injection import FaultInjection
from drake_shared.simulation.log import log_columns
from drake_shared.simulation.shared_control import SharedControl
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.arbiter_guard import ArbiterGuard
from drake_shared.systems.arbiters import check_arbiter, describe_arbiter, make_arbiter
from drake_shared.systems.arm_plant import AddArmGeometry, ArmPlant
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.conflict_feedback import ConflictFeedback
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.dynamic_arm_plant import DynamicArmPlant
from drake_shared.systems.dynamic_plant import DynamicPlant
from drake_shared.systems.intention_estimator import IntentionEstimator
from drake_shared.systems.intention_visualizer import IntentionVisualizer
from drake_shared.systems.moving_obstacles import AddMovingObstacles
from drake_shared.systems.operators import check_operator, operator_log_columns
from drake_shared.systems.plant import plant_ports
from drake_shared.systems.ports import check_ports
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.robot_position import RobotPosition
from drake_shared.systems.rule_arbiter import RuleArbiter
from drake_shared.systems.safety_filter import SafetyFilter
from drake_shared.systems.surrogate_operator import SurrogateOperator
from drake_shared.systems.tip_operator import TipOperator
from drake_shared.systems.waypoint_controller import WaypointController

_DISTRIBUTIONS = {"noise": RandomDistribution.kGaussian, "chance": RandomDistribution.kUniform}
# They stand for someone who is at the controls from the start.
_PRESENT_OPERATORS = (SurrogateOperator, TipOperator, RecordedInput)


class Systems(TypedDict, total=False):
    """Parts of the loop that are given, or None; see `drake_shared.simulation.MakeSharedControlDiagram`."""

    learner: Learner | None
    operator: LeafSystem | None
    arbiter: LeafSystem | None
    controller: LeafSystem | None
    plant: LeafSystem | None
    robot: Robot | None
    meshcat: Meshcat | None
    show_intention: bool


class Wiring:
    """Adds the systems of one loop, in an order on which the random numbers of a seed depend.

    Args:
        builder: Takes the systems.
        scenario, config, robot, prefix: See `drake_shared.simulation.diagram.MakeSharedControlDiagram`.
    """

    def __init__(
        self,
        builder: DiagramBuilder,
        scenario: Scenario,
        config: SharedControlConfig,
        robot: Robot,
        prefix: str,
    ) -> None:
        check_robot(robot)
        self._builder = builder
        self._scenario = scenario
        self._config = config
        self._prefix = prefix
        self._robot = robot
        self._period = scenario.control_period

    def wire(self, systems: Systems) -> SharedControl:
        """Adds and connects everything."""
        learner, meshcat = systems.get("learner"), systems.get("meshcat")
        operator = systems.get("operator")
        if operator is None:
            if not isinstance(self._robot, DiffDrive | Arm):
                expected = "needs an operator: the simulated ones drive a DiffDrive or an Arm"
                raise InputError("robot", type(self._robot).__name__, expected)
            operator = surrogate_operator(self._scenario)
        scenario, config, robot, period = self._scenario, self._config, self._robot, self._period
        scene_graph = self._add("scene_graph", SceneGraph())
        register_obstacles(scene_graph, scenario.static_obstacles)
        AddMovingObstacles(self._builder, scene_graph, scenario.obstacles)
        check_operator(operator, robot)
        self._add("operator", operator)
        estimator = self._add(
            "intention_estimator",
            IntentionEstimator(
                learner=learner or NoLearner(scenario.duration),
                robot=robot,
                period=period,
                repair=make_path_repair(scenario, robot, look_ahead=config.look_ahead)
                if config.path_repair
                else None,
            ),
        )
        controller = self._add("waypoint_controller", self._controller(systems.get("controller")))
        present = isinstance(operator, _PRESENT_OPERATORS)
        driver = "human" if learner is None else config.driver
        arbiter, arbitration = self._arbiter(
            systems.get("arbiter"), driver, idle_time=0.0 if present else math.inf
        )
        self._add("confidence_blender" if isinstance(arbiter, ConfidenceBlender) else "arbiter", arbiter)
        plant = self._plant(systems.get("plant"), scene_graph, meshcat)
        self._add(plant.get_name() if systems.get("plant") is None else "plant", plant)
        if isinstance(plant, ArmPlant):
            AddArmGeometry(self._builder, scene_graph, plant, prefix=self._prefix)

        ports = plant_ports(plant, robot)
        pose = ports.pose
        human = operator.GetOutputPort("human_command")
        clearance = ports.clearance or self._constant("no_clearance", math.inf)
        contact = ports.contact or self._constant("no_contact", 0.0)
        injected = FaultInjection(
            self._builder, config.faults, robot=robot, period=period, prefix=self._prefix
        )
        received = injected.channel(human)
        measured, shown_pose = injected.pose(pose)
        intention, confidence = injected.learner(
            estimator.GetOutputPort("intention"), estimator.GetOutputPort("confidence")
        )
        self._connect(estimator, {"pose": measured, "human_command": received})
        self._connect(controller, {"pose": measured, "intention": intention})
        autonomous = controller.GetOutputPort("autonomous_command")
        commands = {"human_command": received, "autonomous_command": autonomous, "confidence": confidence}
        feedback = self._feedback(commands)
        if feedback is not None:
            # The estimator gets the command without resistance: what resists is computed from its output.
            commands["human_command"] = feedback.get_resisted_command_output_port()
        offered = {"pose": measured, "intention": intention, "clearance": clearance}
        if operator.HasOutputPort("idle_time"):
            offered["idle_time"] = operator.GetOutputPort("idle_time")
        self._connect(arbiter, commands | _wanted(arbiter, offered))
        driver_switch = self._driver_switch(arbiter, arbitration["name"], driver, commands)
        shared = driver_switch.GetOutputPort("shared_command")
        weight = driver_switch.GetOutputPort("human_weight")
        query = scene_graph.get_query_output_port()
        safety_filter, applied = self._safety_filter(measured, ports.speed, shared, query)
        self._builder.Connect(injected.wheels(applied), ports.command)
        if ports.geometry_query is not None:
            self._builder.Connect(query, ports.geometry_query)
        # The operator's command is state, so what it reads of the loop reaches it one step late.
        looped = {"pose": shown_pose, "human_weight": weight, "shared_command": shared}
        self._connect(operator, _wanted(operator, looped))
        # Faults last: the random numbers that a seed gives the operator must not depend on them.
        self._add_noise(operator)
        injected.add_noise()

        logged = [pose, *self._position(pose), human, autonomous, shared, ports.speed]
        logged += [estimator.GetOutputPort("confidence"), weight, estimator.GetOutputPort("mean_variance")]
        logged += [clearance, contact, estimator.GetOutputPort("influence")]
        columns = log_columns(robot)
        for name, extra in operator_log_columns(operator).items():
            logged.append(operator.GetOutputPort(name))
            columns += tuple(extra)
        for name in arbiter.logged if isinstance(arbiter, RuleArbiter) else ():
            logged.append(arbiter.GetOutputPort(name))
            columns += (name,)
        if safety_filter is not None:
            logged.append(applied)
            columns += tuple(f"safe_{name}" for name in robot.command_names)
        for names, port in injected.logged.items():
            logged.append(port)
            columns += names
        if feedback is not None:
            logged += [feedback.get_conflict_output_port(), feedback.get_resisted_command_output_port()]
            columns += ("conflict", *(f"conflict_{name}" for name in robot.command_names))
            columns += tuple(f"resisted_{name}" for name in robot.command_names)
        for name in columns:
            if columns.count(name) > 1:
                raise InputError("log", name, "must be the name of one column; operator or arbiter repeat it")
        log_sink = self._add_log(logged, len(columns))
        if meshcat is not None:
            shown = {
                "pose": pose,
                "intention": estimator.GetOutputPort("intention"),
                "modes": estimator.GetOutputPort("modes"),
                "human_weight": weight,
                "human_command": human,
                "autonomous_command": autonomous,
                "shared_command": shared,
            }
            if isinstance(robot, Arm):
                # A disc at the tip would hide what it is moved to.
                del shown["human_weight"]
            self._add_visualizers(
                meshcat, scene_graph, plant, shown if systems.get("show_intention", True) else {}
            )
        return SharedControl(
            config=config,
            robot=robot,
            operator=operator,
            estimator=estimator,
            controller=controller,
            arbiter=arbiter,
            driver_switch=driver_switch,
            arbitration=arbitration,
            plant=plant,
            scene_graph=scene_graph,
            log_sink=log_sink,
            columns=columns,
            safety_filter=safety_filter,
        )

    def _add(self, name: str, system: Any) -> Any:
        return self._builder.AddNamedSystem(f"{self._prefix}{name}", system)

    def _connect(self, system: LeafSystem, ports: Mapping[str, OutputPort]) -> None:
        for name, port in ports.items():
            self._builder.Connect(port, system.GetInputPort(name))

    def _controller(self, controller: LeafSystem | None) -> LeafSystem:
        robot = self._robot
        if controller is None:
            return WaypointController(robot=robot, look_ahead=self._config.look_ahead)
        check_ports(
            controller,
            "controller",
            inputs={"pose": len(robot.configuration_names), "intention": None},
            outputs={"autonomous_command": len(robot.command_names)},
        )
        return controller

    def _arbiter(
        self, arbiter: LeafSystem | None, driver: str, *, idle_time: float
    ) -> tuple[LeafSystem, dict[str, Any]]:
        config = self._config
        if arbiter is not None:
            check_arbiter(arbiter, type(arbiter).__name__, robot=self._robot)
            return arbiter, describe_arbiter(arbiter)
        arbiter = make_arbiter(
            config.arbitration,
            robot=self._robot,
            period=self._period,
            options=config.arbitration_options,
            authority=config.authority,
            driver=driver,
            initial_idle_time=idle_time,
            scenario=self._scenario.as_mapped(),
        )
        return arbiter, describe_arbiter(arbiter, config.arbitration)

    def _feedback(self, commands: Mapping[str, OutputPort]) -> ConflictFeedback | None:
        """The system that computes what the person feels, if any feedback is on."""
        if not self._config.feedback:
            return None
        feedback: ConflictFeedback = self._add(
            "conflict_feedback", ConflictFeedback(robot=self._robot, feedback=self._config.feedback)
        )
        self._connect(feedback, commands)
        return feedback

    def _driver_switch(
        self, arbiter: LeafSystem, name: str, driver: str, commands: Mapping[str, OutputPort]
    ) -> Arbiter:
        """The system in which the driver is set."""
        if isinstance(arbiter, Arbiter) and arbiter.default_driver == driver:
            return arbiter
        guard = ArbiterGuard(name, robot=self._robot, period=self._period, driver=driver)
        self._add("arbiter_guard", guard)
        watched = {
            "arbiter_command": arbiter.GetOutputPort("shared_command"),
            "arbiter_weight": arbiter.GetOutputPort("human_weight"),
        }
        self._connect(guard, {**commands, **watched})
        return guard

    def _plant(
        self, plant: LeafSystem | None, scene_graph: SceneGraph, meshcat: Meshcat | None
    ) -> LeafSystem:
        scenario, robot = self._scenario, self._robot
        if plant is not None:
            plant_ports(plant, robot)
            return plant
        if isinstance(robot, Arm):
            kind = ArmPlant if scenario.plant == "kinematic" else DynamicArmPlant
            return kind(
                robot=robot,
                scene_graph=scene_graph,
                period=self._period,
                clearance=self._config.safety_clearance,
                workspace=scenario.workspace,
            )
        if not isinstance(robot, DiffDrive):
            expected = "needs a plant: those of scenarios are a DiffDrive or an Arm"
            raise InputError("robot", type(robot).__name__, expected)
        # Illustration geometry costs time in every step, and serves only those who look.
        drawn_in = scene_graph if meshcat else None
        if scenario.plant == "kinematic":
            return DiffDrivePlant(
                robot=robot,
                start=scenario.start,
                period=self._period,
                scene_graph=drawn_in,
                obstacles_move=any(item.path for item in scenario.obstacles),
            )
        return DynamicPlant(
            robot=robot,
            obstacles=scenario.obstacles,
            start=scenario.start,
            period=self._period,
            scene_graph=drawn_in,
        )

    def _constant(self, name: str, value: float) -> OutputPort:
        """The output of a plant that has no such port: it is clear of everything."""
        port: OutputPort = self._add(name, ConstantVectorSource([value])).get_output_port()
        return port

    def _position(self, pose: OutputPort) -> list[OutputPort]:
        """The coordinates of the position that are not part of the configuration."""
        if set(self._robot.position_names) <= set(self._robot.configuration_names):
            return []
        position = self._add("robot_position", RobotPosition(robot=self._robot))
        self._builder.Connect(pose, position.get_input_port())
        return [position.get_output_port()]

    def _safety_filter(
        self, pose: OutputPort, speed: OutputPort, shared: OutputPort, query: OutputPort
    ) -> tuple[SafetyFilter | None, OutputPort]:
        """The filter and its command, or None and the shared command."""
        clearance = self._config.safety_clearance
        if clearance is None or isinstance(self._robot, Arm):
            # The plant of an arm keeps the clearance itself, of all its links.
            return None, shared
        if not isinstance(self._robot, DiffDrive):
            raise InputError("config", "safety_clearance", "requires a differential drive or an arm")
        safety_filter = self._add(
            "safety_filter",
            SafetyFilter(
                robot=self._robot,
                clearance=clearance,
                period=self._period,
                obstacles=self._scenario.obstacles,
            ),
        )
        inputs = {"pose": pose, "wheel_speed": speed, "wheel_command": shared, "geometry_query": query}
        self._connect(safety_filter, inputs)
        return safety_filter, safety_filter.GetOutputPort("safe_command")

    def _add_noise(self, operator: LeafSystem) -> None:
        for name, distribution in _DISTRIBUTIONS.items():
            if operator.HasInputPort(name):
                port = operator.GetInputPort(name)
                source = RandomSource(distribution, port.size(), self._period)
                self._add(f"operator_{name}", source)
                self._builder.Connect(source.get_output_port(), port)

    def _add_log(self, ports: Sequence[OutputPort], size: int) -> VectorLogSink:
        multiplexer = self._add("log_multiplexer", Multiplexer([port.size() for port in ports]))
        for index, port in enumerate(ports):
            self._builder.Connect(port, multiplexer.get_input_port(index))
        log_sink = self._add("log_sink", VectorLogSink(size, self._period))
        self._builder.Connect(multiplexer.get_output_port(), log_sink.get_input_port())
        return log_sink

    def _add_visualizers(
        self,
        meshcat: Meshcat,
        scene_graph: SceneGraph,
        plant: LeafSystem,
        shown: Mapping[str, OutputPort],
    ) -> None:
        period = self._period
        if isinstance(plant, DiffDrivePlant):
            source = scene_graph.get_source_pose_port(plant.source_id())
            self._builder.Connect(plant.GetOutputPort("geometry_pose"), source)
        parameters = MeshcatVisualizerParams(
            role=Role.kIllustration, prefix=f"{self._prefix}scene", publish_period=period
        )
        MeshcatVisualizer.AddToBuilder(self._builder, scene_graph, meshcat, parameters)
        if shown:
            visualizer = IntentionVisualizer(meshcat=meshcat, robot=self._robot, period=2 * period)
            self._connect(self._add("intention_visualizer", visualizer), shown)


def surrogate_operator(scenario: Scenario) -> SurrogateOperator | TipOperator:
    """The simulated operator of the scenario's robot."""
    if isinstance(scenario.robot, Arm):
        return TipOperator(scenario=scenario)
    return SurrogateOperator(scenario=scenario)


def _wanted(system: LeafSystem, ports: Mapping[str, OutputPort]) -> dict[str, OutputPort]:
    """Those of ``ports`` for which ``system`` has an input port of that name."""
    return {name: port for name, port in ports.items() if system.HasInputPort(name)}
