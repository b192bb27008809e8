"""Arbitration by confidence: eq. (2) of Amirshirzad et al. 2022, within the human's authority."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, ValueProducer

from drake_shared.arbitration.authority import (
    Authority,
    AuthorityState,
    is_hands_off,
    limited_command,
    limited_weight,
    next_times,
)
from drake_shared.arbitration.blend import blend, confidence_weight, finite_weight
from drake_shared.robots import Robot
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate


class ConfidenceBlender(Arbiter):
    """Blends both commands, the agent's by its confidence: w = 1 - c_f and eq. (2).

    .. pydrake_system::

        name: ConfidenceBlender
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        - idle_time
        output_ports:
        - shared_command
        - human_weight

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`. The input
    ``idle_time`` (1), time since the human last touched the controls in [s], exists only with an enabled
    authority and may be left open.

    With an enabled :class:`~drake_shared.arbitration.authority.Authority`, shared control differs from
    eq. (2):

    - w is at least the floor.
    - Once the motions of both commands have been in conflict for the conflict time (see
      ``Robot.conflict_angle``), w rises to 1; it falls again once they have agreed for the agreement time.
    - Once the human has given no command for the hands-off time, w rises to 1, so that the robot stops. With
      ``idle_time`` connected, that time counts and the command must be zero; otherwise the time counts for
      which the command has been zero.
    - w changes no faster than its rate, from 1 at the start. Where the agent's command is NaN or infinite,
      w = 1 at once.
    - The shared command moves straight toward the blend, each element no faster than its rate, from rest at
      the start.

    State, with an enabled authority:
        before (5 + M): :class:`~drake_shared.arbitration.authority.AuthorityState` of the step before.

    Nothing lags: w follows the confidence of the same step.

    Args:
        authority: What the human keeps; confidence alone decides if None or disabled.
        robot: Gives the angle between the motions of two commands.
        period: Of the control step, in [s].
        driver: Default of the parameter.
        initial_idle_time: Time since the human touched the controls, at the start, in [s]. By default it is
            infinite, so that the agent does not drive before anyone was there.
    """

    def __init__(
        self,
        *,
        authority: Authority | None = None,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
        initial_idle_time: float = math.inf,
    ) -> None:
        limits = authority if authority is not None and authority.enabled else None
        super().__init__(
            robot=robot,
            period=period,
            driver=driver,
            optional_inputs=() if limits is None else ("idle_time",),
            weight_inputs=("autonomous_command", "confidence") if limits is None else None,
        )
        self._authority = limits
        if limits is None:
            return
        self._idle_port = self.GetInputPort("idle_time")
        initial = AuthorityState.initial(len(self.robot.command_names), idle_time=initial_idle_time)
        # Access by int takes half the time of access by DiscreteStateIndex.
        self._before_index = int(self.DeclareDiscreteState(np.array(initial.to_list())))
        self._state_cache = self.DeclareCacheEntry(
            "authority_state",
            ValueProducer(lambda: Value(initial), self._calc_state),
            {self.all_input_ports_ticket(), self.pa_ticket(), self.xd_ticket()},
        )
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    @property
    def configuration(self) -> dict[str, Any]:
        """The authority's numbers, or None where it is disabled."""
        return {"authority": None if self._authority is None else self._authority.to_json()}

    def release_reason(self, context: Context) -> str | None:
        """Why the agent gives up control now, whatever its confidence: "conflict", "hands_off" or None."""
        if self._authority is None or self.GetDriver(context) != "shared":
            return None
        state: AuthorityState = self._state_cache.Eval(context)
        if state.released:
            return "conflict"
        return "hands_off" if is_hands_off(self._authority, state) else None

    def DoCalcWeight(self, context: Context) -> float:
        """w = 1 - c_f, from 0 to 1."""
        weight: float = confidence_weight(self.confidence(context))
        return weight

    # With an authority one cache entry holds weight and command, for every driver.
    def _calc_weight(self, context: Context, output: BasicVector) -> None:
        if self._authority is None:
            super()._calc_weight(context, output)
        else:
            output[0] = self._state_cache.Eval(context).weight

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        if self._authority is None:
            super()._calc_command(context, output)
        else:
            output.set_value(np.array(self._state_cache.Eval(context).command))

    def _calc_state(self, context: Context, output: Value) -> None:
        authority, period = self._authority, self.period
        assert authority is not None
        before = AuthorityState.from_list(context.get_discrete_state(self._before_index).value().tolist())
        human = self._human_port.Eval(context).tolist()
        autonomous = self._autonomous_port.Eval(context).tolist()
        has_idle = self._idle_port.HasValue(context)
        state = next_times(
            authority,
            before,
            angle=self.robot.conflict_angle(human, autonomous),
            human=human,
            idle_time=self._idle_port.Eval(context).item() if has_idle else None,
            period=period,
        )
        driver = self.GetDriver(context)
        if driver == "shared":
            weight = confidence_weight(self.confidence(context))
            weight = limited_weight(authority, state, weight, period)
        else:
            weight = float(driver == "human")
        state.weight = finite_weight(weight, autonomous)
        state.command = blend(state.weight, human, autonomous)
        if driver == "shared":
            state.command = limited_command(authority, before.command, state.command, period)
        output.set_value(state)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._before_index, np.array(self._state_cache.Eval(context).to_list()))
