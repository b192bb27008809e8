"""Options of the benchmark, and the task, demonstrations and learner that its groups share."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from drake_shared.common.arrays import path_at
from drake_shared.common.files import models_directory
from drake_shared.demonstrations import Demonstrations, read_demonstrations
from drake_shared.experiments.benchmark.timing import Task
from drake_shared.learners import Learner, load_learner
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.parameters import find_parameters
from drake_shared.scenario import Scenario, load_scenario
from drake_shared.simulation.teaching import teach


@dataclasses.dataclass(frozen=True, kw_only=True)
class Setup:
    """Options of the benchmark and what follows from them.

    Attributes:
        quick: Whether a rough result within a minute or two is enough.
        repeats: How often each contender is timed.
        training_file, test_file: Demonstrations to train on and to test with; simulated ones if None.
        progress: Receives messages about progress.
    """

    quick: bool = False
    repeats: int = 15
    training_file: Path | None = None
    test_file: Path | None = None
    progress: Callable[[str], None] = lambda message: None

    @cached_property
    def scenario(self) -> Scenario:
        """The two-obstacle task."""
        return load_scenario()

    @cached_property
    def route_demonstrations(self) -> Demonstrations:
        """One demonstration of each route."""
        return teach(self.scenario)

    @cached_property
    def learner(self) -> Learner:
        """The learner shipped for the task, or one trained now if none is."""
        shipped = models_directory() / "learners" / f"{self.scenario.name}_default.safetensors"
        if shipped.is_file():
            return load_learner(shipped)
        self.progress("no learner is shipped for the task: training one")
        return train_cnmp(self.route_demonstrations, iterations=150 if self.quick else 1_500)

    @cached_property
    def cnmp(self) -> CnmpLearner:
        """A CNMP of the shipped size, whichever learner is shipped."""
        if isinstance(self.learner, CnmpLearner):
            return self.learner
        return train_cnmp(self.route_demonstrations, iterations=150)

    def read_files(self) -> tuple[Demonstrations, Demonstrations] | None:
        """The given demonstrations to train on and to test with; None if there are none.

        Raises:
            InputError: A file is missing or invalid.
        """
        if self.training_file is None or self.test_file is None:
            return None
        return read_demonstrations(self.training_file), read_demonstrations(self.test_file)


def train_cnmp(demonstrations: Demonstrations, *, iterations: int) -> CnmpLearner:
    """A CNMP of the shipped size, trained for a fixed number of iterations without restarts."""
    from drake_shared.learners.cnmp.training import train

    parameters = dataclasses.replace(find_parameters("default"), iterations=iterations, restarts=0)
    return train(demonstrations, parameters=parameters)


def with_grid(learner: CnmpLearner, count: int) -> CnmpLearner:
    """The same learner on a grid of ``count`` evenly spaced times from 0 to T."""
    grid = np.linspace(0.0, learner.duration, count)
    return dataclasses.replace(
        learner,
        grid=grid,
        reference=path_at(learner.reference, learner.grid, grid),
        demonstrations=np.stack([path_at(path, learner.grid, grid) for path in learner.demonstrations]),
    )


def prediction_task(learner: Learner) -> Task:
    """Predicts the whole grid from one observation, the start of the first demonstration."""
    assert learner.demonstrations is not None
    return partial(learner.predict, learner.grid[:1], learner.demonstrations[0, :1], learner.grid)
