"""Simulated operator that moves the tip of an arm along a route, with delay, noise and limited skill."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues

from drake_shared.common.errors import InputError
from drake_shared.operators.imperfections import coloured_noise, slipped, within_limits
from drake_shared.operators.reaching import PLANES, ReachingLaw
from drake_shared.robots import Arm
from drake_shared.scenario import Route, Scenario
from drake_shared.scenario.space_path import SpacePath
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate
from drake_shared.systems.route_operator import RouteOperator


class TipOperator(RouteOperator[SpacePath]):
    """Moves the tip of an arm by the :class:`~drake_shared.operators.reaching.ReachingLaw`.

    .. pydrake_system::

        name: TipOperator
        input_ports:
        - pose
        - noise
        - chance
        - human_weight
        - shared_command
        output_ports:
        - human_command
        - planes

    Inputs:
        pose (3 + n): Position of the tip, in [m], world frame, and joint positions.
        noise (3): Samples of a standard normal distribution, fresh ones each period, as from a RandomSource.
        chance (5): Samples of a uniform distribution over [0, 1), likewise.
        human_weight (1), shared_command (3): As for `SurrogateOperator`.

    Outputs:
        human_command (3): Velocity of the tip, in [m/s], world frame. State.
        planes (2): 0 if the stick moves x and y, 1 if it moves y and z; and the number of switches so far.
            State; part of the log.

    Parameters (of the Context):
        route, behaviour: See :meth:`SetBehaviour`.

    Args:
        scenario: Gives routes, arm, travel time and control period.

    Raises:
        InputError: The scenario has no route, or a robot that is not an arm.
    """

    log_columns: ClassVar[Mapping[str, tuple[str, ...]]] = {"planes": ("plane", "plane_switches")}

    def __init__(self, *, scenario: Scenario) -> None:
        robot = scenario.robot
        if not isinstance(robot, Arm):
            expected = "must be an Arm for the TipOperator"
            raise InputError(f"scenario {scenario.name}", "robot", expected, type(robot).__name__)
        super().__init__(scenario=scenario, fastest=robot.max_speed)
        self.set_name("tip_operator")
        self._robot, self._period = robot, scenario.control_period
        self._law = ReachingLaw(scenario)
        command_index = self.DeclareDiscreteState(3)
        planes_index = self.DeclareDiscreteState(2)
        self._command_index, self._planes_index = int(command_index), int(planes_index)
        # Arc length reached on the route, in [m]; time left of a switch, in [s]; noise (3) and intended
        # command (3), in [m/s].
        self._mind_index = int(self.DeclareDiscreteState(8))
        self._seen_index = int(
            self.DeclareDiscreteState(np.tile(scenario.routes[0].waypoints[0], self._law.memory))
        )
        self.DeclareStateOutputPort("human_command", command_index)
        self.DeclareStateOutputPort("planes", planes_index)
        DeclareDiscreteUpdate(self, period=self._period, update=self._update)

    def PathOf(self, route: Route) -> SpacePath:
        """The curve of a route of the scenario, in space."""
        return SpacePath(route.waypoints)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        behaviour, path = self.intention(context)
        law, now = self._law, context.get_time()
        remembered = context.get_discrete_state(self._seen_index).value()
        seen = np.concatenate((self._pose_port.Eval(context)[:3], remembered[:-3]))
        reached, switching, *rest = context.get_discrete_state(self._mind_index).value().tolist()
        noise, last = rest[:3], rest[3:]
        plane, switches = context.get_discrete_state(self._planes_index).value().tolist()

        position = law.recall(seen, behaviour.delay)
        reached = law.progress(path, position, reached)
        paused = now - behaviour.late_start - behaviour.pause_time
        steers = now >= behaviour.late_start and not 0.0 <= paused < behaviour.pause
        axes = PLANES[int(plane)] if behaviour.plane_switch_time else np.ones(3)
        if behaviour.plane_switch_time or behaviour.aim_ahead:
            meant, error = law.aim(path, position, reached, behaviour, axes)
            if switching > 0.0:
                switching -= self._period
            elif behaviour.plane_switch_time and law.wants_other_plane(error, int(plane)):
                plane, switching, switches = 1.0 - plane, behaviour.plane_switch_time, switches + 1.0
        else:
            meant = law.follow(path, position, reached, behaviour)

        keep = math.exp(-self._period / behaviour.noise_time)
        noise = coloured_noise(
            behaviour, noise, meant.tolist(), self._noise_port.Eval(context).tolist(), keep
        )
        if steers and switching <= 0.0:
            intended = within_limits(self._robot.limited(((meant + noise) * axes).tolist()), self._fastest)
            if behaviour.lag or behaviour.random_share:
                intended = slipped(
                    behaviour, intended, last, self._chance_port.Eval(context).tolist(), self._fastest
                )
            command = intended
            if behaviour.stubbornness or behaviour.yielding:
                command = self.answer(context, behaviour, intended, last)
        else:
            command = intended = [0.0, 0.0, 0.0]
        state.set_value(self._command_index, np.array(command))
        state.set_value(self._planes_index, np.array([plane, switches]))
        state.set_value(self._mind_index, np.array([reached, switching, *noise, *intended]))
        state.set_value(self._seen_index, seen)
