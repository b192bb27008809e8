"""YAML documents whose mappings have each key once, as text."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import yaml

from drake_shared.common.errors import InputError


def read_yaml(path: str | os.PathLike[str], what: str) -> str:
    """The text of a YAML file.

    Args:
        path: Of the file.
        what: What it should hold, for the error message.

    Raises:
        InputError: It cannot be read as text.
    """
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"cannot be read as {what}: {error}") from error


def parse_yaml(text: str, *, source: str | os.PathLike[str], what: str) -> yaml.Node | None:
    """The root node of a YAML text; None if the text is empty.

    Args:
        text: One YAML document.
        source: File that the text is from, for the error message.
        what: What it should hold, for the error message.

    Raises:
        InputError: The text is not YAML, or a mapping has a key twice, or one that is not text.
    """
    try:
        root: yaml.Node | None = yaml.compose(text, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, RecursionError) as error:
        raise InputError(source, "", f"cannot be read as {what}, since it is not YAML: {error}") from error
    if root is not None:
        _check_keys(root, "", source, set())
    return root


def value_of(node: yaml.Node) -> Any:
    """The plain value of a node of `parse_yaml`: dictionaries, lists, text, numbers, booleans and None.

    Raises:
        yaml.YAMLError: A value has a tag that plain YAML does not know.
    """
    return yaml.SafeLoader("").construct_document(node)


def line_of(node: yaml.Node) -> int:
    """The line on which a node begins, from 1."""
    line: int = node.start_mark.line
    return line + 1


def _check_keys(node: yaml.Node, field: str, source: str | os.PathLike[str], seen: set[int]) -> None:
    # An alias is the same node again; it may even contain itself.
    if id(node) in seen:
        return
    seen.add(id(node))
    if isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            _check_keys(item, f"{field}[{index}]", source, seen)
    elif isinstance(node, yaml.MappingNode):
        lines: dict[str, int] = {}
        for key, value in node.value:
            inner = _check_key(key, field, lines, source)
            _check_keys(value, inner, source, seen)


def _check_key(key: yaml.Node, field: str, lines: dict[str, int], source: str | os.PathLike[str]) -> str:
    """The path of the field that ``key`` names; ``lines`` gathers the keys of its mapping."""
    line = line_of(key)
    if not isinstance(key, yaml.ScalarNode):
        raise InputError(source, field, f"must have keys that are text; the one on line {line} is not")
    path = f"{field}.{key.value}" if field else key.value
    if key.tag not in ("tag:yaml.org,2002:str", "tag:yaml.org,2002:merge"):
        meaning = json.dumps(value_of(key), default=str)
        expected = f"means {meaning} in YAML; as a name write it in quotes: '{key.value}' (line {line})"
        raise InputError(source, path, expected)
    if key.value in lines:
        raise InputError(source, path, f"must be given once; it is on lines {lines[key.value]} and {line}")
    lines[key.value] = line
    return path
