"""The model of an arm: its file, checked, and its kinematics."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    Role,
    SceneGraph,
    SignedDistancePair,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, JacobianWrtVariable, Joint, RevoluteJoint

from drake_shared.common.errors import InputError
from drake_shared.robots.arm import Arm

Floats = NDArray[np.float64]

# Links that fewer joints connect touch each other by design, and their distances are not watched.
_JOINTS_BETWEEN = 3
_FEWEST_JOINTS = 6
# What rounding of decimals in a file explains, in [rad].
_ROUNDING = 1e-6


class ArmModel:
    """A MultibodyPlant of an arm alone, with a Context in which its kinematics are computed.

    Args:
        arm: Describes the arm.
        scene_graph: If given, the geometry of the arm is registered there. Its pairs of links that nearly
            touch by design, and those of the base with everything else that is registered by then, are
            filtered.
        source: For the message of an error.

    Attributes:
        plant: The arm, fixed by its base at the origin of the world; final.
        lower, upper: Limits (n,) of the joint positions, in [rad].
        max_speed: Limits (n,) of the joint speeds, in [rad/s].
        home: Joint positions (n,) at home, in [rad].
        levers: Largest distances (n,) of the arm's geometry from each joint, in [m], whatever the positions:
            no point of the arm moves faster than their sum with the joints' speeds as weights.

    Raises:
        InputError: The file cannot be used, lacks base or tip, or has a joint that is not revolute, not
            between base and tip, or has no limits; or home is outside the limits.
    """

    def __init__(
        self, arm: Arm, scene_graph: SceneGraph | None = None, *, source: str | os.PathLike[str] = "arm"
    ) -> None:
        self._arm, self._source = arm, source
        self.plant = plant = MultibodyPlant(0.0)
        graph = SceneGraph() if scene_graph is None else scene_graph
        others = graph.model_inspector().GetAllGeometryIds(Role.kProximity)
        plant.RegisterAsSourceForSceneGraph(graph)
        # Without it a SceneGraph of our own would be deleted before the plant.
        self._scene_graph = graph
        path = arm.model_path()
        if not path.is_file():
            raise self._error("model", "must be a URDF or SDF file, or one of models/robots", repr(arm.model))
        try:
            (instance,) = Parser(plant).AddModels(str(path))
        except (RuntimeError, ValueError) as error:
            raise self._error(
                "model", f"must be a URDF or SDF file with one model: {_first_line(error)}"
            ) from error
        for field in ("base", "tip"):
            name = getattr(arm, field)
            if not plant.HasFrameNamed(name, instance):
                links = [plant.get_body(index).name() for index in plant.GetBodyIndices(instance)]
                raise self._error(
                    field, f"must be a link or frame of {path.name} ({', '.join(links)})", repr(name)
                )
        try:
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(arm.base, instance))
            plant.Finalize()
        except RuntimeError as error:
            raise self._error(
                "base", f"must be the root of {path.name}: {_first_line(error)}", arm.base
            ) from error
        self._tip: Frame = plant.GetFrameByName(arm.tip, instance)
        joints = sorted(
            (joint for joint in map(plant.get_joint, plant.GetJointIndices()) if joint.num_positions()),
            key=lambda joint: joint.position_start(),
        )
        self._instance, self._joints = instance, joints
        self._check_joints(path, joints)
        self.lower, self.upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
        self.max_speed: Floats = np.minimum(plant.GetVelocityUpperLimits(), -plant.GetVelocityLowerLimits())
        self.home: Floats = np.array(arm.home)
        self._context = plant.CreateDefaultContext()
        self._world = plant.world_frame()
        self._key, self._X_WT = b"", RigidTransform()
        self._frames = self._filter_pairs(graph, others)
        self.levers = self._levers(graph)

    @property
    def size(self) -> int:
        """Number n of joints."""
        return int(self.plant.num_positions())

    def tip_pose(self, joints: Floats) -> RigidTransform:
        """X_WT of the tip at joint positions (n,), in [rad]; the other methods are about the last ones
        given."""
        key = joints.tobytes()
        if key != self._key:
            self.plant.SetPositions(self._context, joints)
            self._key, self._X_WT = key, self._tip.CalcPoseInWorld(self._context)
        return self._X_WT

    def jacobian(self) -> Floats:
        """Shape (6, n): angular velocity, in [rad/s], and velocity, in [m/s], of the tip per joint speed."""
        jacobian: Floats = self.plant.CalcJacobianSpatialVelocity(
            self._context, JacobianWrtVariable.kV, self._tip, np.zeros(3), self._world, self._world
        )
        return jacobian

    def distance_gradient(self, pair: SignedDistancePair) -> Floats:
        """Shape (n,): rate of the distance of a pair, in [m/s], per joint speed; obstacles rest."""
        gradient = np.zeros(self.size)
        for geometry, p_GC, sign in ((pair.id_A, pair.p_ACa, 1.0), (pair.id_B, pair.p_BCb, -1.0)):
            if geometry in self._frames:
                frame, R_FG, p_FG = self._frames[geometry]
                velocity = self.plant.CalcJacobianTranslationalVelocity(
                    self._context,
                    JacobianWrtVariable.kV,
                    frame,
                    R_FG @ p_GC + p_FG,
                    self._world,
                    self._world,
                )
                gradient += sign * (pair.nhat_BA_W @ velocity)
        return gradient

    def _error(self, field: str, expected: str, got: object = None) -> InputError:
        return InputError(self._source, f"robot.{field}", expected, got)

    def _check_joints(self, path: Path, joints: list[Joint]) -> None:
        for joint in joints:
            if not isinstance(joint, RevoluteJoint):
                raise self._error("model", f"must have revolute and fixed joints only, not {joint.name()}")
            if self._tip.body().index() not in self.plant.GetBodiesKinematicallyAffectedBy([joint.index()]):
                expected = f"must have all its moving joints between base and tip; fix {joint.name()}"
                raise self._error("model", expected)
            limits = (
                *joint.position_lower_limits(),
                *joint.position_upper_limits(),
                *joint.velocity_lower_limits(),
                *joint.velocity_upper_limits(),
            )
            if not np.isfinite(limits).all():
                raise self._error(
                    "model", f"must limit position and velocity of {joint.name()} ({path.name})"
                )
        home = self._arm.home
        if len(joints) < _FEWEST_JOINTS:
            expected = f"must have at least {_FEWEST_JOINTS} joints between base and tip ({path.name})"
            raise self._error("model", expected, len(joints))
        if len(home) != len(joints):
            expected = f"must have {len(joints)} joint positions, one for each joint of {path.name}"
            raise self._error("home", expected, len(home))
        for joint, at in zip(joints, home, strict=True):
            low, high = joint.position_lower_limits().item(), joint.position_upper_limits().item()
            if not low - _ROUNDING <= at <= high + _ROUNDING:
                raise self._error("home", f"must keep {joint.name()} from {low:.4g} to {high:.4g} rad", at)

    def _filter_pairs(
        self, graph: SceneGraph, others: list[GeometryId]
    ) -> dict[GeometryId, tuple[Frame, Floats, Floats]]:
        """Excludes pairs that are not watched. Returns frame of the link and pose in it of each solid."""
        plant, inspector = self.plant, graph.model_inspector()
        indices = plant.GetBodyIndices(self._instance)
        bodies = [plant.get_body(index) for index in indices]
        solids = [plant.GetCollisionGeometriesForBody(body) for body in bodies]
        moved_by: list[set[int]] = [set() for _ in bodies]
        for number, joint in enumerate(self._joints):
            affected = plant.GetBodiesKinematicallyAffectedBy([joint.index()])
            for moved, index in zip(moved_by, indices, strict=True):
                if index in affected:
                    moved.add(number)
        rule = CollisionFilterDeclaration().ExcludeWithin(GeometrySet(others))
        for first, own in enumerate(solids):
            if not moved_by[first]:
                rule.ExcludeBetween(GeometrySet(own), GeometrySet(others))
            for second in range(first, len(solids)):
                if len(moved_by[first] ^ moved_by[second]) < _JOINTS_BETWEEN:
                    rule.ExcludeBetween(GeometrySet(own), GeometrySet(solids[second]))
        graph.collision_filter_manager().Apply(rule)
        frames = {}
        for body, own in zip(bodies, solids, strict=True):
            for solid in own:
                X_FG = inspector.GetPoseInFrame(solid)
                frames[solid] = (body.body_frame(), X_FG.rotation().matrix(), X_FG.translation())
        return frames

    def _levers(self, graph: SceneGraph) -> Floats:
        plant, inspector = self.plant, graph.model_inspector()
        origins = [joint.frame_on_child().CalcPoseInWorld(self._context) for joint in self._joints]
        moved = [plant.GetBodiesKinematicallyAffectedBy([joint.index()]) for joint in self._joints]
        levers = np.zeros(self.size)
        for solid, (frame, R_FG, p_FG) in self._frames.items():
            last = sum(frame.body().index() in bodies for bodies in moved) - 1
            box = inspector.GetObbInGeometryFrame(solid)
            # Only a half space has none; it has no end.
            reach = np.inf if box is None else float(np.linalg.norm(box.half_width()))
            center = p_FG if box is None else p_FG + R_FG @ box.pose().translation()
            point = frame.CalcPoseInWorld(self._context).multiply(center)
            # Along the chain of joints, since the positions of those in between change the straight distance.
            for joint in range(last, -1, -1):
                origin = origins[joint].translation()
                reach += float(np.linalg.norm(point - origin))
                levers[joint] = max(levers[joint], reach)
                point = origin
        return levers


def rotation_vector(rotation: Floats) -> Floats:
    """Axis times sine of the angle (3,) of a rotation matrix (3, 3): the rotation itself where it is
    small."""
    differences = (
        rotation[2, 1] - rotation[1, 2],
        rotation[0, 2] - rotation[2, 0],
        rotation[1, 0] - rotation[0, 1],
    )
    return 0.5 * np.array(differences)


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0]
