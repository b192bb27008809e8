"""Watches an arbiter that is not a subclass of `Arbiter`."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pydrake.systems.framework import Context

from drake_shared.arbitration.blend import finite_command
from drake_shared.common.errors import RunError
from drake_shared.robots import Robot
from drake_shared.systems.arbiter import Arbiter


class ArbiterGuard(Arbiter):
    """Passes the outputs of an arbiter on, checks them, and can leave either driver alone.

    .. pydrake_system::

        name: ArbiterGuard
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        - arbiter_command
        - arbiter_weight
        output_ports:
        - shared_command
        - human_weight

    Inputs and outputs are those of :class:`~drake_shared.systems.arbiter.Arbiter`, and ``arbiter_command``
    (M) and ``arbiter_weight`` (1), the outputs of the arbiter that is watched.

    Args:
        arbiter: Name of that arbiter, for errors.
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.
    """

    def __init__(self, arbiter: str, *, robot: Robot, period: float, driver: str) -> None:
        super().__init__(robot=robot, period=period, driver=driver)
        self._arbiter = arbiter
        self._watched_command_port = self.DeclareVectorInputPort(
            "arbiter_command", len(self.robot.command_names)
        )
        self._watched_weight_port = self.DeclareVectorInputPort("arbiter_weight", 1)

    def DoCalcWeight(self, context: Context) -> float:
        """w of the arbiter."""
        weight: float = self._watched_weight_port.Eval(context).item()
        if not 0.0 <= weight <= 1.0:
            raise self._failed(context, "human_weight must be from 0 to 1", weight)
        return weight

    def DoCalcCommand(
        self, context: Context, weight: float, human: Sequence[float], autonomous: Sequence[float]
    ) -> Sequence[float]:
        """The command of the arbiter; the human's where the agent's is NaN or infinite."""
        if not math.isfinite(sum(autonomous)):
            return list(finite_command(human))
        command: list[float] = self._watched_command_port.Eval(context).tolist()
        if not math.isfinite(sum(command)):
            raise self._failed(context, "shared_command must be finite", command)
        return command

    def _failed(self, context: Context, expected: str, got: object) -> RunError:
        time = context.get_time()
        return RunError(f"arbiter {self._arbiter!r}: {expected}, got {got} at t = {time:.3f} s")
