"""Differential-drive robot with mass, friction and motors: a MultibodyPlant behind the same ports."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import SceneGraph
from pydrake.systems.framework import Context, DiscreteValues

from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import speeds_after
from drake_shared.scenario import Start
from drake_shared.scenario.obstacles import Obstacle
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.robot_dynamics import RobotDynamics

# Of the contact solver, in [s].
_LONGEST_STEP = 0.005


class DynamicPlant(DiffDrivePlant):
    """A robot on the wheels and caster of its SDF file, with friction, mass, and contact with obstacles.

    .. pydrake_system::

        name: DynamicPlant
        input_ports:
        - wheel_command
        - geometry_query
        output_ports:
        - pose
        - wheel_speed
        - geometry_pose
        - contact
        - clearance

    The ports are those of :class:`DiffDrivePlant`, with the same meaning: ``wheel_speed`` is that of the
    joints, even if the wheels slip; ``contact`` is 1 if the circular body was pressed against an obstacle
    at the end of a step of the solver; a negative clearance is the depth of penetration.

    The state is discrete and is updated once a period, by as many steps of a discrete MultibodyPlant (lagged
    approximation, point contact) as keep each at 5 ms or less. The command is sampled once a period, so that
    values that depend on the pose are computed no more often than with the kinematic plant; as a subsystem
    with a rate of its own the MultibodyPlant would also drift from the control steps by rounding.
    The desired speeds of the wheels ramp to the command as the kinematic robot's do, and a motor on each axle
    follows with at most its joint's effort limit.

    Args:
        robot: Sizes and limits; its SDF file must have its wheels on joints left_axle and right_axle.
        obstacles: That the body collides with. One that moves keeps to its path and pushes the robot away.
        start: Pose at the start; the default of the state.
        period: Of the update, in [s].
        scene_graph: If given, the robot's illustration geometry is registered there, and ``geometry_pose``
            places it.

    Raises:
        InputError: The SDF file cannot be parsed, lacks the wheels, or has them at other places than
            ``robot``; or an argument is out of range.
    """

    def __init__(
        self,
        *,
        robot: DiffDrive,
        obstacles: Sequence[Obstacle] = (),
        start: Start | None = None,
        period: float = 0.05,
        scene_graph: SceneGraph | None = None,
    ) -> None:
        super().__init__(robot=robot, start=start, period=period, scene_graph=scene_graph)
        start = start or Start()
        self._steps = math.ceil(period / _LONGEST_STEP - 1e-9)
        self._dynamics = RobotDynamics(robot, obstacles, step=period / self._steps)
        self._multibody_index = self.DeclareDiscreteState(
            self._dynamics.state_at_rest(start.x, start.y, start.yaw)
        )
        self._desired_index = self.DeclareDiscreteState(2)

    def SetPose(self, context: Context, pose: ArrayLike) -> None:
        """Puts the robot of ``context`` at ``pose`` (3), [x, y, yaw] in [m, m, rad], at rest."""
        super().SetPose(context, pose)
        context.SetDiscreteState(
            self._multibody_index, self._dynamics.state_at_rest(*np.asarray(pose, dtype=float))
        )
        context.SetDiscreteState(self._desired_index, np.zeros(2))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        yaw = float(context.get_discrete_state(self._pose_index)[2])
        left, right = context.get_discrete_state(self._desired_index).value().tolist()
        left_command, right_command = self._command_port.Eval(context).tolist()
        command = (self._possible(left_command), self._possible(right_command))
        dynamics, step = self._dynamics, self._period / self._steps
        dynamics.set_state(context.get_discrete_state(self._multibody_index).value())
        contact = False
        now = context.get_time()
        for index in range(self._steps):
            dynamics.move_obstacles(now + index * step)
            # The speed in the middle of a step gives the distance of the whole step.
            dynamics.step(speeds_after(self._robot, (left, right), command, (index + 0.5) * step))
            contact = dynamics.is_in_contact() or contact
        x, y, heading = dynamics.pose()
        # The yaw is unwrapped, as that of the kinematic robot.
        yaw += math.remainder(heading - yaw, 2 * math.pi)
        state.set_value(self._pose_index, [x, y, yaw])
        state.set_value(self._wheels_index, dynamics.wheel_speeds())
        state.set_value(self._contact_index, [float(contact)])
        state.set_value(self._multibody_index, dynamics.state())
        state.set_value(self._desired_index, speeds_after(self._robot, (left, right), command, self._period))
