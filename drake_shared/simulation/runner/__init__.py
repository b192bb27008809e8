"""Many tasks, in processes of this machine or on a Dask cluster, with their results kept as they come.

A task is a function's name and its arguments, and knows neither Drake nor experiments. The same tasks give
the same bits wherever and in whatever order they run, on one kind of processor.
"""

from drake_shared.simulation.runner.run import Progress, run_tasks
from drake_shared.simulation.runner.store import Store
from drake_shared.simulation.runner.tasks import Task

__all__ = ["Progress", "Store", "Task", "run_tasks"]
