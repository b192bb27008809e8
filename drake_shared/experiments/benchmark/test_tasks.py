"""What every group of the benchmark works on: the task, demonstrations, a learner, and how long to take."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np

from drake_shared.common.arrays import path_at
from drake_shared.common.files import models_directory
from drake_shared.demonstrations import Demonstrations, read_demonstrations
from drake_shared.learners import Learner, load_learner
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.parameters import find_parameters
from drake_shared.scenario import Scenario, load_scenario
from drake_shared.simulation.teaching import teach


@dataclasses.dataclass(frozen=True, kw_only=True)
class Setting:
    """How the benchmark is run.

    Attributes:
        quick: Whether a rough answer within a minute or so will do.
        repeats: How often contenders take turns.
        demonstrations, test_demonstrations: Files to train on and to test with; simulated ones if None.
        say: Takes what is going on, for the person who waits.
    """

    quick: bool = False
    repeats: int = 15
    demonstrations: Path | None = None
    test_demonstrations: Path | None = None
    say: Callable[[str], None] = lambda message: None

    @cached_property
    def scenario(self) -> Scenario:
        """The two-obstacle task."""
        return load_scenario()

    @cached_property
    def taught(self) -> Demonstrations:
        """One demonstration of each of its routes."""
        return teach(self.scenario)

    @cached_property
    def learner(self) -> Learner:
        """The learner that ships for the task, or one trained on the spot."""
        shipped = models_directory() / "learners" / f"{self.scenario.name}_default.safetensors"
        if shipped.is_file():
            return load_learner(shipped)
        self.say("no learner ships for the task: training one")
        return train_briefly(self.taught, iterations=150 if self.quick else 1_500)

    @cached_property
    def cnmp(self) -> CnmpLearner:
        """A CNMP, whatever ships: for what the arithmetic of a network of its size costs."""
        if isinstance(self.learner, CnmpLearner):
            return self.learner
        return train_briefly(self.taught, iterations=150)

    def read_training(self) -> tuple[Demonstrations, Demonstrations] | None:
        """The demonstrations that were given to train and to test with, if they were.

        Raises:
            InputError: A file is missing or is not what it must be.
        """
        if self.demonstrations is None or self.test_demonstrations is None:
            return None
        return read_demonstrations(self.demonstrations), read_demonstrations(self.test_demonstrations)


def train_briefly(demonstrations: Demonstrations, *, iterations: int) -> CnmpLearner:
    """A CNMP of the shipped size, trained for so many iterations and never begun again."""
    from drake_shared.learners.cnmp.training import train

    parameters = dataclasses.replace(find_parameters("default"), iterations=iterations, restarts=0)
    return train(demonstrations, parameters=parameters)


def with_grid(learner: CnmpLearner, count: int) -> CnmpLearner:
    """The same learner on a grid of ``count`` times, evenly spaced from 0 to T."""
    model = learner.model
    grid = np.linspace(0.0, learner.duration, count)

    def resampled(path: np.ndarray) -> np.ndarray:
        return path_at(path, model.grid, grid)

    return CnmpLearner(
        dataclasses.replace(
            model,
            grid=grid,
            reference=resampled(model.reference),
            demonstrations=np.stack([resampled(path) for path in model.demonstrations]),
        )
    )
