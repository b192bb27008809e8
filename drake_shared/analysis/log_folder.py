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
    """The logs of a batch as results of its tasks, whose argument ``index`` is the number of the trial.

    Args:
        folder: Prepared by `open_log_folder`.
        indices: Of the trials that have a log.
        describe: Returns the metadata, all but the status, that the log of a trial must have.
    """

    def __init__(self, folder: str, indices: list[int], describe: Callable[[int], Mapping[str, Any]]) -> None:
        self._folder = folder
        self._indices = frozenset(indices)
        self._describe = describe

    def read(self, task: Task) -> Any:
        """The row of a trial whose log is complete.

        Raises:
            KeyError: It has no log, or one that is incomplete (as a power failure may leave it).
            InputError: The log is of another configuration, the file is no log, or it cannot be read.
        """
        index = task.arguments["index"]
        if index not in self._indices:
            raise KeyError(index)
        path = log_path(self._folder, index)
        try:
            trial = read_log(path)
        except InputError as error:
            if isinstance(error.__cause__, pa.ArrowException | OSError) and os.access(path, os.R_OK):
                raise KeyError(index) from error
            raise
        ours = json.loads(json.dumps(dict(self._describe(index))))
        theirs = {name: value for name, value in trial.metadata.items() if name != "status"}
        if differs := first_difference(theirs, ours):
            raise InputError(
                path,
                "",
                f"must be of the same configuration to be resumed, as a batch never mixes configurations: "
                f"{differs}; {OVERWRITE}",
            )
        return json.loads(as_json(row_of(trial, path)))

    def write(self, task: Task, text: str) -> Any:
        """The row of a trial; the process that ran it has written the log."""
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
