"""Errors that this package raises on purpose."""

from __future__ import annotations

import copyreg
import os
from typing import Any


class DrakeSharedError(Exception):
    """Root of the errors of this package. Its text is one line."""


class InputError(DrakeSharedError, ValueError):
    """A file, option or argument cannot be used.

    Args:
        source: The file, option or object that holds the input.
        field: The field at fault; empty for the whole.
        expected: What the field must be.
        got: What it is, if that helps.

    Attributes:
        source: As above, as text.
        field: As above.
    """

    def __init__(self, source: str | os.PathLike[str], field: str, expected: str, got: object = None) -> None:
        self.source = os.fspath(source)
        self.field = field
        found = "" if got is None else f", got {got}"
        self._expected = f"{expected}{found}"
        where = f"{self.source}: {field}" if field else self.source
        super().__init__(" ".join(f"{where} {self._expected}".split()))

    def within(self, source: str | os.PathLike[str], path: str = "") -> InputError:
        """The same error of a file that holds the object at fault in its field ``path``."""
        return InputError(source, ".".join(filter(None, (path, self.field))), self._expected)

    def __reduce__(self) -> tuple[Any, ...]:
        # By default an exception is rebuilt in another process by __init__ with its text alone.
        return copyreg.__newobj__, (type(self), str(self)), self.__dict__  # type: ignore[attr-defined]


class RunError(DrakeSharedError):
    """A run failed although its input is valid: training diverged, for example."""
