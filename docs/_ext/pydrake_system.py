"""The directive ``.. pydrake_system::`` of Drake's docstrings, drawn as a box with its ports.

The content is YAML with ``name``, ``input_ports`` and ``output_ports``, as in the docstrings of Drake itself.
"""

from __future__ import annotations

import html
from typing import Any

import yaml
from docutils import nodes
from docutils.parsers.rst import Directive

ROW, MARGIN, ARROW, LETTER = 24, 8, 28, 7.4


def port_diagram(name: str, inputs: list[str], outputs: list[str]) -> str:
    """A system as SVG: a box with inputs to its left and outputs to its right.

    Args:
        name: Of the system, in the middle of the box.
        inputs, outputs: Names of the ports, from top to bottom.
    """
    left = max((len(port) for port in inputs), default=0) * LETTER
    right = max((len(port) for port in outputs), default=0) * LETTER
    inner = max(len(name) * (LETTER + 1) + 2 * MARGIN, 120)
    rows = max(len(inputs), len(outputs), 1)
    x0, x1 = MARGIN + left + ARROW, MARGIN + left + ARROW + inner
    width, height = x1 + ARROW + right + MARGIN, rows * ROW + 2 * MARGIN
    parts = [
        f'<rect x="{x0}" y="{MARGIN}" width="{inner}" height="{rows * ROW}" rx="4" class="box"/>',
        f'<text x="{(x0 + x1) / 2}" y="{height / 2 + 4}" text-anchor="middle" class="name">'
        f"{html.escape(name)}</text>",
    ]
    for ports, edge, step in ((inputs, x0, -ARROW), (outputs, x1, ARROW)):
        for index, port in enumerate(ports):
            # The fewer ports of one side stand evenly along the box.
            y = MARGIN + rows * ROW * (index + 0.5) / len(ports)
            ends = sorted((edge, edge + step))
            parts.append(f'<line x1="{ends[0]}" y1="{y}" x2="{ends[1] - 5}" y2="{y}" class="wire"/>')
            parts.append(f'<path d="M{ends[1] - 7} {y - 4} l7 4 l-7 4 z" class="tip"/>')
            anchor = "end" if step < 0 else "start"
            x = edge + step + (-4 if step < 0 else 4)
            parts.append(f'<text x="{x}" y="{y + 4}" text-anchor="{anchor}">{html.escape(port)}</text>')
    label = f"{name}: inputs {', '.join(inputs) or 'none'}; outputs {', '.join(outputs) or 'none'}"
    return (
        f'<svg class="pydrake-system" role="img" aria-label="{html.escape(label)}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}">'
        f"{''.join(parts)}</svg>"
    )


class PydrakeSystem(Directive):
    """``.. pydrake_system::`` with YAML as its content."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Returns the drawing.

        Raises:
            DirectiveError: The content is not YAML with a name and lists of ports.
        """
        try:
            system = yaml.safe_load("\n".join(self.content))
            drawing = port_diagram(
                str(system["name"]), _names(system.get("input_ports")), _names(system.get("output_ports"))
            )
        except (yaml.YAMLError, KeyError, TypeError, AttributeError) as error:
            raise self.error(f"pydrake_system: {error}") from error
        return [nodes.raw("", drawing, format="html")]


def _names(ports: Any) -> list[str]:
    if ports is None:
        return []
    if not isinstance(ports, list):
        raise TypeError("ports must be a list of names")
    return [str(port) for port in ports]


def setup(app: Any) -> dict[str, Any]:
    """Registers the directive."""
    app.add_directive("pydrake_system", PydrakeSystem)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
