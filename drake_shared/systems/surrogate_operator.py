"""Simulated operator that steers along a route, with delay, noise and limited skill."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, InputPort, OutputPort

from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.imperfections import coloured_noise, slipped, within_limits
from drake_shared.operators.steering import SteeringLaw
from drake_shared.scenario import Route, Scenario
from drake_shared.scenario.paths import Path
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate
from drake_shared.systems.route_operator import RouteOperator

__all__ = ["Behaviour", "SurrogateOperator"]


class SurrogateOperator(RouteOperator[Path]):
    """Follows a route of the scenario by the :class:`~drake_shared.operators.steering.SteeringLaw`.

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
        noise (2): Samples of a standard normal distribution, fresh ones each period, as from a RandomSource.
        chance (4): Samples of a uniform distribution over [0, 1), likewise. Used only by an operator that
            lags or gives random commands.
        human_weight (1): w of the arbiter. Used only by an operator that yields; 1 if left open.
        shared_command (2): The arbiter's output for the last command, [left, right] in [rad/s]. Used only by
            an operator that is stubborn; the command itself if left open.

    Outputs:
        human_command (2): Wheel speeds [left, right] in [rad/s], within the limits of the wheels. State: it
            answers inputs of at least one period before.

    Parameters (of the Context):
        route, behaviour: See :meth:`SetBehaviour`.

    The noise is coloured, of first order. The intended command is that of the steering law with noise, a
    random one, or that of the last step; the operator's answer to assistance comes last.

    Args:
        scenario: Gives routes, robot, travel time and control period.

    Raises:
        InputError: The scenario has no route, or a robot that is not a differential drive.
    """

    def __init__(self, *, scenario: Scenario) -> None:
        self._robot = scenario.diff_drive
        super().__init__(scenario=scenario, fastest=self._robot.max_wheel_speed)
        self.set_name("surrogate_operator")
        self._period = scenario.control_period
        self._law = SteeringLaw(scenario)
        command_index = self.DeclareDiscreteState(2)
        self._command_index = int(command_index)
        # Arc length reached on the route, in [m]; the noise on both wheels, and their intended speeds, in
        # [rad/s].
        self._mind_index = int(self.DeclareDiscreteState(5))
        self._seen_index = int(self.DeclareDiscreteState(self._law.initial_memory))
        self._command_port = self.DeclareStateOutputPort("human_command", command_index)
        DeclareDiscreteUpdate(self, period=self._period, update=self._update)

    def get_pose_input_port(self) -> InputPort:
        """The port ``pose``."""
        return self._pose_port

    def get_human_command_output_port(self) -> OutputPort:
        """The port ``human_command``."""
        return self._command_port

    def PathOf(self, route: Route) -> Path:
        """The curve of a route of the scenario, in the plane."""
        return self._scenario.path_of(route)

    set_behaviour = RouteOperator.SetBehaviour

    def _update(self, context: Context, state: DiscreteValues) -> None:
        behaviour, path = self.intention(context)
        law, now = self._law, context.get_time()
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
            time -= behaviour.pause  # The plan continues after the pause.
        left = right = 0.0
        if steers:
            speed, turn, correction = law.steer(
                path, pose, reached, time=time, delay=behaviour.delay, speed_factor=behaviour.speed_factor
            )
            left, right = self._robot.wheel_speeds(speed, turn + behaviour.skill * correction)

        keep = math.exp(-self._period / behaviour.noise_time)
        normal = self._noise_port.Eval(context).tolist()
        left_noise, right_noise = coloured_noise(
            behaviour, (left_noise, right_noise), (left, right), normal, keep
        )
        if steers:
            intended = within_limits((left + left_noise, right + right_noise), self._fastest)
            if behaviour.lag or behaviour.random_share:
                chance = self._chance_port.Eval(context).tolist()
                intended = slipped(behaviour, intended, last, chance, self._fastest)
            command = intended
            if behaviour.stubbornness or behaviour.yielding:
                command = self.answer(context, behaviour, intended, last)
        else:
            command = intended = [0.0, 0.0]  # Without hands on the controls there is no noise either.
        # Arrays are converted faster than lists.
        state.set_value(self._command_index, np.array(command))
        state.set_value(self._mind_index, np.array([reached, left_noise, right_noise, *intended]))
        state.set_value(self._seen_index, seen)
