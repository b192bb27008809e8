"""The groups of the benchmark, run one after another, and what they are run on."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import os
import platform
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_info

from drake_shared.experiments.benchmark.results import GroupResult
from drake_shared.experiments.benchmark.test_tasks import Setting

FORMAT = "drake_shared.benchmark"
VERSION = 1
PACKAGES = (
    *("drake_shared", "drake", "numpy", "torch", "onnx", "onnxruntime"),
    *("ir-sim", "scikit-learn", "movement_primitives"),
)


def _predict(setting: Setting) -> GroupResult:
    from drake_shared.experiments.benchmark import predict

    return predict.run(setting)


def _trial(setting: Setting) -> GroupResult:
    from drake_shared.experiments.benchmark import trial

    return trial.run(setting)


def _training(setting: Setting) -> GroupResult:
    from drake_shared.experiments.benchmark import training

    return training.run(setting)


def _batch(setting: Setting) -> GroupResult:
    from drake_shared.experiments.benchmark import batch

    return batch.run(setting)


def _growth(setting: Setting) -> GroupResult:
    from drake_shared.experiments.benchmark import growth

    return growth.run(setting)


def _safety(setting: Setting) -> GroupResult:
    from drake_shared.experiments.benchmark import safety

    return safety.run(setting)


# Each imports what it needs when it is run: torch, for one, is slow to import.
GROUPS: dict[str, Callable[[Setting], GroupResult]] = {
    "predict": _predict,
    "trial": _trial,
    "training": _training,
    "batch": _batch,
    "growth": _growth,
    "safety": _safety,
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Report:
    """What a run of the benchmark found.

    Attributes:
        quick: Whether it was a quick one.
        repeats: How often contenders took turns.
        seconds: How long it took, in [s].
        machine: What it ran on, and how busy that was.
        versions: Of the packages that took part; None for those that are not installed.
        groups: The findings.
    """

    quick: bool
    repeats: int
    seconds: float
    machine: dict[str, Any]
    versions: dict[str, str | None]
    groups: list[GroupResult]

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        described = dataclasses.asdict(self)
        described["groups"] = {group.name: group.to_json() for group in self.groups}
        return {"format": FORMAT, "version": VERSION, **described}


def run_benchmark(setting: Setting, groups: Sequence[str] = tuple(GROUPS)) -> Report:
    """Runs the groups named, in their own order."""
    begun, load = time.perf_counter(), load_average()
    found = []
    for name, run in GROUPS.items():
        if name in groups:
            setting.say(f"{name} ...")
            found.append(run(setting))
    return Report(
        quick=setting.quick,
        repeats=setting.repeats,
        seconds=round(time.perf_counter() - begun, 1),
        machine={**describe_machine(), "load_before": load, "load_after": load_average()},
        versions={name: _version(name) for name in PACKAGES},
        groups=found,
    )


def describe_machine() -> dict[str, Any]:
    """Processor, its number of cores, system, Python, and the BLAS that numpy uses."""
    blas = [item for item in threadpool_info() if item["user_api"] == "blas"]
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "blas": sorted({f"{item['internal_api']} {item['version']}" for item in blas}),
    }


def load_average() -> float | None:
    """Processes that wanted to run, on average over the last minute; None where the system does not tell."""
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
