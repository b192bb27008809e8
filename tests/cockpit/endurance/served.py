"""``drake-shared drive`` in a process of its own, measured from outside."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq


class Served:
    """Runs ``drake-shared drive``.

    Args:
        logs: Folder for its logs.
        options: Further options.
    """

    def __init__(self, logs: Path, *options: str) -> None:
        self.logs = logs
        self._stderr = tempfile.TemporaryFile("w+")  # noqa: SIM115 (closed by stop)
        command = [sys.executable, "-W", "error", "-m", "drake_shared.cli.main", "drive"]
        command += ["--port", "0", "--no-open", "--record", str(logs), *options]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self._stderr, text=True)
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().strip()
        self._known: set[Path] = set()

    @property
    def runs(self) -> bool:
        return self._process.poll() is None

    def memory(self) -> float:
        """Returns the resident memory in [MB]; NaN if the program does not run."""
        answer = subprocess.run(
            ["ps", "-o", "rss=", "-p", str(self._process.pid)], capture_output=True, text=True
        )
        return int(answer.stdout) / 1024 if answer.stdout.strip() else float("nan")

    def processor_time(self) -> float:
        """Returns the processor time that the program has taken, in [s]."""
        answer = subprocess.run(
            ["ps", "-o", "cputimes=", "-p", str(self._process.pid)], capture_output=True, text=True
        )
        return float(answer.stdout.strip() or "nan")

    def new_logs(self) -> list[Path]:
        """Returns the logs written since the last call."""
        found = set(self.logs.glob("*.parquet"))
        new, self._known = found - self._known, found
        return sorted(new)

    def stop(self) -> list[str]:
        """Interrupts the program, and returns its errors."""
        errors = [] if self.runs else ["the program ended by itself"]
        if self.runs:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(20.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            errors.append("the program did not end when interrupted")
        if self._process.returncode:
            errors.append(f"exit status {self._process.returncode}")
        self._stderr.seek(0, os.SEEK_SET)
        text = self._stderr.read()
        self._stderr.close()
        if "Traceback" in text or "Error" in text:
            errors.append(text[text.find("Traceback") :][:2000])
        return errors


class MemoryWatch:
    """Context manager that samples the memory of a program periodically."""

    def __init__(self, served: Served, every: float = 0.25) -> None:
        self.times: list[float] = []
        self.values: list[float] = []
        self._served = served
        self._every = every
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> MemoryWatch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        while True:
            self.times.append(time.monotonic())
            self.values.append(self._served.memory())
            if self._over.wait(self._every):
                return


def read_pace(paths: list[Path]) -> dict:
    """Returns the timing of the control steps in some logs.

    Returns:
        ``steps``, their number; ``late``, how many were late by more than a period; ``worst``, the largest
        lateness in [ms]; ``sample_age``, the 99th percentile in [ms]; ``simulated`` and ``wall`` time in
        [s]; and ``statuses`` with their counts.
    """
    steps = late = 0
    worst = simulated = wall = 0.0
    ages: list[np.ndarray] = []
    statuses: dict[str, int] = {}
    for path in paths:
        table = pq.read_table(path)
        metadata = json.loads(table.schema.metadata[b"drake_shared"])
        pace = metadata["real_time"]
        steps += table.num_rows - 1
        late += pace["late_steps"]
        worst = max(worst, pace["worst_lateness"])
        times = table["t"].to_numpy()
        simulated += times[-1]
        wall += pace["wall_time"]
        # In the last rows the robot may brake without a driver.
        ages.append(table["mouse_age"].to_numpy()[table["engaged"].to_numpy() > 0.5])
        statuses[metadata["status"]] = statuses.get(metadata["status"], 0) + 1
    all_ages = np.concatenate(ages) if ages else np.empty(0)
    return {
        "trials": len(paths),
        "statuses": statuses,
        "steps": steps,
        "late": late,
        "worst": round(1000 * worst, 1),
        "sample_age": round(1000 * float(np.percentile(all_ages, 99)), 1) if all_ages.size else None,
        "simulated": round(simulated, 3),
        "wall": round(wall, 3),
    }
