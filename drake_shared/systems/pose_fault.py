"""A pose as bad localisation sees it: noisy, wandering off, or no number at all."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem


class PoseFault(LeafSystem):
    """Passes a pose on with noise, drift and gaps.

    .. pydrake_system::

        name: PoseFault
        input_ports:
        - pose
        - noise
        - chance
        output_ports:
        - seen_pose
        - shown_pose

    Inputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame: the true one.
        noise (5): Samples of a standard normal density, fresh ones each period, as from a RandomSource.
        chance (1): Samples spread evenly over [0, 1), likewise.

    Outputs:
        seen_pose (3): The pose with its faults; NaN in a gap. Feeds through.
        shown_pose (3): The same, but in a gap the last one before it: what a picture shows. Feeds through.

    State:
        error (3): On x, y and yaw now, in [m, m, rad]; none at the start.
        drift (2): The part of it that stays, in [m].
        drawn (1): What chance says of this step. There is no gap at the start.
        last (3): What was shown last.

    Args:
        noise: Standard deviation on x and y, in [m].
        yaw_noise: On yaw, in [rad].
        drift: x and y wander at random: standard deviation after 1 s, in [m].
        nan: Share of steps that are gaps.
        period: Of the control step, in [s].
    """

    def __init__(
        self,
        *,
        noise: float = 0.0,
        yaw_noise: float = 0.0,
        drift: float = 0.0,
        nan: float = 0.0,
        period: float = 0.05,
    ) -> None:
        super().__init__()
        self._spread = np.array([noise, noise, yaw_noise])
        self._drift_step = drift * math.sqrt(period)
        self._nan = nan
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._noise_port = self.DeclareVectorInputPort("noise", 5)
        self._chance_port = self.DeclareVectorInputPort("chance", 1)
        self._error_index = self.DeclareDiscreteState(3)
        self._drift_index = self.DeclareDiscreteState(2)
        self._drawn_index = self.DeclareDiscreteState(np.ones(1))
        self._last_index = self.DeclareDiscreteState(3)
        prerequisites = {self.xd_ticket(), self.input_port_ticket(self._pose_port.get_index())}
        self.DeclareVectorOutputPort("seen_pose", 3, self._calc_seen, prerequisites)
        self._shown_port = self.DeclareVectorOutputPort("shown_pose", 3, self._calc_shown, prerequisites)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _in_gap(self, context: Context) -> bool:
        return context.get_discrete_state(self._drawn_index)[0] < self._nan

    def _calc_seen(self, context: Context, output: BasicVector) -> None:
        shown = np.full(3, math.nan) if self._in_gap(context) else self._shown_port.Eval(context)
        output.set_value(shown)

    def _calc_shown(self, context: Context, output: BasicVector) -> None:
        if self._in_gap(context):
            output.set_value(context.get_discrete_state(self._last_index).value())
        else:
            error = context.get_discrete_state(self._error_index).value()
            output.set_value(self._pose_port.Eval(context) + error)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        noise = self._noise_port.Eval(context)
        drift = context.get_discrete_state(self._drift_index).value() + self._drift_step * noise[3:]
        error = self._spread * noise[:3]
        error[:2] += drift
        state.set_value(self._last_index, self._shown_port.Eval(context))
        state.set_value(self._error_index, error)
        state.set_value(self._drift_index, drift)
        state.set_value(self._drawn_index, self._chance_port.Eval(context))
