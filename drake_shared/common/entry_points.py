"""Objects that other packages register through entry points."""

from __future__ import annotations

import os
from importlib.metadata import entry_points
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.common.suggestions import suggestion


def registered_names(group: str) -> list[str]:
    """Names registered in an entry point group."""
    return [point.name for point in entry_points(group=group)]


def load_registered(group: str, name: str, *, source: str | os.PathLike[str], field: str = "") -> Any:
    """Imports the object registered under ``name``; None if there is no such name.

    Args:
        group: Entry point group.
        name: Name in that group.
        source: File or option that names it, for the error message.
        field: Field of ``source``, for the error message.

    Raises:
        InputError: The object cannot be imported.
    """
    for point in entry_points(group=group):
        if point.name == name:
            try:
                return point.load()
            except Exception as error:  # A plug-in may fail in any way.
                reason = f"{type(error).__name__}: {error}"
                raise InputError(
                    source, field, f"{name!r} ({point.value}) cannot be imported ({reason})"
                ) from error
    return None


def make_registered(group: str, name: str, role: str, /, **arguments: Any) -> Any:
    """Calls the function that is registered under ``name``, and returns what it makes.

    Args:
        group, name: See `load_registered`.
        role: What it makes, such as "operator"; for error messages.
        arguments: Keyword arguments of the function.

    Raises:
        InputError: There is no such name, or its function cannot be imported or raises an exception.
    """
    make = load_registered(group, name, source=role)
    if make is None:
        names = registered_names(group)
        expected = f"must be a registered {role} ({', '.join(names) or 'none'}){suggestion(name, names)}"
        raise InputError(role, "", expected, repr(name))
    try:
        return make(**arguments)
    except Exception as error:  # Functions from outside may raise anything.
        reason = f"{type(error).__name__}: {error}"
        raise InputError(role, "", f"{name!r} cannot be made ({reason})") from error
