"""Localisation errors: noise, drift and gaps in the measured pose."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from drake_shared.robots import DiffDrive, Robot
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate


class PoseFault(LeafSystem):
    """Adds noise, drift and gaps to a pose.

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
        pose (N): The robot's configuration, world frame: the true one. D of its elements are coordinates of
            the position, by their names, in [m]; the others are angles, in [rad].
        noise (N + D): Samples of the standard normal distribution, fresh ones each period, as from a
            RandomSource.
        chance (1): Uniform samples over [0, 1), likewise.

    Outputs:
        seen_pose (N): The measured pose; NaN in a gap. Feeds through.
        shown_pose (N): The same, but in a gap the last one before it, as a display would show. Feeds through.

    State:
        error (N): Error of the pose now; 0 at the start.
        drift (D): The part of it that is kept, in [m].
        drawn (1): The uniform sample of this step. The first step is never a gap.
        last (N): The pose shown last.

    Args:
        noise: Standard deviation on the position, in [m].
        yaw_noise: Standard deviation on the angles, in [rad].
        drift: Random walk of the position: standard deviation after 1 s, in [m].
        nan: Share of steps that are gaps, from 0 to 1.
        robot: Gives the sizes; a differential drive if None.
        period: Of the control step, in [s].
    """

    def __init__(
        self,
        *,
        noise: float = 0.0,
        yaw_noise: float = 0.0,
        drift: float = 0.0,
        nan: float = 0.0,
        robot: Robot | None = None,
        period: float = 0.05,
    ) -> None:
        super().__init__()
        self.set_name("pose_fault")
        robot = robot or DiffDrive()
        names = robot.configuration_names
        self._places = [names.index(name) for name in robot.position_names if name in names]
        size, dimensions = len(names), len(self._places)
        self._size = size
        self._spread = np.full(size, yaw_noise)
        self._spread[self._places] = noise
        self._drift_step = drift * math.sqrt(period)
        self._nan = nan
        self._pose_port = self.DeclareVectorInputPort("pose", size)
        self._noise_port = self.DeclareVectorInputPort("noise", size + dimensions)
        self._chance_port = self.DeclareVectorInputPort("chance", 1)
        self._error_index = self.DeclareDiscreteState(size)
        self._drift_index = self.DeclareDiscreteState(dimensions)
        self._drawn_index = self.DeclareDiscreteState(np.ones(1))
        self._last_index = self.DeclareDiscreteState(size)
        prerequisites = {self.xd_ticket(), self.input_port_ticket(self._pose_port.get_index())}
        self.DeclareVectorOutputPort("seen_pose", size, self._calc_seen, prerequisites)
        self._shown_port = self.DeclareVectorOutputPort("shown_pose", size, self._calc_shown, prerequisites)
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def _in_gap(self, context: Context) -> bool:
        drawn: float = context.get_discrete_state(self._drawn_index)[0]
        return drawn < self._nan

    def _calc_seen(self, context: Context, output: BasicVector) -> None:
        gap = self._in_gap(context)
        output.set_value(np.full(self._size, math.nan) if gap else self._shown_port.Eval(context))

    def _calc_shown(self, context: Context, output: BasicVector) -> None:
        if self._in_gap(context):
            output.set_value(context.get_discrete_state(self._last_index).value())
        else:
            error = context.get_discrete_state(self._error_index).value()
            output.set_value(self._pose_port.Eval(context) + error)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        noise = self._noise_port.Eval(context)
        drift = context.get_discrete_state(self._drift_index).value()
        drift = drift + self._drift_step * noise[self._size :]
        error = self._spread * noise[: self._size]
        error[self._places] += drift
        state.set_value(self._last_index, self._shown_port.Eval(context))
        state.set_value(self._error_index, error)
        state.set_value(self._drift_index, drift)
        state.set_value(self._drawn_index, self._chance_port.Eval(context))
