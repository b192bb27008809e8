"""Shared by the experiments: scenarios, diagrams, trials, and demonstrations of simulated operators."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any

from drake_shared.analysis.metrics import metrics
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners import Learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import Scenario, clearance_scorer, load_scenario
from drake_shared.simulation.config import SharedControlConfig, config_for
from drake_shared.simulation.teaching import demonstration_of
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings

ALONE_COST, TRIAL_COST = 0.04, 0.08
"""Approximate time of a trial on one core, in [s]: of the human alone, and with a learner."""
# A drive that failed is repeated with a seed so far away that no two ranges of seeds overlap.
_NEXT_SEED, _ATTEMPTS = 1_000_003, 20


@functools.cache
def scenario_of(scenario: str | None) -> Scenario:
    """The scenario with this file or name, read once in a process."""
    return load_scenario(scenario)


def route_count(scenario: str | None) -> int:
    """The number of routes of a scenario."""
    return len(scenario_of(scenario).routes)


@functools.cache
def simulation_of(scenario: str | None, config: SharedControlConfig) -> Simulation:
    """The diagram for a scenario (file or name), built once in a process; any learner may take part."""
    return Simulation(scenario_of(scenario), config=config)


def run(
    scenario: str | None,
    learner: Learner | None,
    *,
    config: SharedControlConfig | None = None,
    **settings: Any,
) -> Trial:
    """Runs a trial with a simulated operator.

    Args:
        scenario: File or name.
        learner: Takes part; without one the human drives alone.
        config: How control is shared; if None, the config of the learner's preset.
        settings: See `drake_shared.simulation.trial.TrialSettings`.
    """
    simulation = simulation_of(scenario, config or config_for(_preset(learner)))
    return simulation.run(TrialSettings(**settings), learner=learner)


def _preset(learner: Learner | None) -> str | None:
    return None if learner is None else learner.preset


def row_of(trial: Trial, **columns: Any) -> dict[str, Any]:
    """A row with these columns and the seed, the route and the metrics of a trial."""
    return {
        **columns,
        "seed": trial.metadata["seed"],
        "route": trial.metadata["route"],
        **metrics(trial),
    }


def demonstrate(
    scenario: str | None,
    *,
    learner: Learner | None = None,
    count: int | None = None,
    seed: int,
    behaviour: Behaviour | None = None,
) -> list[Demonstration]:
    """Demonstrations by a simulated operator, scored by clearance; they alternate between the routes.

    A drive that collides or does not reach the goal is repeated with another seed.

    Args:
        scenario: File or name.
        learner: Shares the control; without one the operator is alone.
        count: Number of demonstrations; one of each route if None.
        seed: Of the first; each later one has the next seed.
        behaviour: Of the operator.

    Raises:
        RunError: The operator fails in 20 attempts.
    """
    world = scenario_of(scenario)
    config = config_for(_preset(learner), end="duration")
    score = clearance_scorer(world)
    made = []
    for index in range(len(world.routes) if count is None else count):
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
