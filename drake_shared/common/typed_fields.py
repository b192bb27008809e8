"""Plain values as dataclasses, with the path of the field in every error."""

from __future__ import annotations

import dataclasses
import math
import os
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from drake_shared.common.errors import InputError
from drake_shared.common.suggestions import did_you_mean, suggestion

T = TypeVar("T")
Source = str | os.PathLike[str]
_NAMES = {str: "text", int: "a whole number", float: "a finite number", bool: "true or false"}


def read_fields(schema: type[T], data: Any, *, source: Source, path: str = "") -> T:
    """The dataclass that a mapping describes, with those inside it.

    Args:
        schema: A dataclass of text, numbers, booleans, literals, lists, mappings and further dataclasses.
        data: Plain values, as YAML and JSON hold them.
        source: File that the values are from, for errors.
        path: Of the field that holds them, for errors.

    Raises:
        InputError: A field is unknown, is missing, or has a value of another type.
    """
    if not isinstance(data, Mapping):
        raise InputError(source, path, "must be fields with values", repr(data))
    hints = typing.get_type_hints(schema)
    fields = {field.name: field for field in dataclasses.fields(schema)}  # type: ignore[arg-type]
    for name in data:
        if name not in fields:
            raise InputError(source, _join(path, name), f"is unknown{did_you_mean(str(name), fields)}")
    for name, field in fields.items():
        required = field.default is field.default_factory is dataclasses.MISSING
        if required and name not in data:
            raise InputError(source, _join(path, name), "must be given")
    values = {name: _value(hints[name], data[name], source, _join(path, name)) for name in data}
    try:
        return schema(**values)
    except InputError as error:
        raise error.within(source, path) from error


def _value(kind: Any, value: Any, source: Source, path: str) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        kinds = [item for item in arguments if item is not type(None)]
        if value is None and len(kinds) < len(arguments):
            return None
        fitting = next((item for item in kinds if type(value) is item), kinds[0])
        return _value(fitting, value, source, path)
    if dataclasses.is_dataclass(kind):
        return read_fields(typing.cast(type[Any], kind), value, source=source, path=path)
    if origin is tuple:
        if not isinstance(value, list | tuple):
            raise InputError(source, path, "must be a list ([] is an empty one)", repr(value))
        return tuple(_value(arguments[0], item, source, f"{path}[{i}]") for i, item in enumerate(value))
    if origin is typing.Literal:
        if value not in arguments:
            expected = f"must be one of {', '.join(arguments)}{suggestion(str(value), arguments)}"
            raise InputError(source, path, expected, repr(value))
        return value
    if origin is Mapping:
        if not isinstance(value, Mapping):
            raise InputError(source, path, "must be names with values", repr(value))
        return {name: _value(arguments[1], item, source, _join(path, name)) for name, item in value.items()}
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not kind or (kind is float and not math.isfinite(value)):
        raise InputError(source, path, f"must be {_NAMES[kind]}", repr(value))
    return value


def _join(path: str, name: object) -> str:
    return f"{path}.{name}" if path else str(name)
