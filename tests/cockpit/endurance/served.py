"""The product itself in a process of its own, watched from outside."""

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
    """``drake-shared drive``, started as a person would.

    Args:
        logs: Folder that it records to.
    """

    def __init__(self, logs: Path) -> None:
        self.logs = logs
        self._said = tempfile.TemporaryFile("w+")  # noqa: SIM115 (closed by stop)
        command = [sys.executable, "-W", "error", "-m", "drake_shared.cli.main", "drive"]
        command += ["--port", "0", "--no-open", "--record", str(logs)]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self._said, text=True)
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().strip()
        self._known: set[Path] = set()

    @property
    def runs(self) -> bool:
        return self._process.poll() is None

    def memory(self) -> float:
        """Resident, in [MB]; NaN if it does not run."""
        answer = subprocess.run(
            ["ps", "-o", "rss=", "-p", str(self._process.pid)], capture_output=True, text=True
        )
        return int(answer.stdout) / 1024 if answer.stdout.strip() else float("nan")

    def new_logs(self) -> list[Path]:
        """Those that were written since this was last asked."""
        found = set(self.logs.glob("*.parquet"))
        new, self._known = found - self._known, found
        return sorted(new)

    def stop(self) -> list[str]:
        """Ends it as a person would, and says what went wrong."""
        errors = [] if self.runs else ["the program ended by itself"]
        if self.runs:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(20.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            errors.append("the program did not end when it was told to")
        if self._process.returncode:
            errors.append(f"exit status {self._process.returncode}")
        self._said.seek(0, os.SEEK_SET)
        said = self._said.read()
        self._said.close()
        if "Traceback" in said or "Error" in said:
            errors.append(said[said.find("Traceback") :][:2000])
        return errors


class MemoryWatch:
    """Notes the memory of a program every so often, until it is left."""

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
    """How the control steps of some logs kept to time.

    Returns:
        ``steps``; ``late`` of them by more than a period; ``worst``, the worst lateness in [ms]; the
        ``sample_age`` that 99% of the steps stayed below, in [ms]; ``simulated`` and ``wall`` time in [s];
        and ``statuses``, each with how often.
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
        # The last rows may be of braking, without a driver.
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
