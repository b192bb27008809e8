"""The folder with the logs of a batch of trials, all of one configuration."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa

from drake_shared.analysis.metrics import metrics
from drake_shared.common.errors import DrakeSharedError, InputError, RunError
from drake_shared.common.files import check_writable
from drake_shared.simulation.runner.identity import first_difference
from drake_shared.simulation.runner.store import OVERWRITE, accessing, check_resume_or_force
from drake_shared.simulation.runner.tasks import Task, as_json
from drake_shared.simulation.trial import Trial, read_log, write_log

_LOG = re.compile(r"trial_(\d{5,})\.parquet")
# Temporary files of replacing(), which a killed process leaves, are called .trial_00003.parquet.k3v9x2ab.
_TEMPORARY = re.compile(r"\.trial_\d{5,}\.parquet\.\w+")

# Entries of the metadata that are no settings of the trial.
_OF_THE_RUN = ("status", "engine")


def log_path(folder: str | os.PathLike[str], index: int) -> Path:
    """The path of the log of trial ``index`` of a batch."""
    return Path(folder) / f"trial_{index:05d}.parquet"


def open_log_folder(
    folder: str | os.PathLike[str], *, count: int, resume: bool = False, force: bool = False
) -> list[int]:
    """Prepares a folder for the logs of ``count`` trials, and removes temporary files of killed processes.

    Args:
        folder: Created if it does not exist. Files that are not logs of a batch are ignored and kept.
        count: Number of trials in the batch.
        resume: Keep the logs in the folder.
        force: Remove the logs in the folder.

    Returns:
        The indices of the trials that have a log, in order.

    Raises:
        InputError: There are logs and neither ``resume`` nor ``force`` is set, or some beyond ``count``; or
            both are set; or the folder cannot be written to.
    """
    check_resume_or_force(folder, resume=resume, force=force)
    check_writable(folder)
    with accessing(folder):
        names = os.listdir(folder)
        logs = {name: int(match[1]) for name in names if (match := _LOG.fullmatch(name))}
        if logs and not (resume or force):
            raise InputError(
                folder,
                "",
                "must not hold logs of simulated trials: use --resume to continue from them, --force to "
                "overwrite them, or another folder",
            )
        temporary = [name for name in names if _TEMPORARY.fullmatch(name)]
        for name in [*temporary, *(logs if force else ())]:
            (Path(folder) / name).unlink(missing_ok=True)
    indices = [] if force else sorted(logs.values())
    if indices and indices[-1] >= count:
        path = log_path(folder, indices[-1])
        raise InputError(path, "", f"must be one of {count} trials to be resumed; {OVERWRITE}")
    return indices


class LogStore:
    """The logs of a batch as results of its tasks, each of which runs some of its trials.

    Args:
        folder: Prepared by `open_log_folder`.
        indices: Of the trials that have a log.
        describe: Returns the metadata, all but the status, that the log of a trial must have.
    """

    def __init__(self, folder: str, indices: list[int], describe: Callable[[int], Mapping[str, Any]]) -> None:
        self._folder = folder
        self._indices = tuple(indices)
        self._describe = describe

    def rows(self) -> dict[int, dict[str, Any]]:
        """The rows of the trials whose logs are complete, by index.

        A log is incomplete if a power failure cut it.

        Raises:
            InputError: A log is of another configuration, a file is no log, or it cannot be read.
        """
        rows = ((index, self._row(index)) for index in self._indices)
        return {index: row for index, row in rows if row is not None}

    def _row(self, index: int) -> dict[str, Any] | None:
        path = log_path(self._folder, index)
        try:
            trial = read_log(path)
        except InputError as error:
            if isinstance(error.__cause__, pa.ArrowException | OSError) and os.access(path, os.R_OK):
                return None
            raise
        ours = json.loads(json.dumps(dict(self._describe(index))))
        theirs = {name: value for name, value in trial.metadata.items() if name not in _OF_THE_RUN}
        if differs := first_difference(theirs, ours):
            raise InputError(
                path,
                "",
                f"must be of the same configuration to be resumed, as a batch never mixes configurations: "
                f"{differs}; {OVERWRITE}",
            )
        row: dict[str, Any] = json.loads(as_json(row_of(trial, path)))
        return row

    def read(self, task: Task) -> Any:
        """Never: a batch runs only trials without a log.

        Raises:
            KeyError: Always.
        """
        raise KeyError(task.key)

    def write(self, task: Task, text: str) -> Any:
        """The rows of a task; the process that ran its trials has written the logs."""
        return json.loads(text)


def row_of(trial: Trial, path: Path | None) -> dict[str, Any]:
    """Seed, route and metrics of a trial, and the path of its log."""
    row = {"seed": trial.metadata["seed"], "route": trial.metadata["route"], **metrics(trial)}
    return row | {"log": None if path is None else os.fspath(path)}


def write_log_of_batch(trial: Trial, path: Path) -> None:
    """Writes the log of a trial into the folder of its batch.

    Raises:
        RunError: The disk is full, or the folder was removed or can no longer be written to.
    """
    # A new folder would look like that of a batch without the earlier trials.
    if not path.parent.is_dir():
        raise RunError(f"{path}: cannot be written: its folder was removed during the run")
    try:
        write_log(trial, path)
    except DrakeSharedError as error:
        raise RunError(str(error)) from error
