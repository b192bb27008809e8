"""What others register through entry points."""

from __future__ import annotations

import os
from importlib.metadata import entry_points
from typing import Any

from drake_shared.common.errors import InputError


def registered_names(group: str) -> list[str]:
    """Names that are registered in an entry point group."""
    return [point.name for point in entry_points(group=group)]


def load_registered(group: str, name: str, *, source: str | os.PathLike[str], field: str = "") -> Any:
    """What is registered under ``name``; None if nothing is.

    Args:
        group: Of entry points.
        name: Of one of them.
        source, field: What asked for it, for the error message.

    Raises:
        InputError: It cannot be imported.
    """
    for point in entry_points(group=group):
        if point.name == name:
            try:
                return point.load()
            except Exception as error:  # What others register may fail in any way.
                why = f"{type(error).__name__}: {error}"
                raise InputError(
                    source, field, f"{name!r} ({point.value}) cannot be imported ({why})"
                ) from error
    return None
