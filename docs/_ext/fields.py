"""The directive ``.. fields:: MODULE.CLASS``: the fields of a dataclass, with defaults and descriptions."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from tables import make_table


def described_fields(kind: type) -> list[tuple[str, str, str]]:
    """Name, default and description of each field; a description is the string below the field."""
    described = {}
    body = ast.parse(inspect.cleandoc("\n" + inspect.getsource(kind))).body[0]
    assert isinstance(body, ast.ClassDef)
    for field, after in zip(body.body, body.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            text = after.value if isinstance(after, ast.Expr) else None
            if isinstance(text, ast.Constant) and isinstance(text.value, str):
                described[field.target.id] = " ".join(text.value.split())
    rows = []
    for field in dataclasses.fields(kind):
        default = "" if field.default is dataclasses.MISSING else str(field.default)
        rows.append((field.name, default, described.get(field.name, "")))
    return rows


class Fields(Directive):
    """A table with a row for each field."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Returns the table."""
        module, _, name = self.arguments[0].rpartition(".")
        rows = [
            (
                nodes.literal(text=field),
                nodes.literal(text=default) if default else nodes.Text(""),
                nodes.Text(text),
            )
            for field, default, text in described_fields(getattr(importlib.import_module(module), name))
        ]
        return [make_table(("field", 25), ("default", 15), ("meaning", 60), rows=rows)]


def setup(app: Any) -> dict[str, Any]:
    """Registers the directive."""
    app.add_directive("fields", Fields)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
