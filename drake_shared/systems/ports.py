"""Checks the ports of a system from elsewhere, and what they give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, PortDataType

from drake_shared.common.errors import InputError


def check_ports(
    system: Any,
    role: str,
    *,
    inputs: Mapping[str, int | None] | None = None,
    outputs: Mapping[str, int | None] | None = None,
) -> None:
    """Checks the ports of a system.

    Args:
        system: What was given as the system.
        role: What it is for, such as "operator".
        inputs, outputs: Size of each vector-valued port by name; None for an abstract-valued one.

    Raises:
        InputError: It is not a LeafSystem, or a port is missing or of another size.
    """
    source = f"{role} {type(system).__name__}"
    if not isinstance(system, LeafSystem):
        raise InputError(source, "", "must be a LeafSystem")
    kinds = (
        ("input", inputs or {}, system.HasInputPort, system.GetInputPort),
        ("output", outputs or {}, system.HasOutputPort, system.GetOutputPort),
    )
    for kind, sizes, has, get in kinds:
        for name, size in sizes.items():
            kept = has(name) and (get(name).get_data_type() == PortDataType.kVectorValued) == (
                size is not None
            )
            if not (kept and (size is None or get(name).size() == size)):
                of_size = "" if size is None else f" of size {size}"
                raise InputError(source, name, f"must be an {kind} port{of_size}")


def check_output(system: LeafSystem, name: str, context: Context, source: str) -> None:
    """Checks that the vector-valued output ``name`` of a system is finite in ``context``.

    Raises:
        InputError: It is not, or computing it raises an exception.
    """
    try:
        value = system.GetOutputPort(name).Eval(context)
    except Exception as error:  # A system of another package may fail in any way.
        raise InputError(source, name, f"cannot be computed ({type(error).__name__}: {error})") from error
    if not np.isfinite(value).all():
        raise InputError(source, name, "must be finite", value)


def check_inputs(builder: DiagramBuilder, system: LeafSystem, source: str, optional: Sequence[str]) -> None:
    """Checks, before ``builder`` builds, that every input port of ``system`` is connected.

    Args:
        builder: Has the system.
        system: Any.
        source: What it is, for the error message.
        optional: Names of ports that may be open.

    Raises:
        InputError: Another port is open.
    """
    for index in range(system.num_input_ports()):
        port = system.get_input_port(index)
        if port.get_name() not in optional and not builder.IsConnectedOrExported(port):
            raise InputError(source, port.get_name(), "is an input that nothing connects")
