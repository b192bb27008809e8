"""Experiments with learners that are barely trained."""

import contextlib
import dataclasses

import pytest

from drake_shared.experiments import training
from drake_shared.experiments.section import Size


@pytest.fixture(scope="session")
def tiny() -> Size:
    return Size(name="quick", repeats=1, other_repeats=0, all_arms=False, learners=2, trials=1)


@pytest.fixture(scope="session")
def short_training():
    """A context in which all learners are trained for a few iterations."""

    @contextlib.contextmanager
    def shorten(iterations: int = 20):
        # Of the default preset, whose predictions lead to the goal after so few iterations.
        brief = dataclasses.replace(training.STUDIED["default"], iterations=iterations, restarts=0)
        short = {name: dataclasses.replace(brief, preset=name) for name in training.STUDIED}
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(training, "STUDIED", short)
            yield patch

    return shorten


@pytest.fixture(scope="session")
def run_plan():
    """Runs the tasks of an experiment."""
    return lambda module, size: [one.task.run() for one in module.plan(None, size)]
