"""What is to be run: a function's name and its arguments, as text that is the same everywhere."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import json
import re
from collections.abc import Callable
from typing import Any

from drake_shared.common.errors import InputError

_FUNCTION = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


@dataclasses.dataclass(frozen=True)
class Task:
    """A call that another process can make, or another machine, with the same result.

    Attributes:
        function: "package.module:name" of a function of that module.
        arguments: Its keyword arguments, of what JSON can say; tuples become lists and numpy's numbers and
            arrays plain ones at once, so that the function gets the same wherever it runs.

    Raises:
        InputError: The function's name is not of that form, or JSON cannot say the arguments.
    """

    function: str
    arguments: dict[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if not _FUNCTION.fullmatch(self.function):
            raise InputError("task", "function", 'must be "package.module:name"', self.function)
        try:
            arguments = json.loads(canonical(self.arguments))
        except (TypeError, ValueError) as error:
            raise InputError(
                f"task {self.function}", "arguments", f"must be what JSON can say ({error})"
            ) from None
        if not isinstance(arguments, dict):
            raise InputError(f"task {self.function}", "arguments", "must be given by name", arguments)
        object.__setattr__(self, "arguments", arguments)

    @property
    def key(self) -> str:
        """The first 24 hexadecimal digits of the SHA-256 of function and arguments."""
        return digest(canonical([self.function, self.arguments]))

    def find(self) -> Callable[..., Any]:
        """Imports the function.

        Raises:
            InputError: There is no such module or function.
        """
        module, name = self.function.split(":")
        try:
            function = getattr(importlib.import_module(module), name, None)
        except ModuleNotFoundError as error:
            raise InputError("task", "function", f"must be in a module that is there ({error})") from error
        if not callable(function):
            raise InputError("task", "function", f"must be a function of {module}", name)
        return function

    def run(self) -> Any:
        """Calls the function and returns what it did, as it would be read from a file."""
        return json.loads(as_json(self.find()(**self.arguments)))


def canonical(value: Any) -> str:
    """The one JSON text of a value, whatever the order of its keys; else as `as_json`."""
    return as_json(value, sort_keys=True)


def as_json(value: Any, *, sort_keys: bool = False) -> str:
    """A value as JSON, with every digit of every float.

    NaN and the infinities are written as ``NaN``, ``Infinity`` and ``-Infinity``, which is not in the
    standard but is what Python's json reads and writes, so that no number is lost.

    Raises:
        TypeError, ValueError: JSON cannot say it.
    """
    return json.dumps(value, sort_keys=sort_keys, separators=(",", ":"), default=_plain)


def digest(text: str) -> str:
    """The first 24 hexadecimal digits of the SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _plain(value: Any) -> Any:
    # Numbers and arrays of numpy (and torch) alike, without importing either.
    if callable(getattr(value, "tolist", None)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not of JSON")
