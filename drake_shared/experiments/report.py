"""Writes the report as one stand-alone page, and its numbers as JSON and Parquet."""

from __future__ import annotations

import dataclasses
import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from drake_shared.common.files import replacing
from drake_shared.experiments.section import Section
from drake_shared.experiments.text import templates

if TYPE_CHECKING:
    from jinja2 import Template

_LONGEST_NUMBER = 32
"""Table cells with more characters are prose, and wrapped; a number with its interval stays in one line."""


def write_report(
    folder: Path,
    sections: Sequence[Section],
    *,
    title: str,
    about: Mapping[str, Any],
    rerun: str,
    template: Template | None = None,
) -> None:
    """Writes ``report.html``, ``report.json`` and ``data/NAME.parquet`` to ``folder``, each atomically.

    Args:
        folder: Exists and can be written to.
        sections: In the order of the page.
        title: Of the page.
        about: Versions, size and seeds of the run.
        rerun: The command that runs it again.
        template: Of the page, if it is not that of the experiments.

    Raises:
        InputError: The folder cannot be written to.
    """
    numbers = {
        "title": title,
        "about": dict(about),
        "rerun": rerun,
        "sections": [_as_json(section) for section in sections],
    }
    for section in sections:
        for name, rows in section.data.items():
            if rows:
                with replacing(folder / "data" / f"{name}.parquet") as temporary:
                    pq.write_table(pa.Table.from_pylist([dict(row) for row in rows]), temporary)
    with replacing(folder / "report.json") as temporary:
        temporary.write_text(json.dumps(numbers, indent=1), encoding="utf-8")
    with replacing(folder / "report.html") as temporary:
        page = render(sections, title=title, about=about, rerun=rerun, template=template)
        temporary.write_text(page, encoding="utf-8")


def remove_report(folder: Path) -> None:
    """Removes the report of an overwritten run and the data that it lists, and no other file.

    They would be taken for those of the new run.
    """
    for name in _data_of(folder / "report.json"):
        (folder / "data" / f"{name}.parquet").unlink(missing_ok=True)
    for name in ("report.html", "report.json"):
        (folder / name).unlink(missing_ok=True)


def _data_of(report: Path) -> list[str]:
    """The names of the data that a ``report.json`` lists; empty if it cannot be read."""
    try:
        sections = json.loads(report.read_text(encoding="utf-8"))["sections"]
        names = [name for section in sections for name in section["data"]]
    except (OSError, ValueError, LookupError, TypeError):
        return []
    return [name for name in names if isinstance(name, str) and name.isidentifier()]


def render(
    sections: Sequence[Section],
    *,
    title: str,
    about: Mapping[str, Any],
    rerun: str,
    template: Template | None = None,
) -> str:
    """The page; see `write_report`."""
    return (template or templates().get_template("report.html")).render(
        sections=sections,
        claims=[claim for section in sections for claim in section.claims],
        families=Counter(claim.family for section in sections for claim in section.claims),
        title=title,
        about=about,
        rerun=rerun,
        longest_number=_LONGEST_NUMBER,
    )


def _as_json(section: Section) -> dict[str, Any]:
    return {
        "title": section.title,
        "text": list(section.text),
        "claims": [_finite(dataclasses.asdict(claim)) for claim in section.claims],
        "tables": [
            {"caption": table.caption, "head": list(table.head), "rows": [list(row) for row in table.rows]}
            for table in section.tables
        ],
        "data": sorted(section.data),
    }


def _finite(value: Any) -> Any:
    """NaN and infinities are null in JSON."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
