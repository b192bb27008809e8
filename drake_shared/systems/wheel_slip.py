"""Wheel-slip model."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from drake_shared.common.errors import InputError
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate


class WheelSlip(LeafSystem):
    """Reduces each wheel's command by a random share that changes from patch to patch of ground.

    .. pydrake_system::

        name: WheelSlip
        input_ports:
        - wheel_command
        - chance
        output_ports:
        - slipped_command

    Inputs:
        wheel_command (size): Wheel speeds in [rad/s].
        chance (size): Uniform samples over [0, 1), as from a RandomSource.

    Outputs:
        slipped_command (size): (1 - slip u) wheel_command, in [rad/s]. Feeds through.

    State:
        u (size): Of each wheel, redrawn for each patch; 0 at the start.

    A safety filter does not model slip; its guarantee does not hold with it.

    Args:
        slip: Largest share that is lost, from 0 to 1.
        patch: How long a wheel stays on the same ground, in [s].
        size: Number of wheels.

    Raises:
        InputError: ``slip`` is out of range, or ``patch`` is not positive and finite.
    """

    def __init__(self, *, slip: float, patch: float = 0.5, size: int = 2) -> None:
        super().__init__()
        self.set_name("wheel_slip")
        if not 0.0 <= slip <= 1.0:
            raise InputError("WheelSlip", "slip", "must be from 0 to 1", slip)
        self._slip = slip
        self._command_port = self.DeclareVectorInputPort("wheel_command", size)
        self._chance_port = self.DeclareVectorInputPort("chance", size)
        self._ground_index = self.DeclareDiscreteState(size)
        self.DeclareVectorOutputPort(
            "slipped_command",
            size,
            self._calc_command,
            {self.xd_ticket(), self.input_port_ticket(self._command_port.get_index())},
        )
        DeclareDiscreteUpdate(self, period=patch, update=self._update)

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        kept = 1.0 - self._slip * context.get_discrete_state(self._ground_index).value()
        output.set_value(kept * self._command_port.Eval(context))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._ground_index, np.array(self._chance_port.Eval(context)))
