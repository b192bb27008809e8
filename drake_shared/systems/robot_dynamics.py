"""MultibodyPlant of a robot's SDF model on a floor among obstacles, stepped by its owner."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    Box,
    CollisionFilterDeclaration,
    Cylinder,
    GeometryId,
    GeometrySet,
    SceneGraph,
    SceneGraphConfig,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import (
    PdControllerGains,
    PlanarJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    default_model_instance,
)
from pydrake.systems.framework import DiagramBuilder

from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import Pose, Wheels
from drake_shared.robots.pose import pose_to_transform
from drake_shared.scenario.obstacles import Obstacle, position_at

AXLES = ("left_axle", "right_axle")
"""Names of the wheels' joints in the SDF file of a robot."""

# Contact stiffness, in [N/m]: on a softer floor the wheels sink in and roll on a smaller radius.
_STIFFNESS = 1e6
_FLOOR_FRICTION = 0.8
# Torque of a motor per error of its wheel's speed, in [N m s/rad]. With a tenth of it the robot turns 1.5%
# too slowly, because the weight behind the axle resists turning.
_MOTOR_GAIN = 20.0
# The body slides along a wall rather than climbs it.
_BODY_FRICTION = 0.2
# The body's collision geometry lies between these heights, in [m], clear of the floor.
_BODY_BOTTOM, _BODY_TOP = 0.1, 0.2
_OBSTACLE_HEIGHT = 2.0
# Mass of a moving obstacle, in [kg]: one step of contact with the robot hardly slows it.
_OBSTACLE_MASS = 1e4
_SETTLING_TIME = 0.5
# Coordinates, in [m], at which the robot settles, far from all obstacles.
_AWAY = 1000.0
# Largest distance of an axle from its place by the scenario, in [m].
_TOLERANCE = 1e-3


class RobotDynamics:
    """A MultibodyPlant of robot, floor and obstacles, with a Context to step it in.

    The caller keeps the state (n,) between steps and passes it to :meth:`set_state`. Poses are of the link
    that carries the axles, whose origin lies on the floor below their middle.

    Args:
        robot: Sizes; its SDF file must have the wheels on revolute joints named as in ``AXLES``, whose effort
            limit is that of their motors.
        obstacles: That the body, a disc of the footprint's radius, collides with. Those that move are heavy
            and are put back on their paths before every step.
        step: Of the contact solver, in [s].

    Raises:
        InputError: The SDF file cannot be parsed, lacks the wheels, or has them at other places than
            ``robot``.
    """

    def __init__(self, robot: DiffDrive, obstacles: Sequence[Obstacle], *, step: float) -> None:
        builder = DiagramBuilder()
        self._plant, scene_graph = AddMultibodyPlant(
            MultibodyPlantConfig(
                time_step=step,
                contact_model="point",
                discrete_contact_approximation="lagged",
                # With sampled outputs a step is an unrestricted update, and contact is a step late.
                use_sampled_output_ports=False,
            ),
            builder,
        )
        config = SceneGraphConfig()
        config.default_proximity_properties.point_stiffness = _STIFFNESS
        scene_graph.set_config(config)
        model = robot.model_path()
        try:
            (self._robot,) = Parser(self._plant).AddModels(str(model))
        except (RuntimeError, ValueError) as error:
            raise InputError(model, "", f"must be an SDF file with one model: {error}") from error
        self._axles = _axles(self._plant, model)
        self._base = self._axles[0].parent_body()
        self._period = step
        self._body = _add_surroundings(self._plant, self._base, robot, obstacles)
        self._moving = [
            (item, _add_moving(self._plant, scene_graph, item)) for item in obstacles if item.path
        ]
        self._plant.Finalize()
        self._diagram = builder.Build()
        self._root = self._diagram.CreateDefaultContext()
        self._context = self._plant.GetMyMutableContextFromRoot(self._root)
        self._desired_port = self._plant.get_desired_state_input_port(self._robot)
        self._check_axles(robot)
        # A robot at rest sinks into the floor by its weight. One that is placed so does not bounce.
        self._place(pose_to_transform((_AWAY, _AWAY, 0.0)))
        for _ in range(round(_SETTLING_TIME / step)):
            self.step((0.0, 0.0))
        X_WB = self._plant.EvalBodyPoseInWorld(self._context, self._base)
        self._X_RB = pose_to_transform(self.pose()).inverse() @ X_WB

    def state_at_rest(self, x: float, y: float, yaw: float) -> np.ndarray:
        """State (n,) of a robot at rest at a pose in [m, m, rad], world frame."""
        self._place(pose_to_transform((x, y, yaw)) @ self._X_RB)
        return self.state()

    def set_state(self, state: np.ndarray) -> None:
        """Sets positions and velocities of the robot, ``state`` (n,)."""
        self._plant.SetPositionsAndVelocities(self._context, self._robot, state)

    def state(self) -> np.ndarray:
        """Shape (n,): positions and velocities of the robot."""
        state: np.ndarray = self._plant.GetPositionsAndVelocities(self._context, self._robot)
        return state

    def move_obstacles(self, time: float) -> None:
        """Puts moving obstacles at their places at ``time``, in [s], with the velocity of the next step."""
        for obstacle, joint in self._moving:
            here = np.array(position_at(obstacle, time))
            there = np.array(position_at(obstacle, time + self._period))
            joint.set_translation(self._context, here)
            joint.set_rotation(self._context, 0.0)
            joint.set_translational_velocity(self._context, (there - here) / self._period)
            joint.set_angular_velocity(self._context, 0.0)

    def step(self, desired: Wheels) -> None:
        """One step with the motors driving the wheels toward ``desired`` (left, right), in [rad/s]."""
        self._desired_port.FixValue(self._context, [0.0, 0.0, *desired])
        update = self._diagram.EvalUniquePeriodicDiscreteUpdate(self._root)
        self._root.get_mutable_discrete_state().SetFrom(update)

    def pose(self) -> Pose:
        """x, y in [m] and yaw in [rad], from -pi to pi, world frame."""
        X_WB = self._plant.EvalBodyPoseInWorld(self._context, self._base)
        x, y, _ = X_WB.translation().tolist()
        return x, y, float(RollPitchYaw(X_WB.rotation()).yaw_angle())

    def wheel_speeds(self) -> Wheels:
        """Of the joints (left, right), in [rad/s]."""
        left, right = (axle.get_angular_rate(self._context) for axle in self._axles)
        return float(left), float(right)

    def is_in_contact(self) -> bool:
        """Whether the body is pressed against an obstacle."""
        query = self._plant.get_geometry_query_input_port().Eval(self._context)
        return any(self._body in (pair.id_A, pair.id_B) for pair in query.ComputePointPairPenetration())

    def _place(self, X_WB: RigidTransform) -> None:
        self._plant.SetPositionsAndVelocities(self._context, self._robot, np.zeros_like(self.state()))
        self._plant.SetFreeBodyPose(self._context, self._base, X_WB)

    def _check_axles(self, robot: DiffDrive) -> None:
        for axle, side in zip(self._axles, (0.5, -0.5), strict=True):
            p_BA = axle.frame_on_parent().CalcPose(self._context, self._base.body_frame()).translation()
            wanted = np.array([0.0, side * robot.track, robot.wheel_radius])
            if not np.allclose(p_BA, wanted, rtol=0, atol=_TOLERANCE):
                place = "[{:.3f}, {:.3f}, {:.3f}]"
                raise InputError(
                    robot.model_path(),
                    axle.name(),
                    f"must lie at {place.format(*wanted)}, by the scenario's track and wheel radius",
                    place.format(*p_BA),
                )


def _axles(plant: MultibodyPlant, model: Path) -> list[RevoluteJoint]:
    """The wheels' joints, with a motor on each that follows a desired speed; other motors are removed."""
    joints = [plant.GetJointByName(name) if plant.HasJointNamed(name) else None for name in AXLES]
    axles = [joint for joint in joints if isinstance(joint, RevoluteJoint)]
    if len(axles) < len(AXLES):
        raise InputError(model, "", f"must have its wheels on revolute joints {' and '.join(AXLES)}")
    efforts = {}
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        efforts[actuator.joint().name()] = actuator.effort_limit()
        plant.RemoveJointActuator(actuator)
    for axle in axles:
        effort = efforts.get(axle.name(), 0.0)
        if effort <= 0:
            raise InputError(model, axle.name(), "must have an effort limit above 0")
        motor = plant.AddJointActuator(axle.name(), axle, effort)
        motor.set_controller_gains(PdControllerGains(p=0.0, d=_MOTOR_GAIN))
        # The motor's controller compensates the joint's damping.
        axle.set_default_damping(0.0)
    return axles


def _add_surroundings(
    plant: MultibodyPlant, base: RigidBody, robot: DiffDrive, obstacles: Sequence[Obstacle]
) -> GeometryId:
    """Adds the floor, the obstacles, and to ``base`` the disc that collides with them, which is returned."""
    world = plant.world_body()
    floor = RigidTransform([0.0, 0.0, -0.5])
    plant.RegisterCollisionGeometry(
        world, floor, Box(1e4, 1e4, 1.0), "floor", CoulombFriction(_FLOOR_FRICTION, _FLOOR_FRICTION)
    )
    friction = CoulombFriction(_BODY_FRICTION, _BODY_FRICTION)
    for obstacle in obstacles:
        if obstacle.path:
            continue
        X_WG = pose_to_transform((obstacle.x, obstacle.y, obstacle.yaw_angle()))
        plant.RegisterCollisionGeometry(
            world, X_WG, obstacle.shape(_OBSTACLE_HEIGHT), f"obstacle_{obstacle.name}", friction
        )
    disc = Cylinder(robot.footprint_radius, _BODY_TOP - _BODY_BOTTOM)
    X_BG = RigidTransform([0.0, 0.0, 0.5 * (_BODY_BOTTOM + _BODY_TOP)])
    return plant.RegisterCollisionGeometry(base, X_BG, disc, "footprint", friction)


def _add_moving(plant: MultibodyPlant, scene_graph: SceneGraph, obstacle: Obstacle) -> PlanarJoint:
    """Adds an obstacle that slides over the floor and collides with the robot alone."""
    # Collected before its own geometry exists: neither the floor nor another obstacle may stop it.
    others = [
        geometry
        for body in (plant.get_body(index) for index in plant.GetBodyIndices(default_model_instance()))
        for geometry in plant.GetCollisionGeometriesForBody(body)
    ]
    others += plant.GetCollisionGeometriesForBody(plant.world_body())
    name = f"obstacle_{obstacle.name}"
    inertia = SpatialInertia.SolidSphereWithMass(_OBSTACLE_MASS, 1.0)
    body = plant.AddRigidBody(name, default_model_instance(), inertia)
    X_BG = pose_to_transform((0.0, 0.0, obstacle.yaw_angle()))
    friction = CoulombFriction(_BODY_FRICTION, _BODY_FRICTION)
    solid = plant.RegisterCollisionGeometry(body, X_BG, obstacle.shape(_OBSTACLE_HEIGHT), name, friction)
    apart = CollisionFilterDeclaration().ExcludeBetween(GeometrySet([solid]), GeometrySet(others))
    scene_graph.collision_filter_manager().Apply(apart)
    frames = plant.world_frame(), body.body_frame()
    return plant.AddJoint(PlanarJoint(name, *frames, [0.0, 0.0, 0.0]))
