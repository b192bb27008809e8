"""The drives of a session: what the page lists, draws and compares."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

from drake_shared.simulation.trial import Trial

_MOST_DRIVES = 100  # Older ones stay on the disk.
_MOST_TRIALS = 24  # Whole trials are kept in memory only to train on them.


class DriveHistory:
    """Keeps the results of drives, the newest first.

    Args:
        folder: Where their logs are saved, if they are.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._results: dict[int, dict[str, Any]] = {}
        self._trials: dict[int, Trial] = {}
        self.rows: dict[int, str] = {}
        """Rows of each drive as JSON text, by number: [t, x, y, human_weight, confidence, contact]."""

    def add(self, number: int, result: dict[str, Any], trial: Trial) -> None:
        """Adds a drive, with the ``result`` that the page shows."""
        self._results[number] = {
            "number": number,
            "scenario": trial.metadata["scenario"]["name"],
            **{name: value for name, value in result.items() if name != "rows"},
        }
        self.rows[number] = json.dumps({"rows": result["rows"]}, allow_nan=False)
        self._trials[number] = trial
        for oldest in sorted(self._trials)[:-_MOST_TRIALS]:
            del self._trials[oldest]
        for oldest in sorted(self._results)[:-_MOST_DRIVES]:
            del self._results[oldest], self.rows[oldest]

    def discard(self, number: int) -> str | None:
        """Forgets a drive and deletes its log. Returns the log's name, if there was one."""
        result = self._results.pop(number, None)
        self._trials.pop(number, None)
        self.rows.pop(number, None)
        name: str | None = None if result is None else result["saved"]
        if name is None or self._folder is None:
            return None
        with contextlib.suppress(FileNotFoundError):
            (self._folder / name).unlink()
        return name

    def usable(self, scenario: str) -> list[Trial]:
        """Drives of a scenario that reached the goal without contact: one may learn from them."""
        return [
            trial
            for trial in self._trials.values()
            if trial.metadata["scenario"]["name"] == scenario
            and trial.status == "reached"
            and not trial["contact"].any()
        ]

    def describe(self) -> dict[str, Any]:
        """Returns the ``history`` message."""
        return {"drives": [self._results[number] for number in sorted(self._results, reverse=True)]}
