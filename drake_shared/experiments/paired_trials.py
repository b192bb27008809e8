"""Paired trials: demonstrations, routes and seeds depend only on the indices of learner and trial.

The demonstrations of learner i have seeds from 100 000 + 1 000 i on, its trials from 500 000 + 1 000 i on,
and its training has seed i. Drives that are repeated have seeds above a million.
"""

from __future__ import annotations

from typing import Any

from drake_shared.demonstrations import Demonstrations
from drake_shared.experiments.common import as_demonstrations, demonstrate, scenario_of
from drake_shared.operators.named import changes_of_route, named_operator

_DEMONSTRATION_SEED, _TRIAL_SEED, _STRIDE = 100_000, 500_000, 1_000


def demonstrations_of(scenario: str | None, learner: int, *, count: int | None = None) -> Demonstrations:
    """The demonstrations of a learner by the primary operator; a smaller set is the start of a larger one.

    Args:
        scenario: File or name.
        learner: Its index, below 400.
        count: Number of demonstrations, at most 1000; one of each route if None.
    """
    seed = _DEMONSTRATION_SEED + _STRIDE * learner
    return as_demonstrations(scenario, demonstrate(scenario, count=count, seed=seed))


def settings_of(scenario: str | None, operator: str, learner: int, trial: int) -> dict[str, Any]:
    """Route, seed and behaviour of a trial of an operator with a learner, as keyword arguments of `run`."""
    seed = _TRIAL_SEED + _STRIDE * learner + trial
    return {"seed": seed, **route_settings(scenario, operator, trial)}


def route_settings(scenario: str | None, operator: str, trial: int) -> dict[str, Any]:
    """Behaviour and route of a trial of an operator; trials alternate between routes, or changes of route."""
    world, named = scenario_of(scenario), named_operator(operator)
    behaviour = {"behaviour": named.behaviour_in(world)}
    if named.switches:
        changes = changes_of_route(world)
        route, then = changes[trial % len(changes)]
        return {**behaviour, "route": route.name, "then": then.name}
    return {**behaviour, "route": world.routes[trial % len(world.routes)].name}


def groups(count: int, size: int) -> list[list[int]]:
    """The indices below ``count``, in groups of at most ``size``."""
    return [list(range(begin, min(begin + size, count))) for begin in range(0, count, size)]
