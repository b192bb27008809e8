"""The trials of the frozen benchmark: who drives, in which scene, with which learner and arbiter."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.metrics import metrics_of
from drake_shared.common.errors import InputError
from drake_shared.experiments.common import run_in, scenario_of
from drake_shared.experiments.measures import finite_mean
from drake_shared.experiments.misprediction_cases import recovery
from drake_shared.experiments.paired_trials import demonstrations_of
from drake_shared.experiments.training import studied
from drake_shared.learners import Learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.named import OPERATORS, changes_of_route
from drake_shared.simulation.config import SharedControlConfig, config_for
from drake_shared.simulation.trial import Simulation, TrialSettings

HUMAN, AGENT = "human", "agent"
CONDITIONS: Mapping[str, Behaviour] = {
    "primary": OPERATORS["primary"].behaviour,
    "noise 0.75": OPERATORS["unskilled"].behaviour,
    "noise 1.2": Behaviour(noise=1.2),
    "delayed": OPERATORS["delayed"].behaviour,
    "late": OPERATORS["late-slow"].behaviour,
    "switching": OPERATORS["switching"].behaviour,
    "stubborn": OPERATORS["stubborn"].behaviour,
}
"""Simulated operators in scenes as they were demonstrated."""
CHANGED: Mapping[str, Sequence[str]] = {
    "unmapped": ("primary", "noise 0.75"),
    "moved": ("primary", "noise 0.75"),
    "moving": ("primary",),
}
"""Simulated operators in scenes that have changed since, by the kind of change."""
_SEED, _STRIDE = 3_000_000, 1_000
MEASURES = (
    "intent_success",
    "collision",
    "wrong_route",
    "timeout",
    "human_effort",
    "completion_time",
    "recovery",
)
"""Columns of the rows, means over trials; shares are from 0 to 1."""


def config_of(arbiter: str) -> SharedControlConfig:
    """The default config, with its safety filter, and an arbiter with options as on the command line."""
    return config_for("default", arbitration=arbiter)


@functools.lru_cache(maxsize=4)
def learner_of(scene: str, demonstrations: int, index: int) -> Learner:
    """A mixture taught with the first demonstrations of the primary operator in a scene.

    Arbiters that read modes need a mixture, and all arbiters get the same learner.
    """
    from drake_shared.learners.mixture.training import train_mixture

    (taught,) = demonstrations_of(scene, [index], count=demonstrations)
    return train_mixture(taught, seed=index, parameters=studied("default"))


def run_case(
    scene: str,
    changes: Mapping[str, str],
    arbiters: Sequence[str],
    demonstrations: int,
    index: int,
    conditions: Sequence[str],
) -> list[dict[str, Any]]:
    """Trains a learner and runs each arbiter on the same trials: one of each route, or change of route.

    Args:
        scene: File or name, in which the learner is taught.
        changes: Scenes in which the learner is tried as well, by the kind of their change.
        arbiters: With options, if any; "human" and "agent" are alone.
        demonstrations: Number of demonstrations.
        index: Of the learner, which determines demonstrations, training and trials.
        conditions: Names of `CONDITIONS`.

    Returns:
        A row for each arbiter, world and condition, with the means of `MEASURES`, None where undefined.
    """
    learner = learner_of(scene, demonstrations, index)
    rows = []
    worlds = {"as taught": scene, **changes}
    for arbiter in arbiters:
        for kind, world in worlds.items():
            wanted = {name: CONDITIONS[name] for name in conditions}
            if kind != "as taught":
                wanted = {name: one for name, one in wanted.items() if name in CHANGED[kind]}
            settings = {name: _settings(world, name, behaviour, index) for name, behaviour in wanted.items()}
            flat = [one for group in settings.values() for one in group]
            # Kept for all scenes, the diagrams would fill the memory.
            simulation = Simulation(scenario_of(world), config=config_of(arbiter))
            learners = [None if arbiter == HUMAN else learner] * len(flat)
            trials = list(run_in(simulation, learners, flat))
            for name, group in settings.items():
                part, trials = trials[: len(group)], trials[len(group) :]
                if part:
                    case = {"scene": scene, "learner": index, "demonstrations": demonstrations}
                    rows.append(
                        {**case, "arbiter": arbiter, "world": kind, "condition": name, **_means(part)}
                    )
    return rows


def _settings(world: str, condition: str, behaviour: Behaviour, index: int) -> list[TrialSettings]:
    """One trial of each route of a world, or change of route; the same for all arbiters."""
    scenario = scenario_of(world)
    routes: list[tuple[str, str | None]] = [(route.name, None) for route in scenario.routes]
    if condition == "switching":
        try:
            routes = [(route.name, then.name) for route, then in changes_of_route(scenario)]
        except InputError:
            return []
        behaviour = OPERATORS["switching"].behaviour_in(scenario)
    seed = _SEED + _STRIDE * index
    return [
        TrialSettings(route=route, then=then, seed=seed + number, behaviour=behaviour)
        for number, (route, then) in enumerate(routes)
    ]


def _means(trials: Sequence[Any]) -> dict[str, Any]:
    """Means of `MEASURES` over trials, and their number."""
    found: dict[str, list[float]] = {name: [] for name in MEASURES}
    for trial, measured in zip(trials, metrics_of(trials), strict=True):
        values: dict[str, Any] = dict(measured)
        values["wrong_route"] = bool(measured["success"] and not measured["intent_success"])
        values["recovery"] = _recovery(trial)
        for name in MEASURES:
            found[name].append(math.nan if values[name] is None else float(values[name]))
    means = {name: finite_mean(values) for name, values in found.items()}
    plain = {name: None if np.isnan(value) else value for name, value in means.items()}
    return {**plain, "trials": len(trials)}


def _recovery(trial: Any) -> float:
    """Time from a change of route until w is above 0.5, in [s]; to the end of the trial if it never is."""
    if trial.metadata["then"] is None:
        return math.nan
    start = float(trial.metadata["behaviour"]["switch_time"])
    found = recovery(trial, start)
    if found["weight"] == "never":
        return float(trial["t"][-1] - start)
    recovered: float = {"above": 0.0, "back": found["recovery"]}.get(found["weight"], math.nan)
    return recovered
