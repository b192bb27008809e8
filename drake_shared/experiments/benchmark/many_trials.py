"""Group 6: time and memory of many trials in lock-step with logs, and two workers."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from drake_shared.experiments.benchmark.batch import trials_per_second
from drake_shared.experiments.benchmark.common import Setup
from drake_shared.experiments.benchmark.results import GroupResult, Ratio, make_curve
from drake_shared.experiments.benchmark.timing import spread
from drake_shared.learners import save_learner

_METHOD = (
    "`drake-shared simulate --engine lockstep` of that many trials with metrics and logs, 500 trials in a "
    "log, in a process of its own: its CPU time, starting included, and the largest resident memory that "
    "it ever had. Workers: wall time of trials without logs, with 1 and 2 processes in turns, beyond that "
    "of their start; two can be no faster than the load of the machine allows."
)


def run(setup: Setup) -> GroupResult:
    """Runs the group."""
    sizes = (10, 20) if setup.quick else (1_000, 3_000, 10_000)
    count, repeats = (20, 1) if setup.quick else (2_000, 3)
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "learner.safetensors"
        save_learner(setup.learner, model)
        seconds, megabytes = zip(*(simulate(size, model) for size in sizes), strict=True)
        rates = np.array(
            [
                [trials_per_second(str(model), count, workers, engine="lockstep")[0] for workers in (1, 2)]
                for _ in range(repeats)
            ]
        )
    return GroupResult(
        name="many",
        method=_METHOD,
        ratios=[
            Ratio(
                name=f"trials per second in lock-step, {count} trials, 2 workers / 1",
                spread=spread(rates[:, 1] / rates[:, 0]),
                aim="at least 1.8",
            )
        ],
        curves=[make_curve("trials with logs, s", "trials", sizes, [[value] for value in seconds])],
        details={
            "memory": {"trials": sizes, "megabytes": megabytes, "aim": "at most 1,000 MB for 10,000 trials"}
        },
    )


def simulate(count: int, model: Path) -> tuple[float, float]:
    """CPU time, in [s], and largest resident memory, in [MB], of a process that runs ``count`` trials."""
    with tempfile.TemporaryDirectory() as folder:
        options = ["--engine", "lockstep", "--model", str(model), "--trials", str(count), "--json"]
        options += ["--out", folder, "--trials-per-log", "500"]
        command = [sys.executable, "-m", "drake_shared.cli.main", "simulate", *options]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    # Linux counts in KiB, macOS in bytes.
    per_megabyte = 1e6 if sys.platform == "darwin" else 1e3
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / per_megabyte
