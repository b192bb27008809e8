"""Trials that are the same but for what is compared: demonstrations, routes and seeds by index.

A learner's demonstrations begin at seed 100 000 + 1 000 i, its trials at 500 000 + 1 000 i;
i is its index, and the seed of its training. Drives that are repeated take seeds beyond a million.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.demonstrations import Demonstrations
from drake_shared.experiments.common import as_demonstrations, drives, scenario_of
from drake_shared.operators.named import changes_of_route, named_operator

_DEMONSTRATED, _DRIVEN, _APART = 100_000, 500_000, 1_000


def taught(scenario: str | None, learner: int, *, count: int | None = None) -> Demonstrations:
    """What a learner is taught by the primary operator; fewer are the first of more.

    Args:
        scenario: File or name.
        learner: Its index, below 400.
        count: How many, at most 1000; one for each route if None.
    """
    count = count or len(scenario_of(scenario).routes)
    seed = _DEMONSTRATED + _APART * learner
    return as_demonstrations(scenario, drives(scenario, count=count, seed=seed))


def settings(scenario: str | None, operator: str, learner: int, trial: int) -> dict[str, Any]:
    """Route, seed and behaviour of a trial of an operator, as `setting.run` takes them; routes take turns."""
    world, named = scenario_of(scenario), named_operator(operator)
    told: dict[str, Any] = {
        "seed": _DRIVEN + _APART * learner + trial,
        "behaviour": named.behaviour_in(world),
    }
    if named.switches:
        changes = changes_of_route(world)
        route, then = changes[trial % len(changes)]
        return {**told, "route": route.name, "then": then.name}
    return {**told, "route": world.routes[trial % len(world.routes)].name}


def by_learner(rows: Iterable[Mapping[str, Any]], measure: str, **told: Any) -> np.ndarray:
    """The mean of a measure over the trials of each learner, shape (learners,), by their index.

    Args:
        rows: Of trials, each with its ``learner``.
        measure: Its name; None and NaN do not count, and a learner without any other value has NaN.
        told: Only rows that say this.
    """
    found: dict[int, list[float]] = {}
    for row in rows:
        if all(row[key] == value for key, value in told.items()):
            value = row[measure]
            found.setdefault(row["learner"], []).append(np.nan if value is None else float(value))
    return np.array([_mean(found[learner]) for learner in sorted(found)])


def groups(count: int, size: int) -> list[list[int]]:
    """The indices below ``count``, in groups of at most ``size``."""
    return [list(range(begin, min(begin + size, count))) for begin in range(0, count, size)]


def _mean(values: Sequence[float]) -> float:
    finite = np.array(values)[np.isfinite(values)]
    return float(finite.mean()) if finite.size else np.nan
