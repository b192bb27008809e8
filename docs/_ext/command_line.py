"""The directive ``.. command_line::``: every command of ``drake-shared`` and its options, from their help."""

from __future__ import annotations

import contextlib
import io
import os
import re
from typing import Any, NamedTuple

from docutils import nodes
from docutils.parsers.rst import Directive
from tables import make_table

_OPTION = re.compile(
    r"--?[a-z]|\[?[A-Z]{2}"
)  # As the help begins a line: an option, or a positional argument.


class Option(NamedTuple):
    """An option as its help describes it; ``default`` is empty where the help names none."""

    name: str
    meaning: str
    default: str


def help_of(*command: str) -> str:
    """What ``drake-shared COMMAND --help`` prints."""
    from drake_shared.cli.main import main

    before = {name: os.environ.get(name) for name in ("COLUMNS", "TERM")}
    os.environ.update(COLUMNS="120", TERM="dumb")
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.suppress(SystemExit):
            main([*command, "--help"])
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
    return printed.getvalue()


def commands() -> list[str]:
    """Names of all commands, and of those below them, such as "study plan"."""
    found = []
    for command in _names_in(help_of()):
        below = _names_in(help_of(command).splitlines()[0])
        found += [f"{command} {name}" for name in below] or [command]
    return found


def _names_in(usage: str) -> list[str]:
    found = re.search(r" \{([\w,-]+)\}", usage)
    return found[1].split(",") if found else []


def options_of(command: str) -> tuple[str, list[Option]]:
    """What a command does, and its options."""
    text = help_of(*command.split())
    summary = " ".join(re.split(r"\n\s*\n", text)[1].split())
    rows: list[list[str]] = []
    for line in text.splitlines()[1:]:
        content = line.replace("│", " ")
        indent = len(content) - len(content.lstrip())
        if indent == 2 and _OPTION.match(content.strip()):
            rows.append(re.split(r"\s{2,}", content.strip(), maxsplit=1))
        elif indent > 4 and rows and content.strip():
            rows[-1] = [rows[-1][0], " ".join([*rows[-1][1:], content.strip()])]
    options = []
    for name, *rest in rows:
        meaning = " ".join(rest)
        found = re.search(r"\s*\((?:default: (.*)|required)\)$", meaning)
        default = "" if found is None else "required" if found[1] is None else found[1].removeprefix("None")
        meaning = meaning if found is None else meaning[: found.start()]
        options.append(Option(name.replace("{None}|", ""), meaning, default))
    return summary, [option for option in options if not option.name.startswith("-h")]


class CommandLine(Directive):
    """``.. command_line::``: a section for each command, with a table of its options."""

    def run(self) -> list[nodes.Node]:
        """Returns the sections."""
        sections: list[nodes.Node] = []
        for command in commands():
            summary, options = options_of(command)
            section = nodes.section(ids=[f"command-{command.replace(' ', '-')}"], names=[command])
            section += nodes.title(text=command)
            section += nodes.paragraph(text=summary)
            rows = [
                (
                    nodes.literal(text=option.name),
                    nodes.Text(option.meaning),
                    nodes.literal(text=option.default) if option.default else nodes.Text(""),
                )
                for option in options
            ]
            section += make_table(("option", 30), ("meaning", 60), ("default", 10), rows=rows)
            self.state.document.note_implicit_target(section)
            sections.append(section)
        return sections


def setup(app: Any) -> dict[str, Any]:
    """Registers the directive."""
    app.add_directive("command_line", CommandLine)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
