"""The dynamics of an arm under inverse-dynamics control, stepped by their owner."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from drake_shared.robots.arm import Arm

Floats = NDArray[np.float64]

# Critically damped, at 3 Hz: errors of the joints fade in a tenth of a second.
_FREQUENCY = 20.0
_POSITION_GAIN, _SPEED_GAIN = _FREQUENCY**2, 2.0 * _FREQUENCY


class ArmDynamics:
    """A discrete MultibodyPlant of an arm whose joints follow a reference by computed torques.

    Torques are limited by the effort limits of the model's actuators, where it has any. Contact forces are
    not simulated.

    Args:
        arm: Describes the arm; `drake_shared.robots.arm_model.ArmModel` checks it.
        step: Of the integration, in [s].
    """

    def __init__(self, arm: Arm, *, step: float) -> None:
        self._plant = plant = MultibodyPlant(step)
        # With sampled outputs a step would be an unrestricted update.
        plant.SetUseSampledOutputPorts(False)
        (instance,) = Parser(plant).AddModels(str(arm.model_path()))
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(arm.base, instance))
        plant.Finalize()
        self._context = plant.CreateDefaultContext()
        self._force_port = plant.get_applied_generalized_force_input_port()
        if plant.num_actuators():
            plant.get_actuation_input_port().FixValue(self._context, np.zeros(plant.num_actuators()))
        self._effort: Floats = np.full(plant.num_velocities(), np.inf)
        for index in plant.GetJointActuatorIndices():
            actuator = plant.get_joint_actuator(index)
            self._effort[actuator.joint().velocity_start()] = actuator.effort_limit()

    def step(self, state: Floats, joints: Floats, speeds: Floats) -> Floats:
        """State (2 n,) after one step toward a reference.

        Args:
            state: Joint positions, in [rad], and speeds, in [rad/s].
            joints: Reference positions (n,) at the end of the step, in [rad].
            speeds: Reference speeds (n,), in [rad/s].
        """
        plant, context = self._plant, self._context
        plant.SetPositionsAndVelocities(context, state)
        position, speed = np.split(state, 2)
        acceleration = _POSITION_GAIN * (joints - position) + _SPEED_GAIN * (speeds - speed)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        torque = plant.CalcInverseDynamics(context, acceleration, forces)
        self._force_port.FixValue(context, np.clip(torque, -self._effort, self._effort))
        moved = plant.EvalUniquePeriodicDiscreteUpdate(context)
        after: Floats = moved.value().copy()
        return after
