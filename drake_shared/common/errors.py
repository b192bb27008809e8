"""The errors that this package raises on purpose."""

from __future__ import annotations

import copyreg
import os


class DrakeSharedError(Exception):
    """Root of the errors of this package; its text is one line for the person at the keyboard."""


class InputError(DrakeSharedError, ValueError):
    """Something given from outside cannot be used.

    Args:
        source: The file, option or object that holds it.
        field: The part of it that is at fault; empty for the whole.
        expected: What it must be.
        got: What it is, if that helps.
    """

    def __init__(self, source: str | os.PathLike[str], field: str, expected: str, got: object = None) -> None:
        where = f"{os.fspath(source)}: {field}" if field else os.fspath(source)
        came = "" if got is None else f", got {got}"
        super().__init__(" ".join(f"{where} {expected}{came}".split()))

    def __reduce__(self) -> tuple:
        # An exception is made anew from its text alone when it comes from another process.
        return copyreg.__newobj__, (type(self), str(self))  # type: ignore[attr-defined]


class RunError(DrakeSharedError):
    """A run failed for a reason that is not in its input (training diverged, say)."""
