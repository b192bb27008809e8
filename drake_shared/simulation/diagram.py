"""The systems, wired: the shared-control loop of Fig. 1 of Amirshirzad et al. 2022 as one Diagram."""

from __future__ import annotations

from typing import Unpack

from pydrake.systems.framework import Diagram, DiagramBuilder

from drake_shared.common.errors import InputError
from drake_shared.learners import check_learner
from drake_shared.scenario import Scenario
from drake_shared.simulation.config import SharedControlConfig, config_for, config_for_robot
from drake_shared.simulation.shared_control import SharedControl
from drake_shared.simulation.wiring import Systems, Wiring


def AddSharedControl(
    builder: DiagramBuilder,
    *,
    scenario: Scenario,
    config: SharedControlConfig | None = None,
    prefix: str = "",
    **systems: Unpack[Systems],
) -> SharedControl:
    """Adds the whole loop to ``builder``; the arguments are those of :func:`MakeSharedControlDiagram`."""
    if unknown := sorted(set(systems) - set(Systems.__annotations__)):
        raise TypeError(f"AddSharedControl has no argument {unknown[0]!r}")
    learner = systems.get("learner")
    if learner is not None:
        check_learner(learner)
    robot = systems.get("robot") or scenario.robot
    config = config or config_for(None if learner is None else learner.preset, robot)
    config.faults.check_duration(scenario.duration)
    if builder.HasSubsystemNamed(f"{prefix}operator"):
        raise InputError("prefix", "", "must differ from that of the other loop in the builder", repr(prefix))
    return Wiring(builder, scenario, config_for_robot(config, robot), robot, prefix).wire(systems)


def MakeSharedControlDiagram(
    scenario: Scenario,
    *,
    config: SharedControlConfig | None = None,
    prefix: str = "",
    **systems: Unpack[Systems],
) -> Diagram:
    """Wires the shared-control loop for ``scenario``.

    .. pydrake_system::

        name: shared_control
        output_ports:
        - pose
        - human_command
        - autonomous_command
        - shared_command
        - human_weight
        - confidence

    The systems are named operator, intention_estimator, waypoint_controller, confidence_blender (arbiter, if
    it is another one), diff_drive_plant (plant, if it is given), scene_graph and log_sink, after ``prefix``;
    ``diagram.GetSubsystemByName`` finds them. A custom operator replaces an input port of the diagram:
    its command must be state, which no fixed port is.

    Args:
        scenario: The task.
        config: How control is shared. If None, the one that the learner's preset names, see
            :func:`drake_shared.simulation.config.config_for`.
        learner: Predicts intentions; without one the human drives alone.
        operator: A system that stands for the human; see `drake_shared.systems.operators` for its ports. A
            :class:`SurrogateOperator` if None.
        arbiter: A system in place of the config's arbiter; see `drake_shared.systems.arbiters`.
        controller: A system in place of :class:`WaypointController`: inputs ``pose`` and ``intention``,
            output ``autonomous_command`` (M).
        plant: A system in place of the scenario's plant; see `drake_shared.systems.plant` for its ports.
        robot: Names, sizes and limits of the robot, if it is not the scenario's differential drive. It needs
            a ``plant`` and an ``operator``.
        meshcat: Shows scene and intention.
        show_intention: False leaves the intention to something else to draw, such as the page.
        prefix: Of the names of all systems, for several loops in one builder.

    With faults, the systems channel_fault, pose_fault, learner_fault and wheel_slip are inserted where they
    are needed. Their outputs are logged as received_left and _right, seen_x, _y and _yaw, heard_confidence,
    slipped_left and _right; the other columns hold the true values. Operator, agent and safety filter receive
    the measured pose, the plant does not. With a safety clearance, its command is logged as safe_left and
    safe_right.

    Raises:
        InputError: There is no arbiter of that name; a system lacks a port, or has an input that nothing
            connects; the robot's SDF file cannot be used.
    """
    builder = DiagramBuilder()
    parts = AddSharedControl(builder, scenario=scenario, config=config, prefix=prefix, **systems)
    exported = {
        "pose": parts.plant,
        "human_command": parts.operator,
        "autonomous_command": parts.controller,
        "shared_command": parts.driver_switch,
        "human_weight": parts.driver_switch,
        "confidence": parts.estimator,
    }
    for name, system in exported.items():
        builder.ExportOutput(system.GetOutputPort(name), name)
    parts.check_inputs(builder)
    diagram = builder.Build()
    diagram.set_name(f"{prefix}shared_control")
    return diagram
