"""Tasks: the name of a function and its arguments, as text that is the same everywhere."""

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
    """A call that another process or another machine can make, with the same result.

    Attributes:
        function: "package.module:name" of a function of that module.
        arguments: Its keyword arguments, which must be JSON-serializable. Tuples are converted to lists, and
            NumPy scalars and arrays to numbers and lists, at once: the function receives the same arguments
            wherever it runs.

    Raises:
        InputError: The name of the function is malformed, or the arguments are not JSON-serializable.
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
                f"task {self.function}", "arguments", f"must be JSON-serializable ({error})"
            ) from None
        if not isinstance(arguments, dict):
            raise InputError(f"task {self.function}", "arguments", "must be given by name", arguments)
        object.__setattr__(self, "arguments", arguments)

    @classmethod
    def of(cls, function: Callable[..., Any], **arguments: Any) -> Task:
        """The call of a function that is defined at the top of its module."""
        return cls(f"{function.__module__}:{function.__qualname__}", arguments)

    @property
    def module(self) -> str:
        """The module of the function."""
        return self.function.partition(":")[0]

    @property
    def key(self) -> str:
        """The first 24 hexadecimal digits of the SHA-256 of function and arguments."""
        return digest(canonical([self.function, self.arguments]))

    def find(self) -> Callable[..., Any]:
        """Imports the function.

        Raises:
            InputError: The module or the function does not exist.
        """
        name = self.function.partition(":")[2]
        try:
            function = getattr(importlib.import_module(self.module), name, None)
        except ModuleNotFoundError as error:
            raise InputError("task", "function", f"must be in an existing module ({error})") from error
        if not callable(function):
            raise InputError("task", "function", f"must be a function of {self.module}", name)
        found: Callable[..., Any] = function
        return found

    def run(self) -> Any:
        """Calls the function and returns its value as it would be read from a file."""
        return json.loads(as_json(self.find()(**self.arguments)))


def canonical(value: Any) -> str:
    """The JSON text of a value with sorted keys; otherwise as `as_json`."""
    return as_json(value, sort_keys=True)


def as_json(value: Any, *, sort_keys: bool = False) -> str:
    """A value as JSON, with every digit of every float.

    NaN and infinities are written as ``NaN``, ``Infinity`` and ``-Infinity``, which are not in the standard
    but are read by Python's json module.

    Raises:
        TypeError, ValueError: The value is not JSON-serializable.
    """
    return json.dumps(value, sort_keys=sort_keys, separators=(",", ":"), default=_as_plain)


def digest(text: str) -> str:
    """The first 24 hexadecimal digits of the SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _as_plain(value: Any) -> Any:
    # NumPy's scalars and arrays (and torch's tensors), without importing either.
    if callable(getattr(value, "tolist", None)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not JSON-serializable")
