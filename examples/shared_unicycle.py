"""A custom diagram around single systems: a continuous unicycle that a person and an agent share.

Usage: python examples/shared_unicycle.py

Nothing here but the estimator, the controller and the arbiter is from drake_shared. The plant is a
SymbolicVectorSystem, and the human gives a constant command.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.symbolic import Variable, cos, sin
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantVectorSource,
    LogVectorOutput,
    SymbolicVectorSystem,
    ZeroOrderHold,
)

from drake_shared import ConfidenceBlender, DiffDrive, IntentionEstimator, WaypointController, load_learner

PERIOD = 0.05  # Control period, in [s].


def unicycle(robot: DiffDrive) -> SymbolicVectorSystem:
    """Kinematics of a differential drive: state [x, y, yaw], input the wheel speeds, output the state."""
    x, y, yaw, left, right = (Variable(name) for name in ("x", "y", "yaw", "left", "right"))
    speed = 0.5 * robot.wheel_radius * (left + right)
    yaw_rate = robot.wheel_radius / robot.track * (right - left)
    return SymbolicVectorSystem(
        state=[x, y, yaw],
        input=[left, right],
        dynamics=[speed * cos(yaw), speed * sin(yaw), yaw_rate],
        output=[x, y, yaw],
    )


def main(duration: float = 4.0) -> NDArray[np.float64]:
    """Simulates ``duration`` s and returns w at each step, shape (n,)."""
    robot = DiffDrive()
    learner = load_learner("two_obstacles")
    builder = DiagramBuilder()
    human = builder.AddSystem(ConstantVectorSource(robot.wheel_speeds(0.4, 0.25)))
    estimator = builder.AddSystem(IntentionEstimator(learner=learner, robot=robot, period=PERIOD))
    controller = builder.AddSystem(WaypointController(robot=robot))
    blender = builder.AddSystem(ConfidenceBlender(robot=robot, period=PERIOD))
    # Without the hold the integrator would evaluate estimator, controller and arbiter several times a step.
    hold = builder.AddSystem(ZeroOrderHold(PERIOD, 2))
    plant = builder.AddSystem(unicycle(robot))

    pose = plant.get_output_port()
    builder.Connect(pose, estimator.get_pose_input_port())
    builder.Connect(human.get_output_port(), estimator.get_human_command_input_port())
    builder.Connect(pose, controller.get_pose_input_port())
    builder.Connect(estimator.get_intention_output_port(), controller.get_intention_input_port())
    builder.Connect(human.get_output_port(), blender.get_human_command_input_port())
    builder.Connect(
        controller.get_autonomous_command_output_port(), blender.get_autonomous_command_input_port()
    )
    builder.Connect(estimator.get_confidence_output_port(), blender.get_confidence_input_port())
    builder.Connect(blender.get_shared_command_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), plant.get_input_port())
    weight_log = LogVectorOutput(blender.get_human_weight_output_port(), builder, PERIOD)
    pose_log = LogVectorOutput(pose, builder, PERIOD)

    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(duration)
    weight = weight_log.FindLog(simulator.get_context()).data()[0]
    x, y, yaw = pose_log.FindLog(simulator.get_context()).data()[:, -1]
    print(f"after {duration:g} s at ({x:.2f}, {y:.2f}) m, yaw {yaw:.2f} rad; least w {weight.min():.2f}")
    return weight.copy()


if __name__ == "__main__":
    main()
