"""A kinematic arm: its tip moves as commanded, as far as joints and obstacles allow."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.common.value import Value
from pydrake.geometry import QueryObject, SceneGraph, SignedDistancePair
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    DiscreteValues,
    LeafSystem,
    ValueProducer,
)
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from drake_shared.robots.arm import Arm
from drake_shared.robots.arm_model import ArmModel, rotation_vector
from drake_shared.robots.velocity_ik import VelocityIk
from drake_shared.scenario import Workspace
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate

Floats = NDArray[np.float64]

CONTACT = 1e-3
"""Obstacles nearer than this, in [m], are touched: half of it is the least distance."""
# Largest rotation of the tip about each axis from its orientation at home, in [rad]: 3 degrees together.
_LARGEST_TILT = math.radians(1.7)
# Pairs further apart, in [m], do not limit the motion.
_INFLUENCE = 0.15
# Most pairs that limit the motion in a step, the nearest ones.
_PAIRS = 10
# An approach to a limit slows down as exp(-t / _BRAKING_TIME), in [s]: joints that are all slowed down so
# keep every limit, and can be, since they are no faster than their largest acceleration times this.
_BRAKING_TIME = 0.25
# Share of an error in orientation, and in posture, that is corrected, in [1/s].
_ORIENTATION_GAIN, _POSTURE_GAIN = 4.0, 0.3


class ArmPlant(LeafSystem):
    """Moves the tip of an arm as commanded and keeps its orientation, by a quadratic program in each step.

    .. pydrake_system::

        name: ArmPlant
        input_ports:
        - command
        - geometry_query
        output_ports:
        - pose
        - speed
        - joint_positions
        - contact
        - clearance

    It fulfils the contract of `drake_shared.systems.plant`.

    Inputs:
        command (3): Velocity of the tip, in [m/s], world frame. Its norm is limited to the arm's; NaN and
            infinite values count as zero.
        geometry_query: QueryObject of the SceneGraph with the arm and the obstacles.

    Outputs:
        pose (3 + n): Position of the tip, in [m], world frame, and joint positions, in [rad]. State.
        speed (n): Joint speeds, in [rad/s]. State.
        joint_positions (n): In [rad]. Depends on the state alone.
        contact (1): 1 if the arm, without its base, is less than 1 mm from an obstacle or itself, else 0.
        clearance (1): Least distance of the arm to obstacles and itself, in [m]; infinite where nothing is
            within 15 cm. Independent of ``command``.

    The joint speeds of a step minimize the error in the velocity and the orientation of the tip, within the
    limits of joint positions, speeds and accelerations, with the tip turned by at most 3 degrees; what the
    tip does not feel moves the joints toward home. With a clearance the arm slows down before obstacles and
    keeps it. Without, it stops where it touches them: as an impact does, that may exceed the acceleration
    limit.

    Args:
        robot: The arm.
        scene_graph: Of the diagram; all obstacles are in it. The arm's geometry is registered there, and
            `AddArmGeometry` moves it.
        period: Of the update, in [s].
        clearance: Distance that is kept to obstacles and between links, in [m]; None stops at contact.
        workspace: Box that the tip does not leave.

    Attributes:
        model: The arm's kinematics.

    Raises:
        InputError: The arm's model cannot be used.
    """

    def __init__(
        self,
        *,
        robot: Arm,
        scene_graph: SceneGraph,
        period: float = 0.05,
        clearance: float | None = None,
        workspace: Workspace | None = None,
    ) -> None:
        super().__init__()
        self.set_name("arm_plant")
        self._arm, self._period = robot, period
        self.model = model = ArmModel(robot, scene_graph)
        self._clearance = clearance
        self._corners = None if workspace is None else workspace.corners()
        self._max_speed = np.minimum(model.max_speed, _BRAKING_TIME * robot.max_joint_acceleration)
        self._change = period * robot.max_joint_acceleration
        self._ik = VelocityIk(model.size, rows=_PAIRS + 6)
        home = model.tip_pose(model.home)
        self._R_WT = home.rotation().matrix()

        self._command_port = self.DeclareVectorInputPort("command", 3)
        self._query_port = self.DeclareAbstractInputPort("geometry_query", Value(QueryObject()))
        pose_index = self.DeclareDiscreteState(np.concatenate([home.translation(), model.home]))
        speed_index = self.DeclareDiscreteState(model.size)
        self._pose_index, self._speed_index = int(pose_index), int(speed_index)
        pose_ticket = self.discrete_state_ticket(pose_index)
        query_ticket = self.input_port_ticket(self._query_port.get_index())
        self.DeclareStateOutputPort("pose", pose_index)
        self.DeclareStateOutputPort("speed", speed_index)
        self.DeclareVectorOutputPort("joint_positions", model.size, self._calc_joints, {pose_ticket})
        # Pairs of the arm's geometry with obstacles and itself, which three calculations share.
        self._near = self.DeclareCacheEntry(
            "near",
            ValueProducer(allocate=lambda: Value[object](), calc=self._calc_near),
            {pose_ticket, query_ticket},
        )
        self._clearance_port = self.DeclareVectorOutputPort(
            "clearance", 1, self._calc_clearance, {pose_ticket, query_ticket}
        )
        self.DeclareVectorOutputPort("contact", 1, self._calc_contact, {pose_ticket, query_ticket})
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def SetJointPositions(self, context: Context, joints: ArrayLike) -> None:
        """Puts the arm of ``context`` at joint positions (n,), in [rad], at rest."""
        q = np.asarray(joints, dtype=float)
        pose = np.concatenate([self.model.tip_pose(q).translation(), q])
        context.SetDiscreteState(self._pose_index, pose)
        context.SetDiscreteState(self._speed_index, np.zeros(len(q)))

    def _calc_joints(self, context: Context, output: BasicVector) -> None:
        output.set_value(context.get_discrete_state(self._pose_index).value()[3:])

    def _calc_near(self, context: Context, output: Any) -> None:
        query = self._query_port.Eval(context) if self._query_port.HasValue(context) else None
        output.set_value(query.ComputeSignedDistancePairwiseClosestPoints(_INFLUENCE) if query else [])

    def _calc_clearance(self, context: Context, output: BasicVector) -> None:
        output[0] = min((pair.distance for pair in self._near.Eval(context)), default=math.inf)

    def _calc_contact(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self._clearance_port.Eval(context)[0] < CONTACT)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        pose = context.get_discrete_state(self._pose_index).value()
        speeds = context.get_discrete_state(self._speed_index).value()
        joints = pose[3:]
        command = self._possible(self._command_port.Eval(context), pose[:3])
        speeds = self._speeds(joints, speeds, command, self._near.Eval(context))
        joints = joints + self._period * speeds
        tip = self.model.tip_pose(joints).translation()
        state.set_value(self._pose_index, np.concatenate([tip, joints]))
        state.set_value(self._speed_index, speeds)

    def _possible(self, command: Floats, tip: Floats) -> Floats:
        """The part of a command that the tip can follow, in [m/s]."""
        if not math.isfinite(command.sum()):
            return np.zeros(3)
        command = np.array(self._arm.limited(command.tolist()))
        if self._corners is not None:
            low, high = self._corners
            # What numpy.clip does, in less time.
            command = np.minimum(
                np.maximum(command, (low - tip) / _BRAKING_TIME), (high - tip) / _BRAKING_TIME
            )
        return command

    def _speeds(
        self, joints: Floats, before: Floats, command: Floats, near: list[SignedDistancePair]
    ) -> Floats:
        """Joint speeds (n,) of the step, in [rad/s]."""
        model = self.model
        turn = rotation_vector(self._R_WT @ model.tip_pose(joints).rotation().matrix().T)
        jacobian = model.jacobian()
        upper = np.minimum((model.upper - joints) / _BRAKING_TIME, self._max_speed)
        lower = np.maximum((model.lower - joints) / _BRAKING_TIME, -self._max_speed)
        nearest = sorted(near, key=lambda pair: pair.distance)[:_PAIRS]

        def inequalities(speeds: Floats | None) -> tuple[Floats, Floats]:
            rows, least = self._distance_rows(nearest, speeds)
            a = np.concatenate([jacobian[:3], -jacobian[:3], rows])
            tilts = np.concatenate([turn - _LARGEST_TILT, -turn - _LARGEST_TILT])
            return a, np.concatenate([tilts / _BRAKING_TIME, least])

        problem: dict[str, Any] = {
            "jacobian": jacobian,
            "twist": np.concatenate([_ORIENTATION_GAIN * turn, command]),
            "posture": _POSTURE_GAIN * (model.home - joints),
            "inequalities": inequalities,
        }
        low, high = np.maximum(lower, before - self._change), np.minimum(upper, before + self._change)
        found = self._ik.solve(**problem, lower=np.minimum(low, high), upper=np.maximum(low, high))
        if found is None and self._clearance is None:
            found = self._ik.solve(**problem, lower=lower, upper=upper)
        return before * (1.0 - self._period / _BRAKING_TIME) if found is None else found

    def _distance_rows(self, pairs: list[SignedDistancePair], speeds: Floats | None) -> tuple[Floats, Floats]:
        """Gradients (m, n) of distances, and their least rates (m,), in [m/s].

        Given joint speeds (n,), in [rad/s], pairs that they surely do not bring too near are left out.
        """
        if self._clearance is None:
            kept, time = 0.5 * CONTACT, self._period
        else:
            kept, time = self._clearance + 0.5 * CONTACT, _BRAKING_TIME
        if speeds is not None:
            far = kept + time * float(self.model.levers @ np.abs(speeds))
            pairs = [pair for pair in pairs if pair.distance < far]
        rows = np.array([self.model.distance_gradient(pair) for pair in pairs])
        least = np.array([(kept - pair.distance) / time for pair in pairs])
        return rows.reshape(-1, self.model.size), least


def AddArmGeometry(
    builder: DiagramBuilder, scene_graph: SceneGraph, plant: ArmPlant, *, prefix: str = ""
) -> None:
    """Adds what places the geometry of ``plant``, an arm in ``builder``, in ``scene_graph``."""
    model = plant.model.plant
    placed = builder.AddNamedSystem(f"{prefix}arm_geometry", MultibodyPositionToGeometryPose(model))
    builder.Connect(plant.GetOutputPort("joint_positions"), placed.get_input_port())
    builder.Connect(placed.get_output_port(), scene_graph.get_source_pose_port(model.get_source_id()))
