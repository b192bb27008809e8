"""Tables of logs: one file holds one trial or several.

A file of several trials, version 2, has a column ``trial`` (int64) with the number of the trial of each row;
all rows of a trial are together. Its metadata are what all its trials share, and under ``trials``, by the
number as text, what they do not. ``FILE#3`` names trial 3 of a file.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from drake_shared.common.errors import InputError

TRIAL = "trial"
TRIALS = "trials"
LOG_VERSION = 1
SEVERAL_VERSION = 2

_NUMBERED = re.compile(r"(.+)#(\d+)")


def split_number(path: str | os.PathLike[str]) -> tuple[str, int | None]:
    """The file, and the number of a trial in it if ``path`` is of the form FILE#NUMBER."""
    text = os.fspath(path)
    match = None if os.path.exists(text) else _NUMBERED.fullmatch(text)
    return (text, None) if match is None else (match[1], int(match[2]))


def split_table(
    path: str, table: pa.Table, metadata: Mapping[str, Any], number: int | None = None
) -> dict[int | None, tuple[pa.Table, dict[str, Any]]]:
    """Table and metadata of each trial of a file, by its number; the number is None in a file of one trial.

    Args:
        path: Of the file, for error messages.
        table: Of the file.
        metadata: Of the file.
        number: Of the only trial that is wanted, if it is not all.

    Raises:
        InputError: Column and metadata do not hold the same trials, each once, or none of that number.
    """
    if metadata.get("version") != SEVERAL_VERSION:
        if number is not None:
            raise InputError(path, "", "must hold several trials for one of them to be named", f"#{number}")
        return {None: (table, dict(metadata))}
    common = {name: value for name, value in metadata.items() if name != TRIALS}
    own = metadata.get(TRIALS)
    holds_numbers = TRIAL in table.column_names and pa.types.is_integer(table.schema.field(TRIAL).type)
    numbers = table[TRIAL].to_numpy() if holds_numbers else np.empty(0, np.int64)
    begins = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist(), len(numbers)]
    found = numbers[begins[:-1]].tolist() if len(numbers) else []
    if not found or not isinstance(own, dict) or sorted(own) != sorted(map(str, found)):
        raise InputError(path, TRIAL, f"must be a column of whole numbers, those under {TRIALS!r}, each once")
    if number is not None and number not in found:
        raise InputError(path, TRIAL, f"must be one of {found[0]} to {found[-1]}", number)
    rest = table.drop_columns([TRIAL])
    return {
        trial: (
            rest.slice(begin, end - begin),
            {**common, **own[str(trial)], "version": LOG_VERSION},
        )
        for trial, begin, end in zip(found, begins, begins[1:], strict=False)
        if number in (None, trial)
    }


def shared_metadata(metadata: Mapping[int, Mapping[str, Any]]) -> dict[str, Any]:
    """The metadata of a file of several trials, from theirs by number."""
    first, *others = metadata.values()
    common = {
        name: value
        for name, value in first.items()
        if all(name in other and (other[name] is value or other[name] == value) for other in others)
    }
    own = {
        str(number): {name: value for name, value in described.items() if name not in common}
        for number, described in metadata.items()
    }
    return {**common, "version": SEVERAL_VERSION, TRIALS: own}
