"""Checks that a system from elsewhere has the ports that a diagram connects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydrake.systems.framework import LeafSystem, PortDataType

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
        InputError: It is no LeafSystem, or a port is missing or of another size.
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
