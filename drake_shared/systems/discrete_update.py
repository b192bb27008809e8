"""Periodic discrete updates that also answer Drake's forced updates."""

from __future__ import annotations

import math
from collections.abc import Callable

from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_shared.common.errors import InputError


def DeclareDiscreteUpdate(
    system: LeafSystem, *, period: float, update: Callable[[Context, DiscreteValues], None]
) -> None:
    """Declares ``update`` as the periodic and as the forced discrete update of ``system``.

    Drake's ``CalcForcedDiscreteVariableUpdate`` ignores periodic events, so that a test or a notebook that
    steps a system by hand needs the forced one. A Simulator never triggers it: the state still moves once a
    period.

    Args:
        system: That has the discrete state.
        period: In [s].
        update: Computes the discrete state of the next step.

    Raises:
        InputError: ``period`` is not positive and finite.
    """
    check_positive(system, period=period)
    system.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, update)
    system.DeclareForcedDiscreteUpdateEvent(update)


def check_positive(system: LeafSystem, **values: float) -> None:
    """Checks arguments of a system's constructor, given by name.

    Raises:
        InputError: A value is not positive and finite.
    """
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(type(system).__name__, name, "must be positive and finite", value)
