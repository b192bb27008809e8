"""Constant-weight arbitration."""

from __future__ import annotations

from typing import Any

from pydrake.systems.framework import Context

from drake_shared.common.errors import InputError
from drake_shared.robots import Robot
from drake_shared.systems.arbiter import Arbiter


class ConstantWeightBlender(Arbiter):
    """Blends both commands with a constant weight, whatever the confidence.

    .. pydrake_system::

        name: ConstantWeightBlender
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        output_ports:
        - shared_command
        - human_weight

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`.

    Args:
        weight: w, from 0 to 1.
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.

    Raises:
        InputError: The weight is out of range.
    """

    def __init__(
        self,
        weight: float = 0.5,
        *,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
    ) -> None:
        super().__init__(
            robot=robot, period=period, driver=driver, weight_inputs=("autonomous_command", "confidence")
        )
        if not 0.0 <= weight <= 1.0:
            raise InputError("ConstantWeightBlender", "weight", "must be from 0 to 1", weight)
        self._weight = float(weight)

    @property
    def configuration(self) -> dict[str, Any]:
        """The weight."""
        return {"weight": self._weight}

    def DoCalcWeight(self, context: Context) -> float:
        """The constant weight."""
        return self._weight
