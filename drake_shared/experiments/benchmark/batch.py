"""Group 4: trials per second in one and two processes, and whether memory stays what it was."""

from __future__ import annotations

import gc
import os
import tempfile
import time
from pathlib import Path

import numpy as np

from drake_shared.analysis.batch import Batch, run_batch
from drake_shared.experiments.benchmark.results import GroupResult, Ratio
from drake_shared.experiments.benchmark.test_tasks import Setting
from drake_shared.experiments.benchmark.timing import spread
from drake_shared.learners import save_learner
from drake_shared.simulation.trial import Simulation, TrialSettings

WORKERS = (1, 2)
_METHOD = (
    "Shared-control trials to the goal by `run_batch`, in turns with 1 and 2 workers, by the clock on the "
    "wall. A rate is that of a batch beyond one of a single trial for each worker, so that starting the "
    "processes (which import Drake for most of a second) is not in it; with it, it is given as well. Two "
    "can be no faster than what the machine leaves free: see its load. Memory is what this process holds, "
    "over trials in one process, counted from a tenth of them on."
)


def run(setting: Setting) -> GroupResult:
    """Measures it."""
    count, trials, repeats = (12, 20, 1) if setting.quick else (300, 2_000, 3)
    rates: dict[int, list[float]] = {workers: [] for workers in WORKERS}
    wholes: dict[int, list[float]] = {workers: [] for workers in WORKERS}
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "learner.safetensors"
        save_learner(setting.learner, model)
        for repeat in range(repeats):
            for workers in WORKERS:
                rate, whole = trials_per_second(str(model), count, workers)
                rates[workers].append(rate)
                wholes[workers].append(whole)
            setting.say(
                f"batch, repeat {repeat}: {rates[1][-1]:.1f} and {rates[2][-1]:.1f} trials per second"
            )
    setting.say(f"batch: memory over {trials} trials")
    memory = memory_over(setting, trials)
    faster = spread(np.array(rates[2]) / np.array(rates[1]))
    whole_faster = spread(np.array(wholes[2]) / np.array(wholes[1]))
    return GroupResult(
        name="batch",
        method=_METHOD,
        ratios=[
            Ratio(name="trials per second, 2 workers / 1", spread=faster, aim="at least 1.8"),
            Ratio(name=f"the same over {count} trials, starting included", spread=whole_faster),
        ],
        details={
            "trials": count,
            "trials_per_second": {str(workers): spread(rates[workers]) for workers in WORKERS},
            "memory": memory,
        },
    )


def trials_per_second(model: str, count: int, workers: int) -> tuple[float, float]:
    """The rate without what it takes to start, and that of the whole batch."""
    started = _wall_seconds(model, workers, workers)
    whole = _wall_seconds(model, count, workers)
    # On a machine in use a start may take longer than a short batch.
    return (count - workers) / max(whole - started, 0.1 * whole), count / whole


def _wall_seconds(model: str, count: int, workers: int) -> float:
    begun = time.perf_counter()
    for _ in run_batch(Batch(model=model, count=count), workers=workers):
        pass
    return time.perf_counter() - begun


def memory_over(setting: Setting, trials: int) -> dict[str, object]:
    """Memory of this process at some moments of so many trials, in [MB], and its growth after a tenth."""
    simulation = Simulation(setting.scenario, learner=setting.learner)
    routes = [route.name for route in setting.scenario.routes]
    marks = {round(share * trials) for share in (0.1, 0.25, 0.5, 0.75, 1.0)}
    done: list[int] = []
    held: list[float] = []
    for index in range(trials):
        simulation.run(TrialSettings(route=routes[index % len(routes)], seed=index))
        if index + 1 in marks:
            gc.collect()
            done.append(index + 1)
            held.append(resident_megabytes())
    return {"trials": done, "megabytes": held, "growth": held[-1] - held[0], "aim": "at most 5 MB over 2,000"}


def resident_megabytes() -> float:
    """What this process holds in memory, in [MB]; its peak where the system does not tell (as on macOS)."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except OSError:
        import resource
        import sys

        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak / 1e6 if sys.platform == "darwin" else peak / 1e3
