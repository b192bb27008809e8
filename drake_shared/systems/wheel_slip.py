"""Ground on which wheels lose some of what they are told."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem


class WheelSlip(LeafSystem):
    """Takes a share off each wheel's command, one that changes as the ground does.

    .. pydrake_system::

        name: WheelSlip
        input_ports:
        - wheel_command
        - chance
        output_ports:
        - slipped_command

    Inputs:
        wheel_command (2): Wheel speeds [left, right] in [rad/s].
        chance (2): Samples spread evenly over [0, 1), as from a RandomSource.

    Outputs:
        slipped_command (2): (1 - slip u) wheel_command, in [rad/s]. Feeds through.

    State:
        u (2): Of either wheel, drawn anew once a patch; none at the start.

    A safety filter before it does not know of it, and what the filter promises holds no longer.

    Args:
        slip: Largest share that is lost, in [0, 1].
        patch: How long a wheel stays on the same ground, in [s].
    """

    def __init__(self, *, slip: float, patch: float = 0.5) -> None:
        super().__init__()
        self._slip = slip
        self._command_port = self.DeclareVectorInputPort("wheel_command", 2)
        self._chance_port = self.DeclareVectorInputPort("chance", 2)
        self._ground_index = self.DeclareDiscreteState(2)
        self.DeclareVectorOutputPort(
            "slipped_command",
            2,
            self._calc_command,
            {self.xd_ticket(), self.input_port_ticket(self._command_port.get_index())},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(patch, 0.0, self._update)

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        kept = 1.0 - self._slip * context.get_discrete_state(self._ground_index).value()
        output.set_value(kept * self._command_port.Eval(context))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._ground_index, np.array(self._chance_port.Eval(context)))
