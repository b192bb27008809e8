"""Shared by the experiments: scenarios, trials in batches, and demonstrations of simulated operators."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from drake_shared.analysis.metrics import metrics
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners import Learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import Scenario, clearance_scorer, load_scenario
from drake_shared.simulation.config import SharedControlConfig, blend_for
from drake_shared.simulation.lockstep.engine import Lockstep
from drake_shared.simulation.lockstep.support import unsupported
from drake_shared.simulation.teaching import demonstration_of
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings

ALONE_COST, TRIAL_COST = 0.004, 0.012
"""Approximate time of a trial among many on one core, in [s]: of the human alone, and with a learner."""
# A drive that failed is repeated with a seed so far away that no two ranges of seeds overlap.
_NEXT_SEED, ATTEMPTS = 1_000_003, 20


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


def run_all(
    scenario: str | None,
    learners: Sequence[Learner | None],
    settings: Sequence[TrialSettings],
    *,
    config: SharedControlConfig | None = None,
) -> Iterator[Trial]:
    """Runs trials with simulated operators, together where possible; yields them in order.

    Args:
        scenario: File or name.
        learners: One for each trial, all of one preset; where it is None the human drives alone.
        settings: Of each trial.
        config: How control is shared; if None, the config of the learners' preset.
    """
    if not settings:
        return iter(())
    preset = next((learner.preset for learner in learners if learner is not None), None)
    return run_in(simulation_of(scenario, config or blend_for(preset)), learners, settings)


def run_in(
    simulation: Simulation, learners: Sequence[Learner | None], settings: Sequence[TrialSettings]
) -> Iterator[Trial]:
    """Runs trials of a simulation: in lock-step, or one after the other in Drake where it has to be."""
    if any(unsupported(simulation, one) for one in {id(one): one for one in learners}.values()):
        return map(lambda given, one: simulation.run(given, learner=one), settings, learners)
    return Lockstep(simulation).run(settings, learners=learners)


def row_of(trial: Trial, **columns: Any) -> dict[str, Any]:
    """A row with these columns and the seed, the route and the metrics of a trial."""
    return {
        **columns,
        "seed": trial.metadata["seed"],
        "route": trial.metadata["route"],
        **metrics(trial),
    }


@dataclasses.dataclass(frozen=True, kw_only=True)
class Teaching:
    """Demonstrations to be made; they alternate between the routes.

    Attributes:
        seed: Of the first; each later one has the next seed.
        learner: Shares the control; without one the operator is alone.
        count: Number of demonstrations; one of each route if None.
        behaviour: Of the operator.
    """

    seed: int
    learner: Learner | None = None
    count: int | None = None
    behaviour: Behaviour = dataclasses.field(default_factory=Behaviour)


def demonstrate(scenario: str | None, teaching: Sequence[Teaching]) -> list[list[Demonstration] | RunError]:
    """Demonstrations by simulated operators, scored by clearance.

    A drive that collides or does not reach the goal is repeated with another seed.

    Args:
        scenario: File or name.
        teaching: Each gives a set; the learners that take part are all of one preset.

    Returns:
        For each set its demonstrations, or the error that the operator failed in 20 attempts.
    """
    world = scenario_of(scenario)
    score = clearance_scorer(world)
    presets = {one.learner.preset for one in teaching if one.learner is not None}
    config = blend_for(max(presets, default=None), end="duration")
    counts = [len(world.routes) if one.count is None else one.count for one in teaching]
    waiting = [(index, drive) for index, count in enumerate(counts) for drive in range(count)]
    made: dict[tuple[int, int], Demonstration] = {}
    for attempt in range(ATTEMPTS):
        learners = [teaching[index].learner for index, _ in waiting]
        settings = [
            TrialSettings(
                route=world.routes[drive % len(world.routes)].name,
                seed=teaching[index].seed + drive + attempt * _NEXT_SEED,
                behaviour=teaching[index].behaviour,
            )
            for index, drive in waiting
        ]
        trials = run_all(scenario, learners, settings, config=config)
        for place, trial in zip(waiting, trials, strict=True):
            if trial.status == "reached" and not trial["contact"].any():
                made[place] = demonstration_of(trial, score=score(trial.positions))
        waiting = [place for place in waiting if place not in made]
        if not waiting:
            break
    failed = {index: world.routes[drive % len(world.routes)].name for index, drive in reversed(waiting)}
    return [
        RunError(f"the simulated operator fails on route {failed[index]} in {ATTEMPTS} attempts")
        if index in failed
        else [made[index, drive] for drive in range(count)]
        for index, count in enumerate(counts)
    ]


def demonstrated(scenario: str | None, teaching: Sequence[Teaching]) -> list[Demonstrations]:
    """The sets of demonstrations of `demonstrate`.

    Raises:
        RunError: An operator fails in 20 attempts.
    """
    sets = []
    for found in demonstrate(scenario, teaching):
        if isinstance(found, RunError):
            raise found
        sets.append(as_demonstrations(scenario, found))
    return sets


def as_demonstrations(scenario: str | None, items: Iterable[Demonstration]) -> Demonstrations:
    """Demonstrations of a scenario as one set."""
    return Demonstrations(items=tuple(items), metadata={"scenario": scenario_of(scenario).name})
