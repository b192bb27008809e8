"""Tables as docutils nodes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from docutils import nodes


def make_table(*columns: tuple[str, int], rows: Iterable[Sequence[nodes.Node]]) -> nodes.table:
    """A table.

    Args:
        columns: Title and relative width of each.
        rows: Inline nodes, one for each column.
    """
    table, group = nodes.table(), nodes.tgroup(cols=len(columns))
    table += group
    head, body = nodes.thead(), nodes.tbody()
    for _, width in columns:
        group += nodes.colspec(colwidth=width)
    head += _row([nodes.Text(title) for title, _ in columns])
    for cells in rows:
        body += _row(cells)
    group += [head, body]
    return table


def _row(cells: Sequence[nodes.Node]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        entry, paragraph = nodes.entry(), nodes.paragraph()
        paragraph += cell
        entry += paragraph
        row += entry
    return row
