"""Attacks the server while someone drives, and measures the effect on the drive."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from attacks import ATTACKS
from served import MemoryWatch, Served, read_pace

LATE = 0.01
"""Share of control steps that may be late by more than a period."""
GROWTH = 10.0
"""Growth of memory in the second half of an attack, in [MB]; buffers filled in the first half are reused."""
PEAK = 40.0
"""Peak of memory during an attack above that before, in [MB]."""
AGE = 150.0
"""Age at which a driver's sample is stale, in [ms]; 99% must be younger."""
ENDS = {"reached", "timed_out", "stopped"}
"""Statuses of a trial whose driver was present throughout."""

_HERE = Path(__file__).parent
_WARM_UP = 3.0
_SETTLE = 3.0


def run(seconds: float, names: list[str]) -> dict[str, Any]:
    """Runs each attack for ``seconds``, and returns the measurements."""
    with tempfile.TemporaryDirectory() as logs:
        served = Served(Path(logs))
        try:
            _attack(served, "nothing", min(_WARM_UP, seconds))
            results = {name: _attack(served, name, seconds) for name in names if served.runs}
        finally:
            errors = served.stop()
    broken = [f"{name}: {what}" for name, result in results.items() for what in _broken(result)]
    return {"seconds": seconds, "assaults": results, "broken": broken + errors}


def _attack(served: Served, name: str, seconds: float) -> dict[str, Any]:
    served.new_logs()
    before = served.memory()
    # The driver drives before the attack begins, and stays a little longer.
    driver = _start("driver.py", served.address, str(seconds + 0.5))
    with MemoryWatch(served) as memory:
        assert driver.stdout is not None
        first = driver.stdout.readline()
        if first != b"driving\n":
            raise SystemExit(f"the driver began no trial: {first.decode()}")
        attack = _start("attacks.py", name, served.address, str(seconds))
        driven, attacked = (
            json.loads(job.communicate(timeout=seconds + 60.0)[0]) for job in (driver, attack)
        )
    half = float(np.interp(np.mean([memory.times[0], memory.times[-1]]), memory.times, memory.values))
    # Connections are closed after a timeout, not at once.
    deadline = time.monotonic() + _SETTLE
    while served.memory() - half > GROWTH and time.monotonic() < deadline:
        time.sleep(0.1)
    trips = driven["round_trips"]
    return {
        "did": attacked["did"],
        **read_pace(served.new_logs()),
        "started": driven["trials"],
        "round_trip_p50": round(float(np.percentile(trips, 50)), 1) if trips else None,
        "round_trip_p99": round(float(np.percentile(trips, 99)), 1) if trips else None,
        "memory": round(before, 1),
        "growth": round(served.memory() - half, 1),
        "peak": round(max(memory.values) - before, 1),
        "errors": driven["errors"] + attacked["errors"],
    }


def _start(script: str, *arguments: str) -> subprocess.Popen[bytes]:
    # Unbuffered, since a line is read before the rest.
    return subprocess.Popen(
        [sys.executable, str(_HERE / script), *arguments], stdout=subprocess.PIPE, bufsize=0
    )


def _broken(result: dict[str, Any]) -> list[str]:
    """Returns a description of each limit that was exceeded."""
    broken = list(result["errors"])
    if not result["steps"]:
        return [*broken, "nothing was driven"]
    late = result["late"] / result["steps"]
    if late > LATE:
        broken.append(f"{100 * late:.1f}% of the control steps were missed")
    if not result["growth"] <= GROWTH:
        broken.append(f"memory grew by {result['growth']} MB")
    if not result["peak"] <= PEAK:
        broken.append(f"memory rose by {result['peak']} MB meanwhile")
    if result["sample_age"] > AGE:
        broken.append(f"the driver's samples were up to {result['sample_age']} ms old")
    if result["started"] != result["trials"]:
        broken.append(f"{result['started']} trials were driven and {result['trials']} logged")
    broken += [f"a trial ended as {status}" for status in set(result["statuses"]) - ENDS]
    return broken


def describe(report: dict[str, Any]) -> str:
    """Returns the report as a table."""
    lines = [
        f"{'':18}{'steps':>7}{'missed':>8}{'worst':>8}{'sample':>8}{'trip p50':>10}{'p99':>8}"
        f"{'growth':>8}{'peak':>7}",
        f"{'':18}{'':>7}{'%':>8}{'ms':>8}{'ms':>8}{'ms':>10}{'ms':>8}{'MB':>8}{'MB':>7}",
    ]
    for name, result in report["assaults"].items():
        missed = 100 * result["late"] / max(result["steps"], 1)
        lines.append(
            f"{name:18}{result['steps']:7}{missed:8.2f}{result['worst']:8}{result['sample_age']!s:>8}"
            f"{result['round_trip_p50']!s:>10}{result['round_trip_p99']!s:>8}{result['growth']:8}{result['peak']:7}"
            f"  {result['did']}"
        )
    return "\n".join(lines + [f"BROKEN: {what}" for what in report["broken"]])


def all_names() -> list[str]:
    return list(ATTACKS)
