"""A diagram of one's own round a single system: the estimator predicts where a robot is heading.

The pose is that of a point that circles the first obstacle; a real robot's pose would come from its driver.

Usage: python examples/own_diagram.py
"""

from __future__ import annotations

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_shared import IntentionEstimator, load_learner, load_scenario


def main() -> np.ndarray:
    """Returns the confidence (n,) while the robot passes the first obstacle on its right."""
    scenario = load_scenario("two_obstacles")
    path = scenario.route("right_left").path(scenario.start)
    times = np.linspace(0.0, 5.0, 51)
    positions = path.position(path.length * times / scenario.travel_time)
    poses = np.column_stack([positions, np.zeros(len(times))])

    builder = DiagramBuilder()
    pose = builder.AddSystem(TrajectorySource(PiecewisePolynomial.FirstOrderHold(times, poses.T)))
    estimator = builder.AddSystem(
        IntentionEstimator(learner=load_learner("two_obstacles"), robot=scenario.robot, period=0.05)
    )
    builder.Connect(pose.get_output_port(), estimator.GetInputPort("pose"))
    log = LogVectorOutput(estimator.GetOutputPort("confidence"), builder, 0.05)
    diagram = builder.Build()

    simulator = Simulator(diagram)
    simulator.AdvanceTo(5.0)
    context = estimator.GetMyContextFromRoot(simulator.get_context())
    intention = estimator.GetOutputPort("intention").Eval(context)
    print("expected in 1 s:", intention.position_at(intention.time + 1.0))
    confidence = log.FindLog(simulator.get_context()).data()[0]
    print(f"confidence: {confidence[0]:.2f} at the start, {confidence[-20]:.2f} past the obstacle")
    return confidence


if __name__ == "__main__":
    main()
