"""Tables for people: figures with unit, direction and meaning."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Iterable, Sequence

from drake_shared.analysis.glossary import measure

_WIDTH = 110
_PLAIN = ("share", "-1 to 1")
_ARROWS = {"higher": "higher is better", "lower": "lower is better"}


def figure_lines(rows: Iterable[tuple[str, str]], *, command_unit: str = "rad/s") -> list[str]:
    """Lines of a table of figures.

    Args:
        rows: Name of each figure, and its value as text.
        command_unit: Of the robot's commands.

    Returns:
        For each figure the name, the value, the unit, which way is better, and, where the line is long
        enough, what it means; see `drake_shared.analysis.glossary`.
    """
    listed = list(rows)
    names = max((len(name) for name, _ in listed), default=0)
    values = max((len(value) for _, value in listed), default=0)
    lines = []
    for name, value in listed:
        found = measure(name)
        unit = "" if found is None or found.unit in _PLAIN else found.unit_for(command_unit)
        better = "" if found is None else _ARROWS.get(found.better, found.better)
        meaning = "" if found is None else found.meaning
        lines.append(f"  {name:{names}s}  {value:{values}s}  {unit:5s}  {better:16s}  {meaning}".rstrip())
    return _cut(lines)


def interval(values: dict[str, float | None]) -> str:
    """A mean with its 95% interval, as text."""
    ends = "" if values["low"] is None else f" [{values['low']:.4g}, {values['high']:.4g}]"
    return f"{values['mean']:.4g}{ends}"


def wrapped(head: str, text: str, width: int) -> list[str]:
    """A line with ``head`` in a column of ``width`` and ``text`` beside it, over several lines if needed."""
    room = max(_line_width() - width - 2, 30)
    first, *rest = textwrap.wrap(text, room) or [""]
    return [f"{head:{width}s}  {first}".rstrip(), *(f"{'':{width}s}  {line}" for line in rest)]


def _cut(lines: Sequence[str]) -> list[str]:
    """Lines that fit the terminal; in a file or a pipe they keep their length."""
    if not (sys.stdout and sys.stdout.isatty()):
        return list(lines)
    width = _line_width()
    return [line if len(line) <= width else f"{line[: width - 1]}…" for line in lines]


def _line_width() -> int:
    return shutil.get_terminal_size((_WIDTH, 24)).columns
