"""A custom robot: a point that flies in space, so that positions and commands have size 3.

Usage: python examples/own_robot.py [LOG]

`drake_shared.robots.Robot` is the contract of a robot, `drake_shared.systems.plant` that of its plant, and
`drake_shared.systems.operators` that of an operator. Estimator, controller, arbiter, faults, log and metrics
take names and sizes from the robot. LOG is a Parquet file to write.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from own_learner import learn  # examples/own_learner.py
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_shared import (
    Goal,
    Scenario,
    Simulation,
    Trial,
    TrialSettings,
    Workspace,
    metrics,
    write_log,
)
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate

PERIOD = 0.05  # Control period, in [s].
TRAVEL_TIME, DURATION = 6.0, 8.0  # s
# The operator may fly over the middle of the way or to the left of it.
ROUTES = {
    "over": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.3], [2.0, 0.0, 2.0], [3.0, 0.0, 1.6], [4.0, 0.0, 1.0]]),
    "left": np.array([[0.0, 0.0, 1.0], [1.0, 0.3, 1.1], [2.0, 1.0, 1.2], [3.0, 0.6, 1.1], [4.0, 0.0, 1.0]]),
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class PointRobot:
    """A point in space with velocity commands; a `drake_shared.robots.Robot`."""

    configuration_names: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    position_names: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    command_names: ClassVar[tuple[str, ...]] = ("vx", "vy", "vz")
    command_units: ClassVar[tuple[str, ...]] = ("m/s", "m/s", "m/s")
    speed_names: ClassVar[tuple[str, ...]] = ("speed_x", "speed_y", "speed_z")

    max_speed: float = 1.5
    """Largest speed along each axis, in [m/s]."""
    characteristic_length: float = 0.2
    """Radius of the body, in [m]."""

    @property
    def command_limits(self) -> tuple[float, ...]:
        """In [m/s]."""
        return (self.max_speed,) * 3

    def position(self, configuration: Sequence[float]) -> tuple[float, ...]:
        """The configuration is the position."""
        return tuple(configuration)

    def speed(self, command: Sequence[float]) -> float:
        """Norm of the velocity, in [m/s]."""
        return math.hypot(*command)

    def rollout(
        self, configuration: Sequence[float], command: Sequence[float], horizon: float
    ) -> tuple[float, ...]:
        """Position, in [m], after ``horizon`` s of a constant velocity."""
        return tuple([x + horizon * v for x, v in zip(configuration, command, strict=True)])

    def command_toward(
        self, configuration: Sequence[float], target: Sequence[float], duration: float
    ) -> tuple[float, ...]:
        """Velocity, in [m/s], straight to ``target``, slower where it would exceed the limits."""
        velocity = [(goal - x) / duration for goal, x in zip(target, configuration, strict=True)]
        if not math.isfinite(sum(velocity)):
            return (math.nan,) * 3
        scale = min(1.0, self.max_speed / max(*map(abs, velocity), 1e-9))
        return tuple([scale * v for v in velocity])

    def conflict_angle(self, a: Sequence[float], b: Sequence[float]) -> float:
        """Angle between two velocities, in [rad]; NaN if either is below 5 cm/s."""
        norms = math.hypot(*a), math.hypot(*b)
        if not min(norms) > 0.05:
            return math.nan
        cosine = sum(x * y for x, y in zip(a, b, strict=True)) / (norms[0] * norms[1])
        return math.acos(min(max(cosine, -1.0), 1.0))

    def stick_command(
        self, forward: float, left: float, *, max_speed: float, max_yaw_rate: float
    ) -> tuple[float, ...]:
        """Velocity, in [m/s], in the horizontal plane; a third axis needs a custom operator."""
        return max_speed * forward, max_speed * left, 0.0


class PointPlant(LeafSystem):
    """A point that moves at the commanded velocity.

    .. pydrake_system::

        name: PointPlant
        input_ports:
        - command
        output_ports:
        - pose
        - speed

    Ports:
        command (3): Velocity, in [m/s].
        pose (3): [x, y, z], in [m]. State.
        speed (3): Velocity of the last step, in [m/s]. State.
    """

    def __init__(self, start: Sequence[float], *, period: float = PERIOD) -> None:
        super().__init__()
        self._period = period
        self._command_port = self.DeclareVectorInputPort("command", 3)
        self._pose_index = self.DeclareDiscreteState(np.array(start))
        self._speed_index = self.DeclareDiscreteState(3)
        self.DeclareStateOutputPort("pose", self._pose_index)
        self.DeclareStateOutputPort("speed", self._speed_index)
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        velocity = self._command_port.Eval(context)
        pose = context.get_discrete_state(self._pose_index).value()
        state.set_value(self._pose_index, pose + self._period * velocity)
        state.set_value(self._speed_index, velocity)


class PointOperator(LeafSystem):
    """Flies along waypoints at an even pace.

    .. pydrake_system::

        name: PointOperator
        input_ports:
        - pose
        output_ports:
        - human_command

    Ports:
        pose (3): [x, y, z], in [m].
        human_command (3): Velocity, in [m/s]. State.
    """

    def __init__(self, robot: PointRobot, waypoints: NDArray[np.float64], *, period: float = PERIOD) -> None:
        super().__init__()
        self._robot = robot
        self._waypoints = waypoints
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._command_index = self.DeclareDiscreteState(3)
        self.DeclareStateOutputPort("human_command", self._command_index)
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        ahead = 0.4
        target = path_positions(self._waypoints, np.array([context.get_time() + ahead]))[0]
        pose = self._pose_port.Eval(context)
        state.set_value(self._command_index, self._robot.command_toward(pose, target, ahead))


def make_robot(*, scenario: Scenario, period: float) -> tuple[PointRobot, PointPlant]:
    """The entry point of the robot: it starts 1 m above the start of ``scenario``."""
    return PointRobot(), PointPlant([scenario.start.x, scenario.start.y, 1.0], period=period)


def make_operator(*, scenario: Scenario, source: object, period: float) -> PointOperator:
    """The entry point of the operator, who flies over the middle of the way."""
    return PointOperator(PointRobot(), ROUTES["over"], period=period)


def path_positions(waypoints: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions (n, 3), in [m], at ``times`` (n,), along ``waypoints``, evenly until TRAVEL_TIME."""
    knots = np.linspace(0.0, TRAVEL_TIME, len(waypoints))
    return np.stack([np.interp(times, knots, axis) for axis in waypoints.T], axis=-1)


def make_simulation(robot: PointRobot, route: str) -> Simulation:
    """A simulation of an operator who flies ``route``, with a learner of all routes."""
    scenario = Scenario(
        name="flight",
        goal=Goal(x=4.0, y=0.0, z=1.0, radius=0.2),
        workspace=Workspace(x_min=-1.0, x_max=5.0, y_min=-2.0, y_max=2.0),
        duration=DURATION,
        travel_time=TRAVEL_TIME,
        control_period=PERIOD,
    )
    times = np.linspace(0.0, DURATION, 81)
    paths = [path_positions(waypoints, times) for waypoints in ROUTES.values()]
    return Simulation(
        scenario,
        robot=robot,
        plant=PointPlant(ROUTES[route][0].tolist()),
        operator=PointOperator(robot, ROUTES[route]),
        learner=learn([times] * len(paths), paths, duration=DURATION),
    )


def main(log: str | None = None) -> Trial:
    """Flies over the middle of the way under shared control."""
    trial = make_simulation(PointRobot(), "over").run(TrialSettings())
    result = metrics(trial)
    print(f"{trial.status}, mean human weight {result['mean_human_weight']:.2f}")
    if log is not None:
        write_log(trial, log)
    return trial


if __name__ == "__main__":
    main(*sys.argv[1:2])
