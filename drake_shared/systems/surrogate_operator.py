"""A simulated operator who has a route in mind and steers along it, with delay, noise and limited skill."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_shared.errors import InputError
from drake_shared.paths import Path
from drake_shared.scenario import Robot, Route, Scenario, Start

# The longest reaction delay that the memory for poses allows, in [s].
LONGEST_DELAY = 1.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Behaviour:
    """How a simulated operator drives.

    Attributes:
        delay: From what is seen to the command, in [s]. 0.12 to 0.2 s is the visual-motor delay of people
            (Saunders and Knill 2005).
        noise: Standard deviation of the noise on each wheel's command, in [rad/s].
        noise_time: Time constant of the noise, in [s].
        skill: How much of an error in direction and position is corrected; 1 is a good driver, 0 a blind one.
        late_start: Time before the first command, in [s].
        speed_factor: 1 takes the scenario's travel time; 1.3 is 30% faster.
        switch_time: When the operator changes to the other route in mind, if there is one, in [s].
        pause_time, pause: When the operator gives nothing for a while, in [s], and for how long, in [s].
    """

    delay: float = 0.2
    noise: float = 0.1
    noise_time: float = 0.5
    skill: float = 1.0
    late_start: float = 0.0
    speed_factor: float = 1.0
    switch_time: float = 0.0
    pause_time: float = 0.0
    pause: float = 0.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError("operator", field.name, "must be finite and not negative", value)
        if self.delay > LONGEST_DELAY:
            raise InputError("operator", "delay", f"must be at most {LONGEST_DELAY} s", self.delay)
        for name in ("noise_time", "speed_factor"):
            if getattr(self, name) == 0:
                raise InputError("operator", name, "must be positive", 0)


class SurrogateOperator(LeafSystem):
    """Follows a route of the scenario by a steering law of its own.

    .. pydrake_system::

        name: SurrogateOperator
        input_ports:
        - pose
        - noise
        output_ports:
        - human_command

    Inputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame.
        noise (2): Samples of a standard normal density, fresh ones each period, as from a RandomSource.

    Outputs:
        human_command (2): Wheel speeds [left, right] in [rad/s], within the limits of the wheels. State: it
            answers what was seen at least one period before.

    Parameters (of the Context): the route and the :class:`Behaviour`; see :meth:`set_behaviour`.

    The operator wants to be where an even pace along the route, with a smooth start and end, would be by
    now, slows down in sharp curves, and steers by the route's curvature ahead and the errors seen in
    direction and sideways position: yaw rate = v kappa + skill (k1 direction - k2 v offset). This is not the
    law of the agent's controller, so agreement between the two is not built in. Noise is coloured, of first
    order.

    Args:
        scenario: Gives routes, robot, travel time and control period.
    """

    # Of the errors in direction, in [1/s], sideways position, in [1/m^2], and progress, in [1/s].
    _DIRECTION_GAIN = 1.7
    _OFFSET_GAIN = 1.7
    _PROGRESS_GAIN = 0.8
    # In curves an operator slows down to turn no faster than this, in [rad/s].
    _COMFORTABLE_YAW_RATE = 1.5
    # Share of the travel time in which the pace rises, and in which it falls.
    _RAMP = 0.2
    # How far beyond the point reached the nearest one is looked for, in [m].
    _SEARCH = 0.3

    def __init__(self, *, scenario: Scenario) -> None:
        super().__init__()
        self._robot: Robot = scenario.robot
        self._period = scenario.control_period
        self._travel_time = scenario.travel_time
        self._start = scenario.start
        self._memory_length = math.ceil(LONGEST_DELAY / self._period) + 2
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._noise_port = self.DeclareVectorInputPort("noise", 2)
        self._route_index = self.DeclareAbstractParameter(
            Value(_RouteInMind(scenario.routes[0], self._start))
        )
        self._behaviour_index = self.DeclareAbstractParameter(Value(Behaviour()))
        self._command_index = self.DeclareDiscreteState(2)
        # Arc length reached on the route, in [m], and the noise on both wheels, in [rad/s].
        self._mind_index = self.DeclareDiscreteState(3)
        # Poses seen, the newest first; before anything was seen the robot stood at the start.
        seen = np.tile([self._start.x, self._start.y, self._start.yaw], self._memory_length)
        self._seen_index = self.DeclareDiscreteState(seen)
        self.DeclareStateOutputPort("human_command", self._command_index)
        self.DeclarePeriodicDiscreteUpdateEvent(self._period, 0.0, self._update)

    def set_behaviour(
        self, context: Context, *, route: Route, behaviour: Behaviour, then: Route | None = None
    ) -> None:
        """Gives the operator of this Context a route to follow and a way to drive.

        With ``then``, the operator changes to that route at ``behaviour.switch_time``.
        """
        minded = _RouteInMind(route, self._start, then)
        context.get_mutable_abstract_parameter(self._route_index).set_value(minded)
        context.get_mutable_abstract_parameter(self._behaviour_index).set_value(behaviour)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        minded: _RouteInMind = context.get_abstract_parameter(self._route_index).get_value()
        behaviour: Behaviour = context.get_abstract_parameter(self._behaviour_index).get_value()
        path = minded.path(context.get_time() >= behaviour.switch_time)
        seen = np.empty(3 * self._memory_length)
        seen[:3] = self._pose_port.Eval(context)
        seen[3:] = context.get_discrete_state(self._seen_index).value()[:-3]
        reached, *noise = context.get_discrete_state(self._mind_index).value().tolist()

        # The command takes effect a period from now, and that is part of the delay.
        x, y, yaw = self._recall(seen, max(behaviour.delay - self._period, 0.0))
        reached = path.nearest(x, y, between=(reached, reached + self._SEARCH))
        time = context.get_time() - behaviour.late_start
        paused = time - behaviour.pause_time
        steers = time >= 0.0 and not 0.0 <= paused < behaviour.pause
        if paused >= behaviour.pause:
            time -= behaviour.pause  # What was planned is done later.
        speed, yaw_rate = 0.0, 0.0
        if steers:
            speed, yaw_rate = self._steer(path, behaviour, time, (x, y, yaw), reached)
        left, right = self._robot.wheel_speeds(speed, yaw_rate)

        keep = math.exp(-self._period / behaviour.noise_time)
        kick = behaviour.noise * math.sqrt(1.0 - keep * keep)
        noise = [
            keep * old + kick * new for old, new in zip(noise, self._noise_port.Eval(context), strict=True)
        ]
        fastest = self._robot.max_wheel_speed
        command = [min(max(a + b, -fastest), fastest) for a, b in zip((left, right), noise, strict=True)]
        if not steers:
            command = [0.0, 0.0]  # Hands off: noise is of hands that steer.
        state.set_value(self._command_index, command)
        state.set_value(self._mind_index, [reached, *noise])
        state.set_value(self._seen_index, seen)

    def _recall(self, seen: np.ndarray, delay: float) -> tuple[float, float, float]:
        """The pose seen ``delay`` s ago, between two that are remembered."""
        index, share = divmod(delay / self._period, 1.0)
        newer, older = seen[3 * int(index) :][:3], seen[3 * int(index) + 3 :][:3]
        x, y, yaw = (newer + share * (older - newer)).tolist()
        return x, y, yaw

    def _steer(
        self,
        path: Path,
        behaviour: Behaviour,
        time: float,
        pose: tuple[float, float, float],
        reached: float,
    ) -> tuple[float, float]:
        """Speed, in [m/s], and yaw rate, in [rad/s]."""
        x, y, yaw = pose
        planned, pace = self._plan(path.length, time, self._travel_time / behaviour.speed_factor)
        # What is seen is old: by now the robot is further on.
        ahead = reached + pace * behaviour.delay
        speed = pace + self._PROGRESS_GAIN * (planned - ahead)
        on_x, on_y, direction, _ = path.frame(reached)
        *_, curvature = path.frame(ahead)
        fastest = min(self._robot.max_speed, self._COMFORTABLE_YAW_RATE / max(abs(curvature), 1e-6))
        speed = min(max(speed, 0.0), fastest)
        offset = math.cos(direction) * (y - on_y) - math.sin(direction) * (x - on_x)
        off_direction = math.remainder(direction - yaw, math.tau)
        correction = self._DIRECTION_GAIN * off_direction - self._OFFSET_GAIN * speed * offset
        return speed, speed * curvature + behaviour.skill * correction

    def _plan(self, length: float, time: float, travel_time: float) -> tuple[float, float]:
        """Where on the route to be at ``time``, in [m], and how fast, in [m/s]."""
        ramp = self._RAMP * travel_time
        cruise = length / (travel_time - ramp)
        to_end = travel_time - time
        if to_end <= 0.0:
            return length, 0.0
        if time < ramp or to_end < ramp:
            share = min(time, to_end) / ramp
            gone = cruise * ramp * share**3 * (1.0 - 0.5 * share)
            pace = cruise * share**2 * (3.0 - 2.0 * share)
            return (gone if time < ramp else length - gone), pace
        return cruise * (time - 0.5 * ramp), cruise


class _RouteInMind:
    """A route with its curve, which is costly to make and never changes; perhaps another one after it."""

    def __init__(self, route: Route, start: Start, then: Route | None = None) -> None:
        self._first = route.path(start)
        self._second = None if then is None else then.path(start)

    def path(self, switched: bool) -> Path:
        return self._second if switched and self._second is not None else self._first

    def __deepcopy__(self, memo: dict) -> _RouteInMind:
        return self
