"""A simulated operator who has a route in mind and steers along it, with delay, noise and limited skill."""

from __future__ import annotations

import math

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.steering import SteeringLaw
from drake_shared.robots import DiffDrive
from drake_shared.scenario import Route, Scenario, Start
from drake_shared.scenario.paths import Path

__all__ = ["Behaviour", "SurrogateOperator"]


class SurrogateOperator(LeafSystem):
    """Follows a route of the scenario by the :class:`SteeringLaw` of its own.

    .. pydrake_system::

        name: SurrogateOperator
        input_ports:
        - pose
        - noise
        - chance
        - human_weight
        - shared_command
        output_ports:
        - human_command

    Inputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame.
        noise (2): Samples of a standard normal density, fresh ones each period, as from a RandomSource.
        chance (4): Samples spread evenly over [0, 1), likewise. Looked at by an operator who lags or gives
            random commands only.
        human_weight (1): w of the confidence blender. Looked at by an operator who yields; 1 if nothing is
            connected.
        shared_command (2): What the blender made of the command, [left, right] in [rad/s]. Looked at by an
            operator who is stubborn; the command itself if nothing is connected.

    Outputs:
        human_command (2): Wheel speeds [left, right] in [rad/s], within the limits of the wheels. State: it
            answers what was seen, felt and drawn at least one period before.

    Parameters (of the Context): the route and the :class:`Behaviour`; see :meth:`set_behaviour`.

    Noise is coloured, of first order. What is wanted is the steering law's command with noise, or a random
    one, or that of the last step; then comes what the operator does about assistance.

    Args:
        scenario: Gives routes, robot, travel time and control period.
    """

    def __init__(self, *, scenario: Scenario) -> None:
        super().__init__()
        self._robot: DiffDrive = scenario.robot
        self._fastest = scenario.robot.max_wheel_speed
        self._period = scenario.control_period
        self._start = scenario.start
        self._law = SteeringLaw(scenario)
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._noise_port = self.DeclareVectorInputPort("noise", 2)
        self._chance_port = self.DeclareVectorInputPort("chance", 4)
        self._weight_port = self.DeclareVectorInputPort("human_weight", 1)
        self._shared_port = self.DeclareVectorInputPort("shared_command", 2)
        self._route_index = self.DeclareAbstractParameter(
            Value(_RouteInMind(scenario.routes[0], self._start))
        )
        self._behaviour_index = self.DeclareAbstractParameter(Value(Behaviour()))
        self._command_index = self.DeclareDiscreteState(2)
        # Arc length reached on the route, in [m]; the noise on both wheels and what was wanted of them, in
        # [rad/s].
        self._mind_index = self.DeclareDiscreteState(5)
        self._seen_index = self.DeclareDiscreteState(self._law.nothing_seen)
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
        law, now = self._law, context.get_time()
        path = minded.path(now >= behaviour.switch_time)
        remembered = context.get_discrete_state(self._seen_index).value()
        seen = np.concatenate((self._pose_port.Eval(context), remembered[:-3]))
        mind = context.get_discrete_state(self._mind_index).value().tolist()
        reached, left_noise, right_noise, *last = mind

        pose = law.recall(seen, behaviour.delay)
        reached = law.progress(path, pose, reached)
        time = now - behaviour.late_start
        paused = time - behaviour.pause_time
        steers = time >= 0.0 and not 0.0 <= paused < behaviour.pause
        if paused >= behaviour.pause:
            time -= behaviour.pause  # What was planned is done later.
        left = right = 0.0
        if steers:
            speed, turn, correction = law.steer(
                path, pose, reached, time=time, delay=behaviour.delay, speed_factor=behaviour.speed_factor
            )
            left, right = self._robot.wheel_speeds(speed, turn + behaviour.skill * correction)

        keep = math.exp(-self._period / behaviour.noise_time)
        kick = math.sqrt(1.0 - keep * keep)
        new_left, new_right = self._noise_port.Eval(context).tolist()
        left_spread = right_spread = behaviour.noise
        if behaviour.signal_noise:
            left_spread = math.hypot(left_spread, behaviour.signal_noise * left)
            right_spread = math.hypot(right_spread, behaviour.signal_noise * right)
        left_noise = keep * left_noise + left_spread * kick * new_left
        right_noise = keep * right_noise + right_spread * kick * new_right
        if steers:
            wanted = self._within_limits(left + left_noise, right + right_noise)
            if behaviour.lag or behaviour.random_share:
                wanted = self._slip(context, behaviour, wanted, last)
            command = wanted
            if behaviour.stubbornness or behaviour.yielding:
                command = self._answer_assistance(context, behaviour, wanted, last)
        else:
            command = wanted = [0.0, 0.0]  # Hands off: noise is of hands that steer.
        state.set_value(self._command_index, command)
        state.set_value(self._mind_index, [reached, left_noise, right_noise, *wanted])
        state.set_value(self._seen_index, seen)

    def _within_limits(self, left: float, right: float) -> list[float]:
        fastest = self._fastest
        return [min(max(left, -fastest), fastest), min(max(right, -fastest), fastest)]

    def _slip(
        self, context: Context, behaviour: Behaviour, wanted: list[float], last: list[float]
    ) -> list[float]:
        """What is wanted, or by chance something random or what was wanted in the last step."""
        lags, random, left, right = self._chance_port.Eval(context).tolist()
        if lags < behaviour.lag:
            return last
        if random < behaviour.random_share:
            return [self._fastest * (2.0 * left - 1.0), self._fastest * (2.0 * right - 1.0)]
        return wanted

    def _answer_assistance(
        self, context: Context, behaviour: Behaviour, wanted: list[float], last: list[float]
    ) -> list[float]:
        """What is wanted, changed by what became of the command of the last step."""
        left, right = wanted
        if behaviour.stubbornness and self._shared_port.HasValue(context):
            shared_left, shared_right = self._shared_port.Eval(context).tolist()
            left += behaviour.stubbornness * (last[0] - shared_left)
            right += behaviour.stubbornness * (last[1] - shared_right)
        if behaviour.yielding and self._weight_port.HasValue(context):
            held = 1.0 - behaviour.yielding * (1.0 - self._weight_port.Eval(context).item())
            left, right = held * left, held * right
        return self._within_limits(left, right)


class _RouteInMind:
    """A route with its curve, which is costly to make and never changes; perhaps another one after it."""

    def __init__(self, route: Route, start: Start, then: Route | None = None) -> None:
        self._first = route.path(start)
        self._second = None if then is None else then.path(start)

    def path(self, switched: bool) -> Path:
        return self._second if switched and self._second is not None else self._first

    def __deepcopy__(self, memo: dict) -> _RouteInMind:
        return self
