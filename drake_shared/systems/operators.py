"""The contract of an operator, and the operators that others register.

An operator is a LeafSystem that stands for the human. M is the size of the robot's command (see
`drake_shared.robots.Robot`).

Outputs:
    human_command (M): Command, in the robot's units; without direct feedthrough from any input. Required.
    idle_time (1): Time since the controls were last touched, in [s]; infinite before. Without direct
        feedthrough. Optional.

Inputs, all optional; a diagram connects those that the operator has:
    pose: Configuration of the robot.
    human_weight (1): w of the arbiter.
    shared_command (M): Output of the arbiter.
    noise, chance: Samples of a standard normal distribution and of a uniform one over [0, 1), of any size.

An attribute ``log_columns`` (name of an output port, names of its columns) adds columns to the log.

An operator from outside is registered under its name in the entry point group ``drake_shared.operators``, as
a function ``make_operator(*, scenario, source, period) -> LeafSystem``. ``source`` is the page's input, a
:class:`~drake_shared.systems.mouse_input.MouseSource`, or None in trials without a page.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydrake.systems.framework import LeafSystem

from drake_shared.common.entry_points import make_registered, registered_names
from drake_shared.common.errors import InputError
from drake_shared.robots import Robot
from drake_shared.scenario import Scenario
from drake_shared.systems.mouse_input import MouseSource
from drake_shared.systems.ports import check_output, check_ports

GROUP = "drake_shared.operators"


def registered_operators() -> list[str]:
    """Names of the operators that are registered."""
    return registered_names(GROUP)


def make_operator(
    name: str, *, scenario: Scenario, source: MouseSource | None = None, robot: Robot | None = None
) -> LeafSystem:
    """Makes a registered operator for the control period of ``scenario``.

    Args:
        name: In the entry point group.
        scenario: The task.
        source: The page's input, if there is a page.
        robot: Whose commands it gives; that of the scenario if None.

    Raises:
        InputError: No operator has that name, it cannot be imported or made, or `check_operator` fails.
    """
    operator: LeafSystem = make_registered(
        GROUP, name, "operator", scenario=scenario, source=source, period=scenario.control_period
    )
    check_operator(operator, scenario.robot if robot is None else robot)
    return operator


def check_operator(operator: Any, robot: Robot) -> None:
    """Checks that ``operator`` fulfils the contract for ``robot``.

    Raises:
        InputError: It is not a LeafSystem; a port is missing or has another size; an output has direct
            feedthrough; the first command is not finite; or ``log_columns`` does not fit its ports.
    """
    source = f"operator {type(operator).__name__}"
    check_ports(operator, "operator", outputs={"human_command": len(robot.command_names)})
    sizes = {
        "pose": len(robot.configuration_names),
        "human_weight": 1,
        "shared_command": len(robot.command_names),
    }
    check_ports(
        operator,
        "operator",
        inputs={name: size for name, size in sizes.items() if operator.HasInputPort(name)},
        outputs={"idle_time": 1} if operator.HasOutputPort("idle_time") else {},
    )
    for name in ("human_command", "idle_time"):
        if operator.HasOutputPort(name):
            index = operator.GetOutputPort(name).get_index()
            if operator.HasDirectFeedthrough(index):
                raise InputError(source, name, "must be state, without direct feedthrough from an input")
    check_output(operator, "human_command", operator.CreateDefaultContext(), source)
    columns = operator_log_columns(operator)
    if not isinstance(columns, Mapping):
        expected = "must be a mapping of output ports to names of columns"
        raise InputError(source, "log_columns", expected, type(columns).__name__)
    for name, names in columns.items():
        check_ports(operator, "operator", outputs={name: len(names)})


def operator_log_columns(operator: LeafSystem) -> Mapping[str, tuple[str, ...]]:
    """Output ports that ``operator`` adds to the log, and the names of their columns."""
    columns: Mapping[str, tuple[str, ...]] = getattr(operator, "log_columns", {})
    return columns
