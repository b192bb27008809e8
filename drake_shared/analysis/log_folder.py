"""The folder with the logs of a batch of trials, all of one configuration."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from drake_shared.analysis.metrics import metrics_of
from drake_shared.common.errors import DrakeSharedError, InputError, RunError
from drake_shared.common.files import check_writable
from drake_shared.simulation.log import Trial, read_logs, write_logs
from drake_shared.simulation.runner.identity import first_difference
from drake_shared.simulation.runner.store import OVERWRITE, accessing, check_resume_or_force
from drake_shared.simulation.runner.tasks import Task, as_json

# The first and last trial of a log; both are the same in a log of one trial.
_LOG = re.compile(r"trials?_(\d{5,})(?:-(\d{5,}))?\.parquet")
# Temporary files of replacing(), which a killed process leaves, are called .trial_00003.parquet.k3v9x2ab.
_TEMPORARY = re.compile(rf"\.{_LOG.pattern}\.\w+")

# Entries of the metadata that are not settings of the trial.
_OF_THE_RUN = ("status", "engine")


def log_path(folder: str | os.PathLike[str], indices: Sequence[int]) -> Path:
    """The path of the log of trials of a batch that follow each other."""
    first, last = indices[0], indices[-1]
    name = f"trial_{first:05d}" if first == last else f"trials_{first:05d}-{last:05d}"
    return Path(folder) / f"{name}.parquet"


def open_log_folder(
    folder: str | os.PathLike[str], *, count: int, resume: bool = False, force: bool = False
) -> list[Path]:
    """Prepares a folder for the logs of ``count`` trials, and removes temporary files of killed processes.

    Args:
        folder: Created if it does not exist. Files that are not logs of a batch are ignored and kept.
        count: Number of trials in the batch.
        resume: Keep the logs in the folder.
        force: Remove the logs in the folder.

    Returns:
        The logs in it.

    Raises:
        InputError: There are logs and neither ``resume`` nor ``force`` is set, or some beyond ``count``; or
            both are set; or the folder cannot be written to.
    """
    check_resume_or_force(folder, resume=resume, force=force)
    check_writable(folder)
    with accessing(folder):
        names = os.listdir(folder)
        logs = {name: int(match[2] or match[1]) for name in names if (match := _LOG.fullmatch(name))}
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
    kept = [] if force else sorted(logs, key=logs.__getitem__)
    if kept and logs[kept[-1]] >= count:
        path = Path(folder) / kept[-1]
        raise InputError(path, "", f"must be of {count} trials to be resumed; {OVERWRITE}")
    return [Path(folder) / name for name in kept]


class LogStore:
    """The logs of a batch as results of its tasks, each of which runs some of its trials.

    Args:
        logs: Of `open_log_folder`.
        describe: Returns the metadata, all but the status, that the log of a trial must have.
    """

    def __init__(self, logs: Sequence[Path], describe: Callable[[int], Mapping[str, Any]]) -> None:
        self._logs = tuple(logs)
        self._describe = describe

    def rows(self) -> dict[int, dict[str, Any]]:
        """The rows of the trials whose logs are complete, by index.

        A log is incomplete if a power failure cut it.

        Raises:
            InputError: A log is of another configuration, a file is no log, or it cannot be read.
        """
        return {index: row for path in self._logs for index, row in self._rows(path).items()}

    def _rows(self, path: Path) -> dict[int, dict[str, Any]]:
        try:
            trials = read_logs(path)
        except InputError as error:
            if isinstance(error.__cause__, pa.ArrowException | OSError) and os.access(path, os.R_OK):
                return {}
            raise
        match = _LOG.fullmatch(path.name)
        if match and match[2] is None:
            trials = {int(match[1]): trial for trial in trials.values()}
        for index, trial in trials.items():
            ours = json.loads(json.dumps(dict(self._describe(index))))
            theirs = {name: value for name, value in trial.metadata.items() if name not in _OF_THE_RUN}
            if differs := first_difference(theirs, ours):
                raise InputError(
                    path if len(trials) == 1 else f"{path}#{index}",
                    "",
                    f"must be of the same configuration to be resumed, as a batch never mixes "
                    f"configurations: {differs}; {OVERWRITE}",
                )
        found = json.loads(as_json(rows_of(trials, path)))
        return dict(zip(trials, found, strict=True))

    def read(self, task: Task) -> Any:
        """Never: a batch runs only trials without a log.

        Raises:
            KeyError: Always.
        """
        raise KeyError(task.key)

    def write(self, task: Task, text: str) -> Any:
        """The rows of a task; the process that ran its trials has written the logs."""
        return json.loads(text)


def rows_of(trials: Mapping[int, Trial], path: Path | None) -> list[dict[str, Any]]:
    """Seed, route and metrics of trials, by index, and where each is in the log of all of them."""
    rows = []
    for (index, trial), measured in zip(trials.items(), metrics_of(list(trials.values())), strict=True):
        log = None if path is None else os.fspath(path) if len(trials) == 1 else f"{path}#{index}"
        row = {"seed": trial.metadata["seed"], "route": trial.metadata["route"], **measured, "log": log}
        rows.append(row)
    return rows


def write_log_of_batch(trials: Mapping[int, Trial], path: Path) -> None:
    """Writes the log of trials, by index, into the folder of their batch.

    Raises:
        RunError: The disk is full, or the folder was removed or can no longer be written to.
    """
    # A new folder would look like that of a batch without the earlier trials.
    if not path.parent.is_dir():
        raise RunError(f"{path}: cannot be written: its folder was removed during the run")
    try:
        write_logs(trials, path)
    except DrakeSharedError as error:
        raise RunError(str(error)) from error
