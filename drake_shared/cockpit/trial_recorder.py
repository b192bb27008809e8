"""Saves the trials of a session while they are driven."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from pathlib import Path
from typing import Any

from drake_shared.common.errors import DrakeSharedError
from drake_shared.simulation.journal import Journal
from drake_shared.simulation.trial import RunningTrial, Trial

FLUSH_PERIOD = 0.5
"""Simulated time after which new rows go to the disk, in [s]."""


class TrialRecorder:
    """Saves trials, one after another: their rows while they are driven, the log when they end.

    Args:
        folder: For the logs; nothing is saved if None.
        keep_logs: False keeps no log of a trial that ends, but what it was driven is still recovered if the
            program ends before it.
    """

    def __init__(self, folder: Path | None, *, keep_logs: bool = True) -> None:
        self._folder = folder
        self._keep_logs = keep_logs
        self.running: RunningTrial | None = None
        """The trial that is recorded."""
        self._name = ""
        self._metadata: dict[str, Any] = {}
        self._journal: Journal | None = None
        self._rows = 0
        self._due = 0.0

    def begin(self, running: RunningTrial, number: int, *, started: datetime.datetime) -> None:
        """Starts to record a trial; what fails is reported at its end.

        Args:
            running: The trial.
            number: Of the trial in the session.
            started: When it starts.
        """
        self.running, self._rows, self._due = running, 0, 0.0
        self._name = f"{running.simulation.scenario.name}_{started:%Y%m%d-%H%M%S}_{number:03d}"
        self._metadata = running.describe() | {"started": started.isoformat()}
        self._open()

    def record(self) -> None:
        """Hands the rows since the last call to the disk, if it is time; called at every control step."""
        if self._journal is not None and self.running is not None and self.running.time >= self._due:
            rows = self.running.rows(self._rows)
            self._rows += len(rows["t"])
            self._due = self.running.time + FLUSH_PERIOD
            self._journal.append(rows)

    def finish(
        self, trial: Trial, on_trial: Callable[[Trial], bool | None]
    ) -> tuple[str | None, str | None, bool]:
        """Saves the trial, which has ended.

        Args:
            trial: Its log.
            on_trial: Called with the trial when it is saved.

        Returns:
            The name of its file, if there is one; the error if something could not be written, such as that
            of a full disk; and whether ``on_trial`` returned True.
        """
        name, error = self._save(trial) if self._keep_logs else (None, None)
        over = False
        try:
            over = bool(on_trial(trial))
        except DrakeSharedError as failure:
            error = str(failure)
        if self._journal is not None:
            # After an error the journal is all that there is of the trial.
            if error is None:
                self._journal.discard()
            else:
                self._journal.close()
        self.running = self._journal = None
        return name, error, over

    def _save(self, trial: Trial) -> tuple[str | None, str | None]:
        if self._folder is None:
            return None, None
        # The folder may have become writable in the meantime.
        error = self._open() if self._journal is None else None
        if self._journal is None:
            return None, error
        try:
            return self._journal.finish(trial).name, None
        except DrakeSharedError as failure:
            return None, str(failure)

    def _open(self) -> str | None:
        """Opens the journal. Returns the error if that fails."""
        self._journal = None
        if self._folder is None:
            return None
        try:
            self._journal = Journal(self._folder, self._name, self._metadata)
        except DrakeSharedError as error:
            return str(error)
        return None
