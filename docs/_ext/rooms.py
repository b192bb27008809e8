"""The directive ``{rooms}``: the rooms of the package, floor by floor, as in ``tests/test_rooms.py``."""

from __future__ import annotations

import ast
import html
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive

ROOT = Path(__file__).resolve().parents[2]


def floors() -> list[list[str]]:
    """Names of the rooms of each floor, the topmost first."""
    tree = ast.parse((ROOT / "tests" / "test_rooms.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == ["FLOORS"]:
            return [list(floor) for floor in ast.literal_eval(node.value)]
    raise ValueError("tests/test_rooms.py defines no FLOORS")


def purpose(room: str) -> str:
    """First sentence of the docstring of a room."""
    file = ROOT / "drake_shared" / room / "__init__.py"
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].replace("`", "").split())


class Rooms(Directive):
    """``{rooms}``: one box for each floor, joined by arrows that point down."""

    def run(self) -> list[nodes.Node]:
        """Returns the drawing."""
        boxes = []
        for floor in floors():
            rooms = "".join(f"<dt>{room}</dt><dd>{html.escape(purpose(room))}</dd>" for room in floor)
            boxes.append(f'<dl class="floor">{rooms}</dl>')
        arrow = '<div class="arrow" aria-label="imports">&#8595;</div>'
        return [nodes.raw("", f'<div class="rooms">{arrow.join(boxes)}</div>', format="html")]


def setup(app: Any) -> dict[str, Any]:
    """Registers the directive."""
    app.add_directive("rooms", Rooms)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
