"""Reports whether a driver holds the controls, to enable a robot."""

from __future__ import annotations

import math

from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_shared.systems.mouse_input import STALE_AFTER


class DriverPresence(LeafSystem):
    """Outputs 1 while a driver holds the controls and is heard from, else 0.

    .. pydrake_system::

        name: DriverPresence
        input_ports:
        - mouse
        output_ports:
        - present

    Without a driver :class:`MouseInput` outputs a zero command, but the agent may drive on. Connected to the
    enable input of a robot, this stops both.

    Inputs:
        mouse (6): The output ``mouse`` of MouseInput.

    Outputs:
        present (1): 1 or 0; feeds through.

    Args:
        timeout: Largest age of a driver's sample that counts, in [s].

    Raises:
        ValueError: ``timeout`` is not positive and finite.
    """

    def __init__(self, *, timeout: float = STALE_AFTER) -> None:
        super().__init__()
        self.set_name("driver_presence")
        if not (math.isfinite(timeout) and timeout > 0):
            raise ValueError(f"timeout must be positive and finite, got {timeout}")
        self._timeout = timeout
        self._mouse_port = self.DeclareVectorInputPort("mouse", 6)
        self.DeclareVectorOutputPort("present", 1, self._calc_present, {self._mouse_port.ticket()})

    def _calc_present(self, context: Context, output: BasicVector) -> None:
        _, _, age, _, _, engaged = self._mouse_port.Eval(context)
        output[0] = float(engaged > 0.5 and age <= self._timeout)
