"""Prepares docstrings for napoleon: headings with a remark, and several named results."""

from __future__ import annotations

import re
from typing import Any

_HEADING = re.compile(
    r"^(?P<indent> *)(?P<name>Inputs|Outputs|State|Parameters|Returns)(?P<remark>[ ,].+)?:$"
)
_ENTRY = re.compile(r"^[a-z]\w*(, \w+)*( \([^)]*\))?: ")


def prepare(_app: Any, _what: str, _name: str, _object: object, _options: Any, lines: list[str]) -> None:
    """Changes the lines of a docstring in place.

    "Outputs (all are state):" becomes a paragraph with the remark and the heading "Outputs:";
    "Parameters of the Context:" becomes "Context parameters:"; "Returns:" above several named results becomes
    "Results:".
    """
    for index in reversed(range(len(lines))):
        heading = _HEADING.match(lines[index])
        if heading is None:
            continue
        indent, name, remark = heading["indent"], heading["name"], (heading["remark"] or "").strip(" ,()")
        if name == "Parameters":
            lines[index] = f"{indent}Context parameters:"
        elif name == "Returns":
            if _entries(lines[index + 1 :], len(indent) + 4):
                lines[index] = f"{indent}Results:"
        elif remark:
            lines[index : index + 1] = [f"{indent}{name}: {remark}.", "", f"{indent}{name}:"]


def _entries(lines: list[str], indent: int) -> bool:
    """Whether there are several lines at this indent, and each begins with a name and a colon."""
    first = []
    for line in lines:
        if line.strip() and len(line) - len(line.lstrip()) < indent:
            break
        if line.strip() and len(line) - len(line.lstrip()) == indent:
            first.append(line.strip())
    return len(first) > 1 and all(_ENTRY.match(line) for line in first)


def setup(app: Any) -> dict[str, Any]:
    """Runs before napoleon, whose priority is 500."""
    app.connect("autodoc-process-docstring", prepare, priority=400)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
