"""What the experiments share: operators' demonstrations, learners taught by them, trials with them."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Sequence
from typing import Any

from drake_shared.analysis.metrics import metrics
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners import Learner
from drake_shared.learners.cnmp.parameters import PRESETS, TrainingParameters
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import Scenario, clearance_scorer, load_scenario
from drake_shared.simulation.config import SharedControlConfig, config_for
from drake_shared.simulation.teaching import demonstration_of
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings

# Three demonstrations need less than sixty: with half the samples and fewer iterations learners predict fresh
# drives as well, in a fifth of the time, and an experiment can afford many.
STUDIED = {
    "default": dataclasses.replace(PRESETS["default"], iterations=1_200, batch=32),
    "paper": PRESETS["paper"],
}
ALONE_COST, TRIAL_COST = 0.04, 0.08
"""Seconds of one core that a trial takes, roughly: of the human alone, and with a learner."""
# More than so many learners at once no longer fit into a processor's cache.
SIDE_BY_SIDE = 30
# A seed that fails is followed by another so far away that no two lists of seeds meet.
_NEXT_SEED, _ATTEMPTS = 1_000_003, 20


def studied(preset: str) -> TrainingParameters:
    """How learners of a preset are trained in experiments."""
    return STUDIED[preset]


def train_all(
    taught: Sequence[Demonstrations],
    seeds: Sequence[int],
    *,
    preset: str,
    weighted: bool | Sequence[bool] = True,
) -> list[Any]:
    """A CNMP for each set of demonstrations, trained side by side. Imports torch."""
    from drake_shared.learners.cnmp.training import train_together

    lean = [weighted] * len(taught) if isinstance(weighted, bool) else list(weighted)
    trained: list[Any] = []
    for begin in range(0, len(taught), SIDE_BY_SIDE):
        part = slice(begin, begin + SIDE_BY_SIDE)
        trained += train_together(taught[part], seeds[part], weighted=lean[part], parameters=studied(preset))
    return trained


def training_cost(preset: str, count: int) -> float:
    """Seconds of one core that `train_all` takes for ``count`` learners, roughly, while others train too.

    Optimising is bound by memory, which processes share: one alone is quicker.
    """
    groups = -(-count // SIDE_BY_SIDE)
    return 8.5 * groups + 3.5 * count if preset == "paper" else 4.0 * groups + 1.2 * count


@functools.cache
def scenario_of(scenario: str | None) -> Scenario:
    """The scenario of that file or name, read once in a process."""
    return load_scenario(scenario)


@functools.cache
def simulation_of(
    scenario: str | None,
    config: SharedControlConfig,
) -> Simulation:
    """The diagram of scenario and config, built once in a process; any learner may take part."""
    return Simulation(scenario_of(scenario), config=config)


def run(
    scenario: str | None,
    learner: Learner | None,
    *,
    config: SharedControlConfig | None = None,
    **settings: Any,
) -> Trial:
    """One trial with a simulated operator.

    Args:
        scenario: File or name.
        learner: Takes part; the human drives alone without one.
        config: How control is shared; if None, the one that the learner's preset names.
        settings: See `drake_shared.simulation.trial.TrialSettings`.
    """
    simulation = simulation_of(scenario, config or config_for(None if learner is None else learner.preset))
    return simulation.run(TrialSettings(**settings), learner=learner)


def measured(trial: Trial, **told: Any) -> dict[str, Any]:
    """A trial's metrics as a row, with what else is to be told of it, its seed and its route."""
    return {
        **told,
        "seed": trial.metadata["seed"],
        "route": trial.metadata["route"],
        **metrics(trial),
    }


def drives(
    scenario: str | None,
    *,
    learner: Learner | None = None,
    count: int,
    seed: int,
    behaviour: Behaviour | None = None,
) -> list[Demonstration]:
    """Drives that reached the goal without contact, as demonstrations scored by clearance; routes take turns.

    A drive that failed is repeated with another seed.

    Args:
        scenario: File or name.
        learner: Shares the control; the operator is alone without one.
        count: How many.
        seed: Of the first; each following one has the next.
        behaviour: Of the operator.

    Raises:
        RunError: The operator fails again and again.
    """
    world = scenario_of(scenario)
    config = config_for(None if learner is None else learner.preset, end="duration")
    score = clearance_scorer(world)
    made = []
    for index in range(count):
        route = world.routes[index % len(world.routes)].name
        for attempt in range(_ATTEMPTS):
            trial = run(
                scenario,
                learner,
                config=config,
                route=route,
                seed=seed + index + attempt * _NEXT_SEED,
                behaviour=behaviour or Behaviour(),
            )
            if trial.status == "reached" and not trial["contact"].any():
                break
        else:
            raise RunError(f"the simulated operator fails on route {route} in {_ATTEMPTS} attempts")
        made.append(demonstration_of(trial, score=score(trial.positions)))
    return made


def as_demonstrations(scenario: str | None, items: Iterable[Demonstration]) -> Demonstrations:
    """Demonstrations of a scenario as one set."""
    return Demonstrations(items=tuple(items), metadata={"scenario": scenario_of(scenario).name})
