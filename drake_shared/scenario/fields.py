"""Checks of the fields of a YAML scenario, with the place of the mistake in each message."""

from __future__ import annotations

import dataclasses
import os
import types
import typing
from collections.abc import Mapping
from typing import Any

import yaml

from drake_shared.common.errors import InputError
from drake_shared.common.suggestions import did_you_mean
from drake_shared.common.yaml_document import line_of, value_of

_PREFIX = "tag:yaml.org,2002:"


def check_fields(
    node: yaml.Node, schema: Any, *, source: str | os.PathLike[str], with_lines: bool = True
) -> None:
    """Checks that a document has only fields of ``schema``, with values of their types.

    Drake's ``yaml_load_typed`` refuses the same documents, but names no field and no line. Fields at the root
    that begin with an underscore are ignored, as there.

    Args:
        node: Root of the document.
        schema: A dataclass whose fields are numbers, text, lists, mappings of text, and further dataclasses.
        source: File that the document is from, for the error message.
        with_lines: Whether the message gives the line.

    Raises:
        InputError: A field is unknown or has a value of another type.
    """
    _FieldCheck(source, with_lines).check(node, schema, "")


class _FieldCheck:
    def __init__(self, source: str | os.PathLike[str], with_lines: bool) -> None:
        self._source = source
        self._with_lines = with_lines

    def check(self, node: yaml.Node, schema: Any, field: str) -> None:
        kind, arguments = typing.get_origin(schema), typing.get_args(schema)
        if kind in (typing.Union, types.UnionType):
            schema = self._choose(node, {f"!{item.__name__}": item for item in arguments}, field)
        if dataclasses.is_dataclass(schema):
            self._check_fields(node, typing.get_type_hints(schema), field)
        elif kind is list:
            if not isinstance(node, yaml.SequenceNode):
                raise self._wrong(node, field, "must be a list ([] is an empty one)")
            for index, item in enumerate(node.value):
                self.check(item, arguments[0], f"{field}[{index}]")
        elif kind is dict:
            if not isinstance(node, yaml.MappingNode):
                raise self._wrong(node, field, "must be names with values")
            for key, value in node.value:
                self.check(value, arguments[1], f"{field}.{key.value}")
        elif schema is float:
            self._check_number(node, field)
        elif schema is bool:
            if not isinstance(node, yaml.ScalarNode) or node.value not in ("true", "false"):
                raise self._wrong(node, field, "must be true or false")
        elif schema is str:
            self._check_text(node, field)

    def _check_fields(self, node: yaml.Node, schema: Mapping[str, Any], field: str) -> None:
        if not isinstance(node, yaml.MappingNode):
            raise self._wrong(node, field, "must be fields with values")
        known = [name for name in schema if typing.get_origin(schema[name]) is not typing.ClassVar]
        for key, value in node.value:
            if key.tag == f"{_PREFIX}merge" or (not field and key.value.startswith("_")):
                continue
            inner = f"{field}.{key.value}" if field else key.value
            if key.value not in known:
                where = f" in {name!r}" if field and (name := _name_in(node)) else ""
                expected = f"is unknown{where}{self._line(key)}{did_you_mean(key.value, known)}"
                raise InputError(self._source, inner, expected)
            self.check(value, schema[key.value], inner)

    def _choose(self, node: yaml.Node, tags: Mapping[str, Any], field: str) -> Any:
        """The dataclass that the tag of a node names; the first one without a tag."""
        if node.tag.startswith(_PREFIX):
            return next(iter(tags.values()))
        if node.tag not in tags:
            expected = f"has an unknown tag {node.tag}{self._line(node)}{did_you_mean(node.tag, tags)}"
            raise InputError(self._source, field, expected)
        return tags[node.tag]

    def _check_number(self, node: yaml.Node, field: str) -> None:
        value = value_of(node) if isinstance(node, yaml.ScalarNode) and node.tag.startswith(_PREFIX) else None
        if isinstance(value, str):
            try:
                float(value)  # YAML takes 1e-2, without a point, for text.
            except ValueError:
                value = None
        elif isinstance(value, bool) or not isinstance(value, int | float):
            value = None
        elif value != _decimal(node.value) and value == value:
            # YAML 1.1 reads 1:30 to the base 60, and 010 to the base 8.
            raise self._wrong(node, field, f"must be a decimal number (YAML reads {value:g})")
        if value is None:
            raise self._wrong(node, field, "must be a number")

    def _check_text(self, node: yaml.Node, field: str) -> None:
        if not isinstance(node, yaml.ScalarNode):
            raise self._wrong(node, field, "must be text")
        # The values of off, null and 1_0 are not what is written.
        if not node.tag.startswith(_PREFIX) or str(value_of(node)) != node.value:
            raise self._wrong(node, field, "must be text in quotes")

    def _wrong(self, node: yaml.Node, field: str, expected: str) -> InputError:
        if isinstance(node, yaml.ScalarNode):
            got = repr(node.value) if node.value else "nothing"
        else:
            got = "a list" if isinstance(node, yaml.SequenceNode) else "fields"
        return InputError(self._source, field, expected, f"{got}{self._line(node)}")

    def _line(self, node: yaml.Node) -> str:
        return f" (line {line_of(node)})" if self._with_lines else ""


def _name_in(node: yaml.MappingNode) -> str | None:
    """The name of the item that a mapping describes."""
    names = (value.value for key, value in node.value if key.value == "name")
    return next((name for name in names if isinstance(name, str)), None)


def _decimal(text: str) -> float | None:
    """The number that a plain decimal notation stands for, infinity included."""
    try:
        return float(text.lower().replace("_", "").replace(".inf", "inf"))
    except ValueError:
        return None
