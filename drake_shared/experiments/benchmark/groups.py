"""The groups of the benchmark and the machine that they run on."""

from __future__ import annotations

import importlib
import importlib.metadata
import os
import platform
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_info

from drake_shared.experiments.benchmark.common import Setup
from drake_shared.experiments.benchmark.results import GroupResult, Report

GROUPS = {
    "predict": "predict",
    "trial": "trial",
    "training": "training",
    "together": "together",
    "batch": "batch",
    "lockstep": "lockstep",
    "many": "many_trials",
    "growth": "growth",
    "safety": "safety_filter",
    "arbiters": "arbiters",
}
"""Names of the groups, in the order in which they run, and their modules."""

_PACKAGES = [
    "drake_shared",
    "drake",
    "numpy",
    "torch",
    "onnx",
    "onnxruntime",
    "ir-sim",
    "movement_primitives",
]


def run_benchmark(setup: Setup, names: Sequence[str] = tuple(GROUPS)) -> Report:
    """Runs the groups of these names, in the order of `GROUPS`."""
    start, load = time.perf_counter(), _load_average()
    results = {}
    for name in GROUPS:
        if name in names:
            setup.progress(f"{name} ...")
            results[name] = run_group(name, setup)
    return Report(
        quick=setup.quick,
        repeats=setup.repeats,
        seconds=round(time.perf_counter() - start, 1),
        machine={**_describe_machine(), "load_before": load, "load_after": _load_average()},
        versions={package: _version(package) for package in _PACKAGES},
        groups=results,
    )


def run_group(name: str, setup: Setup) -> GroupResult:
    """Runs one group."""
    module = importlib.import_module(f"drake_shared.experiments.benchmark.{GROUPS[name]}")
    result: GroupResult = module.run(setup)
    return result


def _describe_machine() -> dict[str, Any]:
    blas = [item for item in threadpool_info() if item["user_api"] == "blas"]
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "blas": sorted({f"{item['internal_api']} {item['version']}" for item in blas}),
    }


def _load_average() -> float | None:
    """Mean number of runnable processes over the last minute; None if the system does not report it."""
    return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
