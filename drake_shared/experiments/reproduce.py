"""All experiments as one run: what is computed, how long it will take, and the report."""

from __future__ import annotations

import dataclasses
import os
import platform
import time
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.experiments.common import ALONE_COST, run, scenario_of
from drake_shared.experiments.report import remove_report, write_report
from drake_shared.experiments.section import Experiment, Section, Size
from drake_shared.simulation.runner import JsonStore, Progress, Task, run_tasks
from drake_shared.simulation.runner.executors import executor
from drake_shared.simulation.runner.identity import identity

MODULES = {
    "weighting": "fig2_weighting",
    "shared_run": "fig3_fig4_shared_run",
    "second_sets": "fig5_sets",
    "second_learners": "fig6_learners",
    "arbitration_compared": "arbitration_compared",
    "sensitivity": "sensitivity",
    "generations": "generations",
    "mispredictions": "mispredictions",
    "faults_injected": "faults_injected",
    "where_help_hurts": "where_help_hurts",
    "operators_drawn": "operators",
}
"""Names of the experiments and their modules in this package, in the order of the report."""
TITLE = "Adaptive shared control with human intention estimation: a reproduction"


def find_experiments(only: Sequence[str] = ()) -> list[Experiment]:
    """The experiments of those names, or all.

    Raises:
        InputError: There is none of a name.
    """
    for name in only:
        if name not in MODULES:
            raise InputError("reproduce", "only", f"must be among {', '.join(MODULES)}", repr(name))
    chosen = [module for name, module in MODULES.items() if name in only or not only]
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
        out: Folder; holds the result of every task as well, so that a run can be resumed.
        size: How many repeats.
        scenario: File or name.
        only: Names of experiments; default: all.
        workers: Processes of this machine.
        cluster: Address of a Dask scheduler to use in their place.
        resume: Go on with the run in ``out``.
        force: Begin anew in its place.
        progress: See `run_tasks`.
        say: Told beforehand how long it will take, and what is done.

    Raises:
        InputError: See `JsonStore.open` and `run_tasks`; errors in workers or cluster are found before the
            folder is touched.
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
        pass  # Where nothing can be run, no folder is begun.
    store = JsonStore.open(out, description, resume=resume, force=force)
    if force:
        remove_report(Path(out))
    planned = {experiment.name: experiment.tasks(scenario, size) for experiment in experiments}
    costs = {
        task.key: (experiment.cost(task), task)
        for experiment in experiments
        for task in planned[experiment.name]
    }
    left = sum(cost for cost, task in costs.values() if not _done(store, task))
    if left:
        # Of a cluster it is not known how many take part.
        minutes = left * _slowness(scenario) / workers / 60.0
        where = "on one worker of the cluster" if cluster else f"on {workers} worker(s)"
        say(f"{len(costs)} tasks: about {max(minutes, 0.1):.1f} min {where}")
    begun = time.perf_counter()
    # The longest first: then none is left over at the end for one worker alone.
    ordered = [task for _, task in sorted(costs.values(), key=lambda pair: -pair[0])]
    values = dict(
        zip(
            (task.key for task in ordered),
            run_tasks(ordered, store, workers=workers, cluster=cluster, progress=progress),
            strict=True,
        )
    )
    sections = [
        experiment.report(scenario, size, [values[task.key] for task in planned[experiment.name]])
        for experiment in experiments
    ]
    about = {
        "size": size.name,
        "scenario": world.name,
        "tasks": len(costs),
        **identity(),
        "python": platform.python_version(),
        "processor": platform.machine(),
        "seeds": "follow from the numbers of repeats, learners and trials; the same code gives the same bits",
    }
    parts = ["drake-shared reproduce --out DIR"]
    parts += ["--quick"] if size.name == "quick" else []
    parts += [f"--scenario {scenario}"] if scenario else []
    parts += [f"--only {' '.join(only)}"] if only else []
    with store.writing():
        write_report(Path(out), sections, title=TITLE, about=about, rerun=" ".join(parts))
    say(f"wrote {Path(out) / 'report.html'} after {(time.perf_counter() - begun) / 60.0:.1f} min")
    return sections


def _done(store: JsonStore, task: Task) -> bool:
    try:
        store.read(task)
    except KeyError:
        return False
    return True


def _slowness(scenario: str | None) -> float:
    """How much slower this machine is now than the one by which costs are told."""
    settings: dict[str, Any] = {"route": scenario_of(scenario).routes[0].name}
    run(scenario, None, **settings)
    begun = time.perf_counter()
    run(scenario, None, **settings)
    return max((time.perf_counter() - begun) / ALONE_COST, 0.2)
