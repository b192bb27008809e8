"""Runs many tasks in this process, in local processes or on a Dask cluster, and stores each result.

A task is the name of a function and its JSON arguments. This package knows neither Drake nor experiments. The
same tasks give the same bits wherever and in whatever order they run, on one kind of processor.
"""

from drake_shared.simulation.runner.run import Progress, read_results, run_as_completed, run_tasks
from drake_shared.simulation.runner.store import JsonStore, ResultStore
from drake_shared.simulation.runner.tasks import Task

__all__ = [
    "JsonStore",
    "Progress",
    "ResultStore",
    "Task",
    "read_results",
    "run_as_completed",
    "run_tasks",
]
