"""Operator that a person drives by mouse, keys or gamepad, for the tip of an arm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues

from drake_shared.robots import Arm, Robot
from drake_shared.systems.mouse_input import MouseInput, MouseSample, MouseSource


class TipInput(MouseInput):
    """A `MouseInput` with a third axis, and with two planes in which the stick can move.

    .. pydrake_system::

        name: TipInput
        output_ports:
        - human_command
        - mouse
        - idle_time
        - planes

    Outputs, beside those of `MouseInput`:
        human_command (3): Velocity of the tip, in [m/s]. The stick moves it along x and y, the third axis
            along z; in the plane y-z (Herlant et al. 2016) the stick moves it along z and y.
        planes (2): 0 for the plane x-y, 1 for y-z; and the number of switches. State; part of the log.

    Args:
        robot: The arm.
        source: Read once a period.
        options: Further arguments of `MouseInput`.
    """

    log_columns: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **MouseInput.log_columns,
        "planes": ("plane", "plane_switches"),
    }

    def __init__(
        self, *, robot: Arm, source: MouseSource, max_speed: float | None = None, **options: Any
    ) -> None:
        super().__init__(
            robot=robot,
            source=source,
            max_speed=robot.max_speed if max_speed is None else max_speed,
            **options,
        )
        self.set_name("tip_input")
        self._arm = robot
        self._planes = self.DeclareDiscreteState(2)
        self.DeclareStateOutputPort("planes", self._planes)

    def _command_of(self, sample: MouseSample, forward: float, left: float, up: float) -> tuple[float, ...]:
        ahead, lifted = (0.0, forward) if sample.vertical else (forward, up)
        return self._arm.limited([self.max_speed * part for part in (ahead, left, lifted)])

    def _update(self, context: Context, state: DiscreteValues) -> None:
        super()._update(context, state)
        plane, switches = context.get_discrete_state(self._planes).value().tolist()
        vertical = float(self._source.latest().vertical)
        state.set_value(self._planes, np.array([vertical, switches + (vertical != plane)]))


def make_mouse_input(robot: Robot, source: MouseSource) -> MouseInput:
    """The operator that turns a person's input into commands of ``robot``."""
    if isinstance(robot, Arm):
        return TipInput(robot=robot, source=source)
    return MouseInput(robot=robot, source=source)
