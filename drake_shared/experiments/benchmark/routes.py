"""Demonstrations to learn routes from and to test with, and how far a prediction is off."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners.dataset import resample
from drake_shared.scenario import Scenario
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.surrogate_operator import Behaviour

Array = NDArray[np.float64]

NOISE = 0.03
"""Standard deviation of an observed position, in [m] along each axis."""
APART = 0.15
"""Routes are apart where they leave a gap of so many metres in x or y."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Routes:
    """Demonstrations to train on, and cases to test with: a single observation where routes are apart.

    Attributes:
        training: What to train on.
        grid: Shape (N,), in [s].
        paths: Shape (m, N, 2), the training demonstrations on the grid, in [m].
        steps: Shape (C,), at which step of the grid each observation was made.
        observed: Shape (C, 2), where, noise included, in [m].
        truth: Shape (C, N, 2), the demonstration that was observed, in [m].
    """

    training: Demonstrations
    grid: Array
    paths: Array
    steps: NDArray[np.intp]
    observed: Array
    truth: Array

    def error(self, means: Array) -> float:
        """Root of the mean squared distance of ``means`` (C, N, 2) from the truth, in [m]."""
        return float(np.sqrt(np.square(means - self.truth).sum(axis=-1).mean()))


def make_routes(training: Demonstrations, test: Demonstrations, *, steps: int = 151) -> Routes:
    """Puts demonstrations on one grid and makes the test's cases: every third step at which routes are apart.

    Raises:
        InputError: The routes of the test are nowhere apart.
    """
    last = max(float(item.times[-1] - item.times[0]) for item in (*training, *test))
    grid = np.linspace(0.0, last, steps)
    paths = np.stack([resample(item, grid) for item in training])
    tested = np.stack([resample(item, grid) for item in test])
    gap = np.diff(np.sort(tested, axis=0), axis=0).max(axis=(0, 2), initial=0.0)
    informative = np.flatnonzero(gap > APART)[::3]
    if not len(informative):
        expected = f"must hold routes that are more than {APART} m apart somewhere"
        raise InputError(test.source, "", expected)
    which = np.repeat(np.arange(len(tested)), len(informative))
    when = np.tile(informative, len(tested))
    noise = NOISE * np.random.default_rng(0).standard_normal((len(when), 2))
    return Routes(
        training=training,
        grid=grid,
        paths=paths,
        steps=when,
        observed=tested[which, when] + noise,
        truth=tested[which],
    )


def drive_routes(scenario: Scenario, *, count: int, seed: int = 0) -> Demonstrations:
    """Demonstrations by the simulated operator along the routes in turn, scaled to an extent of 1 m.

    The operator is noisy, so that no two are alike; drives that fail are left out and driven again.
    """
    simulation = Simulation(scenario)
    behaviour = Behaviour(noise=0.6)
    items: list[Demonstration] = []
    while len(items) < count:
        route = scenario.routes[len(items) % len(scenario.routes)].name
        trial = simulation.run(
            TrialSettings(mode="human", route=route, seed=seed, behaviour=behaviour, end="duration")
        )
        seed += 1
        if trial.status == "reached" and not trial["contact"].any():
            items.append(Demonstration(times=trial["t"], positions=trial.positions))
    extent = np.ptp(np.concatenate([item.positions for item in items]), axis=0).max()
    scaled = (dataclasses.replace(item, positions=item.positions / extent) for item in items)
    return Demonstrations(items=tuple(scaled), source="simulated demonstrations")
