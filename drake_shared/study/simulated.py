"""Simulated participants: their behaviours, and their trials. What they do is not evidence about people."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from drake_shared.analysis.operator_fit import FITTED, fit_operator
from drake_shared.experiments.common import run_in
from drake_shared.learners import load_learner
from drake_shared.operators.behaviour import LONGEST_DELAY, Behaviour
from drake_shared.simulation.log import Trial
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.study.design import Study
from drake_shared.study.steps import Step

# Spread between simulated participants, as the standard deviation of the logarithm of each parameter.
_SPREAD = {"delay": 0.2, "noise": 0.5, "speed_factor": 0.08}
_BASE = Behaviour(noise=0.3)


def simulated_behaviours(count: int, *, seed: int, fitted: Sequence[Behaviour] = ()) -> list[Behaviour]:
    """A behaviour for each simulated participant.

    Args:
        count: Number of participants.
        seed: Of their differences.
        fitted: To people in pilot drives. Each participant is one of them, drawn at random, and varied; the
            primary operator with more noise is varied if there is none.
    """
    random = np.random.default_rng([seed, 7])
    found = []
    for _ in range(count):
        base = fitted[int(random.integers(len(fitted)))] if fitted else _BASE
        varied = {
            name: float(getattr(base, name) * np.exp(spread * random.standard_normal()))
            for name, spread in _SPREAD.items()
        }
        varied["delay"] = min(varied["delay"], LONGEST_DELAY)
        found.append(dataclasses.replace(base, **varied))
    return found


def fitted_behaviour(trials: Sequence[Trial], names: Sequence[str]) -> Behaviour:
    """The simulated operator that is fitted to the pilot drives of a person; see `fit_operator`.

    Raises:
        InputError: The drives are not of one operator in one scenario, or hold too little motion.
    """
    fit = fit_operator(trials, names=names)
    found = {name: getattr(fit, name) for name in FITTED}
    values = {name: max(0.0, estimate.value) for name, estimate in found.items() if estimate is not None}
    return Behaviour(**values, speed_factor=fit.speed_factor)


def run_steps(
    simulation: Simulation, steps: Sequence[Step], behaviours: Sequence[Behaviour]
) -> Iterator[Trial]:
    """Runs trials of one condition, in lock-step where that is possible, and yields them in order.

    Args:
        simulation: Of the condition; see `simulation_of`.
        steps: The trials.
        behaviours: Of the participant of each.
    """
    settings = [
        TrialSettings(route=step.route, seed=step.seed, behaviour=behaviour)
        for step, behaviour in zip(steps, behaviours, strict=True)
    ]
    return run_in(simulation, [None] * len(steps), settings)


def simulation_of(study: Study, condition: str) -> Simulation:
    """The diagram of a condition, with simulated operators."""
    file = study.learner_of(condition)
    learner = None if file is None else load_learner(file)
    return Simulation(study.load_scenario(), learner=learner, config=study.conditions[condition].config)
