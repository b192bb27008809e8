"""Runs the experiments as one run, estimates the time beforehand, and writes the report."""

from __future__ import annotations

import dataclasses
import os
import platform
import time
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from pathlib import Path

from drake_shared.common.errors import InputError
from drake_shared.experiments.common import scenario_of, simulation_of
from drake_shared.experiments.report import remove_report, write_report
from drake_shared.experiments.section import Experiment, PlannedTask, Section, Size
from drake_shared.simulation.config import blend_for
from drake_shared.simulation.runner import JsonStore, Progress, read_results, run_tasks
from drake_shared.simulation.runner.executors import executor
from drake_shared.simulation.runner.identity import identity
from drake_shared.simulation.trial import TrialSettings

MODULES = {
    "weighting": "fig2_weighting",
    "weighting_width": "fig2_width",
    "training_curve": "training_curve",
    "shared_run": "fig3_fig4_shared_run",
    "second_sets": "fig5_sets",
    "second_learners": "fig6_learners",
    "arbitration_compared": "arbitration_compared",
    "sensitivity": "sensitivity",
    "generations": "generations",
    "mispredictions": "mispredictions",
    "faults_injected": "faults_injected",
    "where_help_hurts": "where_help_hurts",
    "adaptation": "adaptation",
    "manipulator": "manipulator",
    "operators_drawn": "operators",
}
"""Names of the experiments and their modules in this package, in the order of the report."""
_TRIAL_SECONDS = 0.04
"""Time of a trial of the human alone in the diagram, on the machine on which the costs were measured."""
TITLE = "Adaptive shared control with human intention estimation: a reproduction"


def find_experiments(only: Sequence[str] = ()) -> list[Experiment]:
    """The experiments of these names or modules, or all.

    Raises:
        InputError: A name is unknown.
    """
    for name in only:
        if name not in MODULES and name not in MODULES.values():
            raise InputError("reproduce", "only", f"must be among {', '.join(MODULES)}", repr(name))
    chosen = [module for name, module in MODULES.items() if not only or name in only or module in only]
    return [import_module(f"drake_shared.experiments.{module}").EXPERIMENT for module in chosen]


def reproduce(
    out: str | os.PathLike[str],
    *,
    size: Size,
    scenario: str | None = None,
    only: Sequence[str] = (),
    workers: int = 1,
    cluster: str | None = None,
    resume: bool = False,
    force: bool = False,
    progress: Progress | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> list[Section]:
    """Runs the experiments and writes the report to ``out``; see `write_report`.

    Args:
        out: Folder; it also holds the result of every task, so that a run can be resumed.
        size: How many repeats.
        scenario: File or name.
        only: Names of experiments; default: all.
        workers: Number of local processes.
        cluster: Address of a Dask scheduler, used instead.
        resume: Resume the run in ``out``.
        force: Overwrite the run in ``out``.
        progress: See `run_tasks`.
        say: Receives messages: the expected time, and what was written.

    Raises:
        InputError: See `JsonStore.open` and `run_tasks`; errors in workers or cluster are found before the
            folder is changed.
        RunError: See `run_tasks`; or the report cannot be written.
    """
    world = scenario_of(scenario)
    experiments = find_experiments(only)
    description = {
        "size": dataclasses.asdict(size),
        "scenario": dataclasses.asdict(world),
        "experiments": [experiment.name for experiment in experiments],
    }
    with executor(workers=workers, cluster=cluster):
        pass  # Check both before a folder is created.
    store = JsonStore.open(out, description, resume=resume, force=force)
    if force:
        remove_report(Path(out))
    plans = {experiment.name: experiment.plan(scenario, size) for experiment in experiments}
    planned = {one.task.key: one for plan in plans.values() for one in plan}
    if seconds := _remaining(planned.values(), store):
        # How many workers of a cluster will take part is unknown.
        minutes = max(seconds * _slowness(scenario) / workers / 60.0, 0.1)
        where = "on one worker of the cluster" if cluster else f"on {workers} worker(s)"
        say(f"{len(planned)} tasks: about {minutes:.1f} min {where}")
    start = time.perf_counter()
    # The longest first: otherwise one may remain for a single worker at the end.
    ordered = [one.task for one in sorted(planned.values(), key=lambda one: -one.seconds)]
    results = run_tasks(ordered, store, workers=workers, cluster=cluster, progress=progress)
    values = dict(zip((task.key for task in ordered), results, strict=True))
    sections = [
        experiment.report(
            scenario, size, [values[one.task.key] for one in plans[experiment.name]]
        ).with_early_stops()
        for experiment in experiments
    ]
    about = {
        "size": size.name,
        "scenario": world.name,
        "tasks": len(planned),
        **identity(),
        "python": platform.python_version(),
        "processor": platform.machine(),
        "seeds": "derived from the indices of repeats, learners and trials; the same code gives the same "
        "bits",
    }
    parts = ["drake-shared reproduce --out DIR"]
    parts += ["--quick"] if size.name == "quick" else []
    parts += [f"--scenario {scenario}"] if scenario else []
    parts += [f"--only {' '.join(only)}"] if only else []
    with store.writing():
        write_report(Path(out), sections, title=TITLE, about=about, rerun=" ".join(parts))
    say(f"wrote {Path(out) / 'report.html'} after {(time.perf_counter() - start) / 60.0:.1f} min")
    return sections


def _remaining(planned: Iterable[PlannedTask], store: JsonStore) -> float:
    """Approximate time on one core of the tasks that the store does not hold, in [s]."""
    planned = list(planned)
    done = read_results((one.task for one in planned), store)
    return sum(one.seconds for one in planned if one.task.key not in done)


def _slowness(scenario: str | None) -> float:
    """How much slower this machine is at present than the one on which the costs were measured."""
    simulation = simulation_of(scenario, blend_for(None))
    settings = TrialSettings(route=scenario_of(scenario).routes[0].name)
    simulation.run(settings)
    start = time.perf_counter()
    simulation.run(settings)
    return max((time.perf_counter() - start) / _TRIAL_SECONDS, 0.2)
