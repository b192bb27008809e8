"""The directive ``.. public_names:: ROOM``: the names of a room that are public in ``drake_shared``."""

from __future__ import annotations

import importlib
import inspect
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList


def names_of_room(room: str) -> list[str]:
    """Public names whose objects are defined in a room, classes first."""
    package = importlib.import_module("drake_shared")
    found = []
    for name in package.__all__:
        value = getattr(package, name)
        module = inspect.getmodule(value) if not hasattr(value, "__module__") else None
        home = module.__name__ if module else value.__module__
        if home.split(".")[:2] == ["drake_shared", room]:
            found.append((not inspect.isclass(value), name))
    return [name for _, name in sorted(found)]


class PublicNames(Directive):
    """A table of the names of a room, and then the documentation of each."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Returns the table and the documentation."""
        package = importlib.import_module("drake_shared")
        names = names_of_room(self.arguments[0])
        if not names:
            raise self.error(f"no public name is defined in drake_shared.{self.arguments[0]}")
        lines = [".. currentmodule:: drake_shared", "", ".. autosummary::", ""]
        lines += [f"   {name}" for name in names]
        for name in names:
            if inspect.isclass(getattr(package, name)):
                lines += ["", f".. autoclass:: {name}", "   :members:"]
            else:
                lines += ["", f".. autofunction:: {name}"]
        parent = nodes.Element()
        self.state.nested_parse(StringList(lines, source="public_names"), 0, parent)
        return parent.children


def setup(app: Any) -> dict[str, Any]:
    """Registers the directive."""
    app.add_directive("public_names", PublicNames)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
