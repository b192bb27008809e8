"""Which arbiters there are: those of this package, and those that others register.

An arbiter divides the control. It is a LeafSystem with the ports of
`drake_shared.systems.confidence_blender.ConfidenceBlender`: inputs ``human_command`` (2),
``autonomous_command`` (2) and ``confidence`` (1), outputs ``shared_command`` (2) and ``human_weight`` (1).
What JSON can hold in an attribute ``configuration`` goes into every log.

One from outside is registered under its name in the entry point group ``drake_shared.arbiters``: a class, or
anything else that returns such a system when called. It is given the arguments ``period`` (of the control
step, in [s]) and ``robot`` if it takes them, and none else.
"""

from __future__ import annotations

import functools
import inspect
import json
from collections.abc import Callable, Container
from typing import Any

from pydrake.systems.framework import LeafSystem, PortDataType

from drake_shared.arbitration.authority import Authority, authority_for
from drake_shared.common.entry_points import load_registered, registered_names
from drake_shared.common.errors import InputError
from drake_shared.scenario import Scenario
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.constant_weight_blender import ConstantWeightBlender
from drake_shared.systems.traded_control import TradedControl

GROUP = "drake_shared.arbiters"
DEFAULT = "blend"
_BUILT_IN: dict[str, Callable[..., LeafSystem]] = {
    DEFAULT: ConfidenceBlender,
    "halves": functools.partial(ConstantWeightBlender, 0.5),
    "traded": TradedControl,
    "human": functools.partial(ConstantWeightBlender, 1.0),
    "agent": functools.partial(ConstantWeightBlender, 0.0),
}
_INPUTS = {"human_command": 2, "autonomous_command": 2, "confidence": 1}
_OUTPUTS = {"shared_command": 2, "human_weight": 1}


def arbiter_names() -> list[str]:
    """Names of all arbiters that are registered."""
    return sorted({*_BUILT_IN, *registered_names(GROUP)})


def make_arbiter(
    name: str,
    scenario: Scenario,
    *,
    preset: str | None = None,
    authority: Authority | bool | None = None,
) -> LeafSystem:
    """A new arbiter of that name, for the robot and the control period of ``scenario``.

    Args:
        name: As the command line calls it.
        scenario: The task.
        preset: Of the learner, which decides on the authority if nobody else does.
        authority: What "blend" leaves to the human: True is the default, False nothing, None by preset.

    Raises:
        InputError: There is none of that name, or what was registered cannot be imported, cannot be made or
            has not the ports of an arbiter; or authority is asked of one that has none.
    """
    make = _find(name)
    offered = {"period": scenario.control_period, "robot": scenario.robot}
    if name == DEFAULT:
        if isinstance(authority, bool):
            authority = Authority() if authority else None
        elif authority is None:
            authority = authority_for(preset)
        make = functools.partial(make, authority=authority)
    elif authority:
        raise InputError("authority", "", f"must be left out where {name!r} divides the control")
    try:
        arbiter = make(**{key: value for key, value in offered.items() if key in _parameters(make)})
    except Exception as error:  # What others register may fail in any way.
        why = f"{type(error).__name__}: {error}"
        raise InputError("arbitration", "", f"{name!r} cannot be made ({why})") from error
    check_arbiter(arbiter, name)
    return arbiter


def check_arbiter(arbiter: Any, name: str) -> None:
    """Refuses what has not the ports of an arbiter.

    Raises:
        InputError: Says which port it lacks.
    """
    if not isinstance(arbiter, LeafSystem):
        raise InputError("arbitration", "", f"{name!r} must be a LeafSystem", type(arbiter).__name__)
    kinds = (
        ("input", _INPUTS, arbiter.HasInputPort, arbiter.GetInputPort),
        ("output", _OUTPUTS, arbiter.HasOutputPort, arbiter.GetOutputPort),
    )
    for kind, sizes, has, get in kinds:
        for port, size in sizes.items():
            sound = has(port) and get(port).get_data_type() == PortDataType.kVectorValued
            if not (sound and get(port).size() == size):
                raise InputError("arbitration", "", f"{name!r} must have an {kind} port {port!r} ({size})")


def describe_arbiter(arbiter: LeafSystem, name: str | None = None) -> dict[str, Any]:
    """Name and whole configuration of an arbiter, as a log keeps them.

    Args:
        arbiter: The system.
        name: By which it was asked for, if it was.

    Raises:
        InputError: JSON cannot hold its configuration.
    """
    if name is None:
        name = DEFAULT if type(arbiter) is ConfidenceBlender else type(arbiter).__name__
    configuration = getattr(arbiter, "configuration", {})
    try:
        configuration = json.loads(json.dumps(configuration, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise InputError("arbitration", "configuration", f"of {name!r} must be JSON ({error})") from error
    return {"name": name, "configuration": configuration}


def _find(name: str) -> Callable[..., LeafSystem]:
    if name in _BUILT_IN:
        return _BUILT_IN[name]
    found = load_registered(GROUP, name, source="arbitration")
    if found is None:
        raise InputError("arbitration", "", f"must be one of {', '.join(arbiter_names())}", repr(name))
    return found


def _parameters(make: Callable[..., LeafSystem]) -> Container[str]:
    try:
        return inspect.signature(make).parameters
    except ValueError:
        return ()  # What a class inherits from Drake itself has no signature, and takes nothing.
