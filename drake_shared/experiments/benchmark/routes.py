"""Demonstrations to train on and to test with, and the error of predictions."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners.dataset import resample
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import Scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import Simulation, TrialSettings

Array = NDArray[np.float64]

NOISE = 0.03
"""Standard deviation of an observed position, in [m] along each axis."""
MIN_SEPARATION = 0.15
"""Routes count as separate where they leave a gap of this size in x or y, in [m]."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class RouteData:
    """Demonstrations to train on, and test cases of one observation each where routes are separate.

    Attributes:
        training: The demonstrations to train on.
        grid: Shape (N,), in [s].
        paths: The same demonstrations on the grid: shape (m, N, 2), in [m].
        steps: Index on the grid of each case's observation: shape (C,).
        observed: Observed positions with noise: shape (C, 2), in [m].
        truth: The demonstration of each case: shape (C, N, 2), in [m].
    """

    training: Demonstrations
    grid: Array
    paths: Array
    steps: NDArray[np.intp]
    observed: Array
    truth: Array

    def error(self, means: Array) -> float:
        """Root mean squared distance of ``means`` (C, N, 2) from the truth, in [m]."""
        return float(np.sqrt(np.square(means - self.truth).sum(axis=-1).mean()))


def make_route_data(training: Demonstrations, test: Demonstrations, *, steps: int = 151) -> RouteData:
    """Resamples demonstrations to one grid and makes a case at every third step where routes are separate.

    Raises:
        InputError: The routes of the test are nowhere separate.
    """
    last = max(float(item.times[-1] - item.times[0]) for item in (*training, *test))
    grid = np.linspace(0.0, last, steps)
    tested = np.stack([resample(item, grid) for item in test])
    gap = np.diff(np.sort(tested, axis=0), axis=0).max(axis=(0, 2), initial=0.0)
    informative = np.flatnonzero(gap > MIN_SEPARATION)[::3]
    if not len(informative):
        expected = f"must hold routes that are more than {MIN_SEPARATION} m apart somewhere"
        raise InputError(test.source, "", expected)
    case, when = np.repeat(np.arange(len(tested)), len(informative)), np.tile(informative, len(tested))
    noise = NOISE * np.random.default_rng(0).standard_normal((len(when), 2))
    return RouteData(
        training=training,
        grid=grid,
        paths=np.stack([resample(item, grid) for item in training]),
        steps=when,
        observed=tested[case, when] + noise,
        truth=tested[case],
    )


def drive_routes(scenario: Scenario, *, count: int, seed: int = 0) -> Demonstrations:
    """Demonstrations of the routes in turn by the simulated operator, scaled to an extent of 1 m.

    The operator is noisy, so that all differ; drives that fail are repeated with another seed.
    """
    simulation = Simulation(scenario, config=SharedControlConfig(driver="human", end="duration"))
    behaviour = Behaviour(noise=0.6)
    items: list[Demonstration] = []
    while len(items) < count:
        route = scenario.routes[len(items) % len(scenario.routes)].name
        trial = simulation.run(TrialSettings(route=route, seed=seed, behaviour=behaviour))
        seed += 1
        if trial.status == "reached" and not trial["contact"].any():
            items.append(Demonstration(times=trial["t"], positions=trial.positions))
    extent = np.ptp(np.concatenate([item.positions for item in items]), axis=0).max()
    scaled = (dataclasses.replace(item, positions=item.positions / extent) for item in items)
    return Demonstrations(items=tuple(scaled), source="simulated demonstrations")
