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
    """Runs the tasks of an experiment.

    With ``only`` a preset, those of the other preset are not run and have the same results: learners of both
    are trained alike here.
    """

    def run(module, size, *, only=None):
        tasks = [one.task for one in module.plan(None, size)]
        if only is None:
            return [task.run() for task in tasks]
        (other,) = {"paper", "default"} - {only}
        kept = [(task.arguments["preset"], task.run()) for task in tasks if task.arguments["preset"] != other]
        same = [renamed(result, only, other) for preset, result in kept if preset == only]
        return [*(result for _, result in kept), *same]

    return run


def renamed(result, preset, other):
    """A copy of a result in which ``preset`` is the other one."""
    if isinstance(result, dict):
        copy = {name: renamed(value, preset, other) for name, value in result.items()}
        return copy | {"preset": other} if result.get("preset") == preset else copy
    return [renamed(value, preset, other) for value in result] if isinstance(result, list) else result
