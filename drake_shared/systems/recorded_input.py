"""Operator that plays recorded commands."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem, OutputPort

from drake_shared.common.arrays import read_only
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive, Robot, check_robot
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate


class RecordedInput(LeafSystem):
    """Plays recorded commands, one a control period, whatever the robot does.

    .. pydrake_system::

        name: RecordedInput
        output_ports:
        - human_command

    Outputs:
        human_command (M): Row k of the recording from the k-th period to the next, zero after its end. State.

    Parameters (of the Context):
        recording: See :meth:`SetRecording`.

    Args:
        commands: Shape (n, M), in the robot's units; the default of the parameter.
        robot: Gives M; a differential drive if None.
        period: Control step, in [s].

    Raises:
        InputError: The commands have another shape or are not finite, or ``period`` is not positive.
    """

    def __init__(
        self, *, commands: ArrayLike | None = None, robot: Robot | None = None, period: float = 0.05
    ) -> None:
        super().__init__()
        self.set_name("recorded_input")
        robot = DiffDrive() if robot is None else robot
        check_robot(robot)
        self._size = len(robot.command_names)
        rows = self._checked(np.zeros((0, self._size)) if commands is None else commands)
        self._period = period
        self._rows_index = self.DeclareAbstractParameter(Value(rows))
        self._command_index = self.DeclareDiscreteState(self._row(rows, 0))
        self._command_port = self.DeclareStateOutputPort("human_command", self._command_index)
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def get_human_command_output_port(self) -> OutputPort:
        """The port ``human_command``."""
        return self._command_port

    def SetRecording(self, context: Context, commands: ArrayLike) -> None:
        """Sets the commands (n, M) that ``context`` plays, from the first row on.

        Raises:
            InputError: They have another shape or are not finite.
        """
        rows = self._checked(commands)
        context.get_mutable_abstract_parameter(self._rows_index).set_value(rows)
        context.SetDiscreteState(self._command_index, self._row(rows, 0))

    set_recording = SetRecording

    def _update(self, context: Context, state: DiscreteValues) -> None:
        rows = context.get_abstract_parameter(self._rows_index).get_value()
        state.set_value(self._command_index, self._row(rows, round(context.get_time() / self._period) + 1))

    def _checked(self, commands: ArrayLike) -> NDArray[np.float64]:
        rows = read_only(commands)
        if rows.ndim != 2 or rows.shape[1] != self._size:
            raise InputError("recording", "commands", f"must have shape (n, {self._size})", rows.shape)
        if not np.isfinite(rows).all():
            raise InputError("recording", "commands", "must be finite")
        return rows

    def _row(self, rows: NDArray[np.float64], index: int) -> NDArray[np.float64]:
        return rows[index] if index < len(rows) else np.zeros(self._size)
