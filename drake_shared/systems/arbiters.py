"""Arbiters by name: those of this package, and those that other packages register.

An arbiter is a LeafSystem with the inputs ``human_command`` (M), ``autonomous_command`` (M) and
``confidence`` (1) and the outputs ``shared_command`` (M) and ``human_weight`` (1); a subclass of
`drake_shared.systems.arbiter.Arbiter` has them already. Inputs named ``pose``, ``intention``, ``idle_time``
or ``clearance`` are connected too. An attribute ``configuration``, a JSON-serializable dict, is kept in logs.

Another package registers one in the entry point group ``drake_shared.arbiters``, under the name that
``--arbitration`` takes: a class, or a function that returns the system. It is called with the keyword
arguments ``robot``, ``period`` (of the control step, in [s]) and ``scenario`` if it has such parameters, and
with the options of ``--arbitration name:key=value``.
"""

from __future__ import annotations

import functools
import inspect
import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem

from drake_shared.arbitration.authority import Authority
from drake_shared.common.entry_points import load_registered, registered_names
from drake_shared.common.errors import InputError
from drake_shared.common.suggestions import suggestion
from drake_shared.robots import DiffDrive, Robot
from drake_shared.scenario import Scenario
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.consistency_shared_autonomy import ConsistencySharedAutonomy
from drake_shared.systems.constant_weight_blender import ConstantWeightBlender
from drake_shared.systems.hindsight_optimization import HindsightOptimization
from drake_shared.systems.leader_follower import LeaderFollower
from drake_shared.systems.ports import check_output, check_ports
from drake_shared.systems.posterior_fusion import PosteriorFusion
from drake_shared.systems.rt_v2 import RobotTrajectron
from drake_shared.systems.traded_control import TradedControl

GROUP = "drake_shared.arbiters"
DEFAULT = "blend"
# Values of inputs with which an arbiter is checked; others are 0.
_INPUTS = {"confidence": [0.5], "clearance": [math.inf]}
_BUILT_IN: dict[str, Callable[..., LeafSystem]] = {
    DEFAULT: ConfidenceBlender,
    "halves": functools.partial(ConstantWeightBlender, 0.5),
    "traded": TradedControl,
    "leader-follower": LeaderFollower,
    "fusion": PosteriorFusion,
    "hindsight": HindsightOptimization,
    "rt-v2": RobotTrajectron,
    "consistency": ConsistencySharedAutonomy,
}


def arbiter_names() -> list[str]:
    """Names of all registered arbiters, and "human" and "agent", which leave one of them alone."""
    return sorted({*_BUILT_IN, "human", "agent", *registered_names(GROUP)})


def find_arbiter(name: str) -> Any:
    """The class of an arbiter, or the function that makes it; None if there is none of that name.

    Raises:
        InputError: A registered one cannot be imported.
    """
    found = _BUILT_IN.get(name) or load_registered(GROUP, name, source="arbitration")
    return found.func if isinstance(found, functools.partial) else found


def make_arbiter(
    name: str,
    *,
    robot: Robot | None = None,
    period: float = 0.05,
    options: Mapping[str, float | str] | None = None,
    authority: Authority | None = None,
    driver: str = "shared",
    initial_idle_time: float = math.inf,
    scenario: Scenario | None = None,
) -> LeafSystem:
    """Makes the arbiter of that name.

    Args:
        name: As in ``--arbitration``.
        robot: States names, units and limits of commands; the Pioneer if None.
        period: Of the control step, in [s].
        options: Further arguments of the arbiter, such as the threshold of "traded".
        authority: What the human keeps with "blend".
        driver: Who drives by default, if the arbiter has such a parameter.
        initial_idle_time: See :class:`~drake_shared.systems.confidence_blender.ConfidenceBlender`.
        scenario: The task, for arbiters that know its obstacles and its goal.

    Raises:
        InputError: There is no arbiter of that name; a registered one cannot be imported or made, or lacks a
            port; an option is unknown or out of range.
    """
    make = _BUILT_IN.get(name) or load_registered(GROUP, name, source="arbitration")
    if make is None:
        expected = f"must be one of {', '.join(arbiter_names())}{suggestion(name, arbiter_names())}"
        raise InputError("arbitration", "", expected, repr(name))
    robot = robot or DiffDrive()
    given: dict[str, Any] = {
        "robot": robot,
        "period": period,
        "initial_idle_time": initial_idle_time,
        "authority": authority,
        "driver": driver,
    }
    parameters = _parameters(make)
    given = {key: value for key, value in given.items() if key in parameters}
    if scenario is not None and "scenario" in parameters:
        given["scenario"] = scenario
    known = [key for key in parameters if key not in (*given, "scenario")]
    for option in options or {}:
        if option not in known:
            has = f"has the options {', '.join(known)}" if known else "has no options"
            expected = f"is unknown: {name!r} {has}{suggestion(option, known)}"
            raise InputError("arbitration_options", option, expected)
    try:
        arbiter = make(**given, **(options or {}))
    except InputError as error:
        raise error.within(f"arbitration {name!r}") from error
    except Exception as error:  # Registered code may fail in any way.
        why = f"{type(error).__name__}: {error}"
        raise InputError("arbitration", "", f"{name!r} cannot be made ({why})") from error
    check_arbiter(arbiter, name, robot=robot)
    return arbiter


def check_arbiter(arbiter: Any, name: str, *, robot: Robot | None = None) -> None:
    """Checks that a system has the ports of an arbiter for ``robot``, and what it computes.

    Its outputs are computed for zero commands, unless it has the input ``intention``.

    Raises:
        InputError: Names the port that is missing or of another size, or whose value is not finite, out of
            range, or cannot be computed.
    """
    size = len((robot or DiffDrive()).command_names)
    source = f"arbiter {name!r}:"
    check_ports(
        arbiter,
        source,
        inputs={"human_command": size, "autonomous_command": size, "confidence": 1},
        outputs={"shared_command": size, "human_weight": 1},
    )
    if arbiter.HasInputPort("intention"):
        return
    context = arbiter.CreateDefaultContext()
    for index in range(arbiter.num_input_ports()):
        port = arbiter.get_input_port(index)
        port.FixValue(context, _INPUTS.get(port.get_name(), np.zeros(port.size())))
    source += f" {type(arbiter).__name__}"
    for output in ("human_weight", "shared_command"):
        check_output(arbiter, output, context, source)
    weight = arbiter.GetOutputPort("human_weight").Eval(context)[0]
    if not 0.0 <= weight <= 1.0:
        raise InputError(source, "human_weight", "must be from 0 to 1", weight)


def describe_arbiter(arbiter: LeafSystem, name: str | None = None) -> dict[str, Any]:
    """Name and configuration of an arbiter, as a log holds them.

    Args:
        arbiter: The system.
        name: The name in ``--arbitration``, if it was made by name.

    Raises:
        InputError: The configuration is not JSON-serializable.
    """
    if name is None:
        name = DEFAULT if type(arbiter) is ConfidenceBlender else type(arbiter).__name__
    if isinstance(arbiter, Arbiter):
        configuration = arbiter.configuration
    else:
        configuration = getattr(arbiter, "configuration", {})
    if not isinstance(configuration, Mapping):
        expected, got = f"of {name!r} must be a mapping", type(configuration).__name__
        raise InputError("arbitration", "configuration", expected, got)
    try:
        configuration = json.loads(json.dumps(configuration, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise InputError(
            "arbitration", "configuration", f"of {name!r} must be JSON-serializable ({error})"
        ) from error
    return {"name": name, "configuration": configuration}


def _parameters(make: Callable[..., LeafSystem]) -> list[str]:
    try:
        return list(inspect.signature(make).parameters)
    except ValueError:
        return []  # A class that inherits its constructor from Drake has no signature, and no parameters.
