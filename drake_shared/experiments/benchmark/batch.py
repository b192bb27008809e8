"""Group 4: trials per second with one and two worker processes, and growth of memory."""

from __future__ import annotations

import gc
import os
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from drake_shared.analysis.batch import Batch, run_batch
from drake_shared.experiments.benchmark.common import Setup
from drake_shared.experiments.benchmark.results import GroupResult, Ratio
from drake_shared.experiments.benchmark.timing import spread
from drake_shared.learners import save_learner
from drake_shared.simulation.trial import Simulation, TrialSettings

WORKERS = (1, 2)
_METHOD = (
    "Shared-control trials in Drake to the goal by `run_batch`, with 1 and 2 workers in turns; wall time. A "
    "rate is that of a batch beyond one of a single trial per worker, so that starting the processes "
    "(each imports Drake for most of a second) does not count; the rate of the whole batch is given as "
    "well. Two workers can be no faster than the load of the machine allows. Memory is the resident "
    "memory of one process over its trials, counted from a tenth of them on."
)


def run(setup: Setup) -> GroupResult:
    """Runs the group."""
    count, trials, repeats = (6, 20, 1) if setup.quick else (300, 2_000, 3)
    # Rates beyond the start, and of whole batches.
    rates = np.empty((2, len(WORKERS), repeats))
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "learner.safetensors"
        save_learner(setup.learner, model)
        for repeat in range(repeats):
            for index, workers in enumerate(WORKERS):
                rates[:, index, repeat] = trials_per_second(str(model), count, workers)
            one, two = rates[0, :, repeat]
            setup.progress(f"batch, repeat {repeat}: {one:.1f} and {two:.1f} trials per second")
    setup.progress(f"batch: memory over {trials} trials")
    faster, whole_faster = (spread(two / one) for one, two in rates)
    return GroupResult(
        name="batch",
        method=_METHOD,
        ratios=[
            Ratio(name="trials per second, 2 workers / 1", spread=faster, aim="at least 1.8"),
            Ratio(name=f"the same over {count} trials, starting included", spread=whole_faster),
        ],
        details={
            "trials": count,
            "trials_per_second": {
                str(workers): spread(values) for workers, values in zip(WORKERS, rates[0], strict=True)
            },
            "memory": measure_memory(setup, trials),
        },
    )


def trials_per_second(model: str, count: int, workers: int, *, engine: str = "drake") -> tuple[float, float]:
    """The rate without the start of the processes, and that of the whole batch."""
    start = _wall_seconds(model, workers, workers, engine)
    whole = _wall_seconds(model, count, workers, engine)
    # On a busy machine a start may take longer than a short batch.
    return (count - workers) / max(whole - start, 0.1 * whole), count / whole


def _wall_seconds(model: str, count: int, workers: int, engine: str) -> float:
    start = time.perf_counter()
    for _ in run_batch(Batch(model=model, count=count, engine=engine), workers=workers):
        pass
    return time.perf_counter() - start


def measure_memory(setup: Setup, trials: int) -> dict[str, object]:
    """Resident memory after some of the trials, in [MB], and its growth after the first tenth of them."""
    simulation = Simulation(setup.scenario, learner=setup.learner)
    routes = [route.name for route in setup.scenario.routes]
    marks = sorted({round(share * trials) for share in (0.1, 0.25, 0.5, 0.75, 1.0)})
    megabytes = []
    for done in range(1, trials + 1):
        simulation.run(TrialSettings(route=routes[done % len(routes)], seed=done))
        if done in marks:
            gc.collect()
            megabytes.append(resident_megabytes())
    growth = megabytes[-1] - megabytes[0]
    return {"trials": marks, "megabytes": megabytes, "growth": growth, "aim": "at most 5 MB over 2,000"}


def resident_megabytes() -> float:
    """Resident memory of this process, in [MB]; its peak on systems without /proc, such as macOS."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except OSError:
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak / 1e6 if sys.platform == "darwin" else peak / 1e3
