"""The folder of a batch's logs: begun empty, gone on with, or begun anew; never of two configurations."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa

from drake_shared.common.errors import DrakeSharedError, InputError, RunError
from drake_shared.common.files import check_writable
from drake_shared.simulation.runner.identity import first_difference
from drake_shared.simulation.trial import Trial, read_log, write_log

_LOG = re.compile(r"trial_(\d{5,})\.parquet")
# What replacing() leaves of a log when its process is killed has a name like .trial_00003.parquet.k3v9x2ab.
_HALF_WRITTEN = re.compile(r"\.trial_\d{5,}\.parquet\.\w+")
_ANEW = "give --force to begin anew, or another folder"


def log_path(folder: str | os.PathLike[str], index: int) -> Path:
    """Where the log of trial ``index`` of a batch is."""
    return Path(folder) / f"trial_{index:05d}.parquet"


def open_log_folder(
    folder: str | os.PathLike[str], *, count: int, resume: bool = False, force: bool = False
) -> list[int]:
    """Makes the folder ready for the logs of ``count`` trials; what was left half written is removed.

    Args:
        folder: Made if it is not there. What is not a log of a batch does not matter, and stays.
        count: How many trials the batch has.
        resume: Go on with the trials that are there.
        force: Begin anew where there are some: their logs are removed.

    Returns:
        The numbers of the trials that have a log, in order.

    Raises:
        InputError: There are logs and neither was asked for, or some beyond ``count``; or both were asked
            for; or the folder cannot be written to.
    """
    if resume and force:
        raise InputError(folder, "", "must be resumed or begun anew (--resume or --force), not both")
    check_writable(folder)
    try:
        names = os.listdir(folder)
        found = {name: int(match[1]) for name in names if (match := _LOG.fullmatch(name))}
        if found and not (resume or force):
            raise InputError(
                folder,
                "",
                "must hold no logs of simulated trials: give --resume to go on with those that are there, "
                "--force to begin anew in their place, or another folder",
            )
        # Left by processes that were killed: whoever begins or goes on here has given them up.
        remains = [name for name in names if _HALF_WRITTEN.fullmatch(name)]
        for name in [*remains, *(found if force else ())]:
            (Path(folder) / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(folder, "", f"must be a folder to read and write ({error.strerror})") from error
    if force:
        return []
    there = sorted(found.values())
    if there and there[-1] >= count:
        raise InputError(
            log_path(folder, there[-1]), "", f"must be one of {count} trials to be resumed; {_ANEW}"
        )
    return there


def read_kept(path: str | os.PathLike[str], expected: Mapping[str, Any]) -> Trial | None:
    """The trial that a log holds, or None if the file is torn (a machine that lost its power may leave that).

    Args:
        path: Of the log.
        expected: The metadata that the trial must have; its status is its own.

    Raises:
        InputError: It is the log of a trial of another configuration, no log at all, or must not be read.
    """
    try:
        trial = read_log(path)
    except InputError as error:
        if isinstance(error.__cause__, pa.ArrowException | OSError) and os.access(path, os.R_OK):
            return None
        raise
    ours = json.loads(json.dumps(dict(expected)))
    theirs = {name: value for name, value in trial.metadata.items() if name != "status"}
    if differs := first_difference(theirs, ours):
        raise InputError(
            path,
            "",
            f"must be of the same configuration to be resumed: {differs}; "
            f"experiments refuse to mix configurations; {_ANEW}",
        )
    return trial


def write_kept(trial: Trial, path: Path) -> None:
    """Writes a log into the folder of a batch.

    Raises:
        RunError: The disk is full, or the folder is gone or no longer to be written to.
    """
    # To make it anew would look like a batch that never had the trials before.
    if not path.parent.is_dir():
        raise RunError(f"{path}: cannot be written: its folder was removed while the trials ran")
    try:
        write_log(trial, path)
    except DrakeSharedError as error:
        raise RunError(f"{error}; earlier trials are kept, and --resume goes on from them") from error
