"""An arm with mass and motors, which follow the joints of the kinematic arm."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import SceneGraph
from pydrake.systems.framework import Context, DiscreteValues

from drake_shared.robots.arm import Arm
from drake_shared.robots.arm_dynamics import ArmDynamics
from drake_shared.scenario import Workspace
from drake_shared.systems.arm_plant import ArmPlant

# Longest step of the integration, in [s].
_LONGEST_STEP = 0.005


class DynamicArmPlant(ArmPlant):
    """An `ArmPlant` whose joints have inertia and friction and are driven by limited torques.

    It has the ports of `ArmPlant`: ``pose``, ``speed`` and ``joint_positions`` are those of the moving
    masses. The kinematic arm gives the reference, which the joints follow by inverse dynamics; see
    `drake_shared.robots.arm_dynamics.ArmDynamics`.

    Args:
        robot, scene_graph, period, clearance, workspace: See `ArmPlant`.
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
        super().__init__(
            robot=robot, scene_graph=scene_graph, period=period, clearance=clearance, workspace=workspace
        )
        self.set_name("dynamic_arm_plant")
        self._steps = math.ceil(period / _LONGEST_STEP - 1e-9)
        self._dynamics = ArmDynamics(robot, step=period / self._steps)
        size = self.model.size
        # Positions and speeds of the reference.
        self._reference_index = int(
            self.DeclareDiscreteState(np.concatenate([self.model.home, np.zeros(size)]))
        )

    def SetJointPositions(self, context: Context, joints: ArrayLike) -> None:
        """Puts the arm of ``context`` at joint positions (n,), in [rad], at rest."""
        super().SetJointPositions(context, joints)
        at = np.asarray(joints, dtype=float)
        context.SetDiscreteState(self._reference_index, np.concatenate([at, np.zeros(len(at))]))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        pose = context.get_discrete_state(self._pose_index).value()
        speeds = context.get_discrete_state(self._speed_index).value()
        joints, before = np.split(context.get_discrete_state(self._reference_index).value(), 2)
        tip = self.model.tip_pose(joints).translation()
        command = self._possible(self._command_port.Eval(context), tip)
        wanted = self._speeds(joints, before, command, self._near.Eval(context))
        moving = np.concatenate([pose[3:], speeds])
        for _ in range(self._steps):
            joints = joints + self._period / self._steps * wanted
            moving = self._dynamics.step(moving, joints, wanted)
        state.set_value(self._reference_index, np.concatenate([joints, wanted]))
        position, speed = np.split(moving, 2)
        tip = self.model.tip_pose(position).translation()
        state.set_value(self._pose_index, np.concatenate([tip, position]))
        state.set_value(self._speed_index, speed)
