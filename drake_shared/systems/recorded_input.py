"""An operator from a log: what a person once commanded, played back exactly."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_shared.common.errors import InputError


class RecordedInput(LeafSystem):
    """Plays recorded commands, one a control period, whatever the robot does.

    .. pydrake_system::

        name: RecordedInput
        output_ports:
        - human_command

    Outputs:
        human_command (2): Wheel speeds [left, right] in [rad/s]: row k of the recording from the k-th period
            to the next, zero after its end. State.

    Parameters (of the Context): the recording; see :meth:`set_recording`.

    Args:
        commands: Shape (n, 2), wheel speeds in [rad/s]; the default of the parameter.
        period: Of the control step, in [s].

    Raises:
        InputError: The commands have another shape or are not finite.
    """

    def __init__(self, *, commands: np.ndarray | None = None, period: float = 0.05) -> None:
        super().__init__()
        rows = _checked(np.zeros((0, 2)) if commands is None else commands)
        self._period = period
        self._rows_index = self.DeclareAbstractParameter(Value(rows))
        self._command_index = self.DeclareDiscreteState(_row(rows, 0))
        self.DeclareStateOutputPort("human_command", self._command_index)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def set_recording(self, context: Context, commands: np.ndarray) -> None:
        """Gives the operator of this Context ``commands`` (n, 2), in [rad/s], to play from its first row."""
        rows = _checked(commands)
        context.get_mutable_abstract_parameter(self._rows_index).set_value(rows)
        context.SetDiscreteState(self._command_index, _row(rows, 0))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        rows = context.get_abstract_parameter(self._rows_index).get_value()
        state.set_value(self._command_index, _row(rows, round(context.get_time() / self._period) + 1))


def _checked(commands: np.ndarray) -> np.ndarray:
    rows = np.array(commands, dtype=float)
    if rows.ndim != 2 or rows.shape[1] != 2:
        raise InputError("recording", "commands", "must have shape (n, 2)", rows.shape)
    if not np.isfinite(rows).all():
        raise InputError("recording", "commands", "must be finite")
    rows.flags.writeable = False
    return rows


def _row(rows: np.ndarray, index: int) -> np.ndarray:
    return rows[index] if index < len(rows) else np.zeros(2)
