"""Kinematic differential-drive robot: ramping wheels, exact arcs, and obstacles that stop it."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common.value import Value
from pydrake.geometry import FrameId, FramePoseVector, GeometryId, QueryObject, SceneGraph, SourceId
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort, LeafSystem, OutputPort

from drake_shared.robots import DiffDrive, check_robot
from drake_shared.robots.contact import MARGIN, Distances, drive_until_contact, speeds_in_contact
from drake_shared.robots.illustration import register_robot
from drake_shared.robots.motion import motion, speeds_after
from drake_shared.robots.pose import pose_to_transform
from drake_shared.scenario import Start
from drake_shared.scenario.obstacles import least_distance
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate


class DiffDrivePlant(LeafSystem):
    """A differential-drive robot that ramps to its command, drives exact arcs and stops at obstacles.

    .. pydrake_system::

        name: DiffDrivePlant
        input_ports:
        - wheel_command
        - geometry_query
        output_ports:
        - pose
        - wheel_speed
        - geometry_pose
        - contact
        - clearance

    It fulfils the contract of `drake_shared.systems.plant`.

    Inputs:
        wheel_command (2): [left, right] in [rad/s]. Each wheel is limited to its largest speed; NaN and
            infinite values count as zero.
        geometry_query: QueryObject of a SceneGraph with the obstacles; without it there are no obstacles.

    Outputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame. State.
        wheel_speed (2): [left, right] in [rad/s]. State.
        geometry_pose: FramePoseVector of the robot's frame; depends on the state alone.
        contact (1): 1 if the body touched an obstacle in the step that led here, else 0. State.
        clearance (1): Distance of the circular body to the nearest obstacle, in [m]; infinite without
            obstacles. Independent of ``wheel_command``.

    The state is discrete and is updated once a period. Each wheel changes its speed no faster than its
    largest acceleration and then holds it; the path of the step is integrated exactly. Where it meets an
    obstacle, translation ends there and the yaw continues; the forward speed is lost, so that the robot can
    turn and back away.

    Args:
        robot: Sizes and limits.
        start: Pose at the start; the default of the state.
        period: Of the update, in [s].
        scene_graph: If given, the robot's illustration geometry is registered there, and ``geometry_pose``
            places it.
        obstacles_move: Whether obstacles may come upon the robot. During a step they stay where they are at
            its beginning; one that overlaps the body at its end counts as contact of that step. It passes
            through: the robot is not pushed, but cannot drive any further in.
        geometry_ids: Geometries that are obstacles. If None, all geometries with a proximity role are: a
            floor with that role would then leave no clearance anywhere.

    Raises:
        InputError: An argument is out of range, or the robot's SDF file cannot be used.
    """

    def __init__(
        self,
        *,
        robot: DiffDrive,
        start: Start | None = None,
        period: float = 0.05,
        scene_graph: SceneGraph | None = None,
        obstacles_move: bool = False,
        geometry_ids: Collection[GeometryId] | None = None,
    ) -> None:
        super().__init__()
        self.set_name("diff_drive_plant")
        check_robot(robot)
        start = start or Start()
        self._robot = robot
        self._fastest = robot.max_wheel_speed
        self._period = period
        self._geometry_ids = None if geometry_ids is None else frozenset(geometry_ids)
        self._source: SourceId | None = None
        self._frame: FrameId | None = None
        if scene_graph is not None:
            self._source, self._frame = register_robot(scene_graph, robot.model_path())

        self._command_port = self.DeclareVectorInputPort("wheel_command", 2)
        self._query_port = self.DeclareAbstractInputPort("geometry_query", Value(QueryObject()))
        pose_index = self.DeclareDiscreteState(np.array([start.x, start.y, start.yaw]))
        wheels_index = self.DeclareDiscreteState(2)
        contact_index = self.DeclareDiscreteState(1)
        # Access by int takes half the time of access by DiscreteStateIndex.
        self._pose_index, self._wheels_index = int(pose_index), int(wheels_index)
        self._contact_index = int(contact_index)
        pose_ticket = self.discrete_state_ticket(pose_index)
        self._pose_port = self.DeclareStateOutputPort("pose", pose_index)
        self._speed_port = self.DeclareStateOutputPort("wheel_speed", wheels_index)
        self._geometry_pose_port = self.DeclareAbstractOutputPort(
            "geometry_pose", lambda: Value(FramePoseVector()), self._calc_geometry_pose, {pose_ticket}
        )
        query_ticket = self.input_port_ticket(self._query_port.get_index())
        if obstacles_move:
            contact_ticket = self.discrete_state_ticket(contact_index)
            self._contact_port = self.DeclareVectorOutputPort(
                "contact", 1, self._calc_contact, {pose_ticket, contact_ticket, query_ticket}
            )
        else:
            self._contact_port = self.DeclareStateOutputPort("contact", contact_index)
        self._clearance_port = self.DeclareVectorOutputPort(
            "clearance",
            1,
            self._calc_clearance,
            {pose_ticket, query_ticket},
        )
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def get_wheel_command_input_port(self) -> InputPort:
        """The port ``wheel_command``."""
        return self._command_port

    def get_geometry_query_input_port(self) -> InputPort:
        """The port ``geometry_query``."""
        return self._query_port

    def get_pose_output_port(self) -> OutputPort:
        """The port ``pose``."""
        return self._pose_port

    def get_wheel_speed_output_port(self) -> OutputPort:
        """The port ``wheel_speed``."""
        return self._speed_port

    def get_geometry_pose_output_port(self) -> OutputPort:
        """The port ``geometry_pose``."""
        return self._geometry_pose_port

    def get_contact_output_port(self) -> OutputPort:
        """The port ``contact``."""
        return self._contact_port

    def get_clearance_output_port(self) -> OutputPort:
        """The port ``clearance``."""
        return self._clearance_port

    def source_id(self) -> SourceId | None:
        """The robot's source in the SceneGraph, if it is registered in one."""
        return self._source

    def frame_id(self) -> FrameId | None:
        """The robot's frame in the SceneGraph, if it is registered in one."""
        return self._frame

    def SetPose(self, context: Context, pose: ArrayLike) -> None:
        """Puts the robot of ``context`` at ``pose`` (3), [x, y, yaw] in [m, m, rad], at rest."""
        context.SetDiscreteState(self._pose_index, np.asarray(pose, dtype=float))
        context.SetDiscreteState(self._wheels_index, np.zeros(2))
        context.SetDiscreteState(self._contact_index, np.zeros(1))

    def set_pose(self, context: Context, pose: ArrayLike) -> None:
        """Former name of `SetPose`."""
        self.SetPose(context, pose)

    def _calc_geometry_pose(self, context: Context, output: Any) -> None:
        poses = FramePoseVector()
        if self._frame is not None:
            poses.set_value(
                self._frame, pose_to_transform(context.get_discrete_state(self._pose_index).value())
            )
        output.set_value(poses)

    def _calc_clearance(self, context: Context, output: BasicVector) -> None:
        x, y, _ = context.get_discrete_state(self._pose_index).value().tolist()
        output[0] = self._gap(self._query(context), x, y)

    def _calc_contact(self, context: Context, output: BasicVector) -> None:
        stopped = context.get_discrete_state(self._contact_index)[0] > 0.5
        output[0] = float(stopped or self._clearance_port.Eval(context)[0] <= 2 * MARGIN)

    def _query(self, context: Context) -> QueryObject | None:
        return self._query_port.Eval(context) if self._query_port.HasValue(context) else None

    def _gap(self, query: QueryObject | None, x: float, y: float) -> float:
        if query is None:
            return math.inf
        return least_distance(query, x, y, geometry_ids=self._geometry_ids) - self._robot.footprint_radius

    def _update(self, context: Context, state: DiscreteValues) -> None:
        x, y, yaw = context.get_discrete_state(self._pose_index).value().tolist()
        wheels = tuple(context.get_discrete_state(self._wheels_index).value().tolist())
        left, right = self._command_port.Eval(context).tolist()
        command = (self._possible(left), self._possible(right))
        reached = speeds_after(self._robot, wheels, command, self._period)
        reach = self._period * max(map(abs, (*wheels, *reached))) * self._robot.wheel_radius
        path = motion(self._robot, (x, y, yaw), wheels, command, self._period)
        contact = False
        if self._clearance_port.Eval(context)[0] > reach + MARGIN:
            x, y, yaw = path[-1]
        else:
            distances = self._distances(self._query(context))
            x, y, yaw, contact = drive_until_contact(
                distances, self._robot.footprint_radius, (x, y, yaw), path
            )
        if contact:
            reached = speeds_in_contact(reached)
        # Arrays are converted faster than lists.
        state.set_value(self._pose_index, np.array([x, y, yaw]))
        state.set_value(self._wheels_index, np.array(reached))
        state.set_value(self._contact_index, np.array([float(contact)]))

    def _distances(self, query: Any) -> Distances:
        def distances(x: float, y: float, threshold: float) -> list[tuple[float, float, float]]:
            found = query.ComputeSignedDistanceToPoint(np.array([x, y, 0.0]), threshold)
            return [
                (item.distance, item.grad_W[0], item.grad_W[1])
                for item in found
                if self._geometry_ids is None or item.id_G in self._geometry_ids
            ]

        return distances

    def _possible(self, command: float) -> float:
        """The part of a command that a wheel can follow, in [rad/s]."""
        if not math.isfinite(command):
            return 0.0
        return min(max(command, -self._fastest), self._fastest)
