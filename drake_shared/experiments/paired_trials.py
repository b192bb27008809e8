"""Paired trials: demonstrations, routes and seeds depend only on the indices of learner and trial.

The demonstrations of learner i have seeds from 100 000 + 1 000 i on, its trials from 500 000 + 1 000 i on,
and its training has seed i. Drives that are repeated have seeds above a million.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from drake_shared.demonstrations import Demonstrations
from drake_shared.experiments.common import Teaching, demonstrated, row_of, run_all, scenario_of
from drake_shared.experiments.training import stopped_early
from drake_shared.learners import Learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.named import changes_of_route, named_operator
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import Trial, TrialSettings

_DEMONSTRATION_SEED, _TRIAL_SEED, _STRIDE = 100_000, 500_000, 1_000


@dataclasses.dataclass(frozen=True, kw_only=True)
class Condition:
    """A condition in which learners are tried.

    Attributes:
        columns: Its values in the rows.
        operator: Name of the simulated operator.
        behaviour: In place of that operator's.
        config: How control is shared; if None, the config of the learners' preset.
        gain_factor: On the learner's K of eq. (1).
        alone: Whether the human drives without the learner.
    """

    columns: Mapping[str, Any]
    operator: str = "primary"
    behaviour: Behaviour | None = None
    config: SharedControlConfig | None = None
    gain_factor: float = 1.0
    alone: bool = False

    def settings(
        self, scenario: str | None, index: int, learner: Learner | None, trial: int
    ) -> TrialSettings:
        """The settings of a trial with the learner of an index."""
        settings = settings_of(scenario, self.operator, index, trial)
        if self.behaviour is not None:
            settings = dataclasses.replace(settings, behaviour=self.behaviour)
        if self.gain_factor != 1.0 and learner is not None:
            gain = self.gain_factor * learner.confidence_gain
            settings = dataclasses.replace(settings, confidence_gain=gain)
        return settings


def run_conditions(
    scenario: str | None,
    learners: Mapping[int, Learner | None],
    conditions: Sequence[Condition],
    trials: int,
    *,
    measure: Callable[[Trial], Mapping[str, Any]] = lambda _: {},
) -> list[dict[str, Any]]:
    """Runs the same trials with each learner in each condition; those with the same config run together.

    Args:
        scenario: File or name.
        learners: By index, all of one preset.
        conditions: In which all learners are tried.
        trials: Number of trials with each learner in each condition.
        measure: Further columns, from each trial.

    Returns:
        A row for each trial: the condition's columns, ``learner``, K as ``confidence_gain``, and those of
        `row_of`.
    """
    rows = []
    for config in dict.fromkeys(condition.config for condition in conditions):
        runs = [
            (condition, (index, None if condition.alone else learner, trial))
            for condition in conditions
            if condition.config == config
            for index, learner in learners.items()
            for trial in range(trials)
        ]
        driven = run_all(
            scenario,
            [learner for _, (_, learner, _) in runs],
            [condition.settings(scenario, *of) for condition, of in runs],
            config=config,
        )
        for (condition, (index, learner, _)), trial in zip(runs, driven, strict=True):
            gain = trial.metadata["confidence_gain"]
            columns = {**condition.columns, "learner": index, "confidence_gain": gain}
            columns["stopped_early"] = stopped_early(learner)
            rows.append(row_of(trial, **columns, **measure(trial)))
    return rows


def demonstrations_of(
    scenario: str | None, learners: Sequence[int], *, count: int | None = None
) -> list[Demonstrations]:
    """The demonstrations of each learner by the primary operator; a smaller set begins a larger one.

    Args:
        scenario: File or name.
        learners: Their indices, below 400.
        count: Number of demonstrations, at most 1000; one of each route if None.
    """
    return demonstrated(
        scenario, [Teaching(seed=_DEMONSTRATION_SEED + _STRIDE * index, count=count) for index in learners]
    )


def settings_of(scenario: str | None, operator: str, learner: int, trial: int) -> TrialSettings:
    """Route, seed and behaviour of a trial of an operator with a learner."""
    return route_settings(scenario, operator, trial, seed=_TRIAL_SEED + _STRIDE * learner + trial)


def route_settings(scenario: str | None, operator: str, trial: int, **settings: Any) -> TrialSettings:
    """Settings of a trial of an operator; trials alternate between routes, or changes of route."""
    world, named = scenario_of(scenario), named_operator(operator)
    routes: list[tuple[str, str | None]] = [(route.name, None) for route in world.routes]
    if named.switches:
        routes = [(route.name, then.name) for route, then in changes_of_route(world)]
    route, then = routes[trial % len(routes)]
    return TrialSettings(route=route, then=then, behaviour=named.behaviour_in(world), **settings)


def groups(count: int, size: int) -> list[list[int]]:
    """The indices below ``count``, in groups of at most ``size``."""
    return [list(range(begin, min(begin + size, count))) for begin in range(0, count, size)]
