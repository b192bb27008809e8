"""A report as one page that needs nothing else, and its numbers as JSON and Parquet."""

from __future__ import annotations

import dataclasses
import html
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from drake_shared.analysis.statistics import Claim, Estimate
from drake_shared.common.files import replacing
from drake_shared.experiments.section import Section, Table

_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1c1c1c; max-width: 62rem; margin: 2rem auto;
  padding: 0 1rem; }
h1 { line-height: 1.2; } h2 { margin-top: 3rem; border-top: 1px solid #ccc; padding-top: 1.2rem; }
nav ol { columns: 2; } figure { margin: 1.5rem 0; } figure svg { width: 100%; height: auto; }
figcaption, caption { color: #555; font-size: .9rem; text-align: left; caption-side: top; }
table { border-collapse: collapse; font-size: .88rem; margin: 1.2rem 0; font-variant-numeric: tabular-nums; }
.wide { overflow-x: auto; } .numbers { font-size: .8rem; } .numbers td { white-space: nowrap; }
.numbers .prose { white-space: normal; min-width: 14em; }
th, td { text-align: left; padding: .25rem .8rem .25rem 0; vertical-align: top; }
thead th { border-bottom: 1.5px solid #444; } tbody tr { border-bottom: 1px solid #e4e4e4; }
.verdict { font-weight: 600; white-space: nowrap; } .holds { color: #00694d; } .reversed { color: #a84500; }
.equivalent { color: #00558a; } .open { color: #555; }
iframe { width: 100%; height: 26rem; border: 1px solid #ccc; } pre { background: #f4f4f4; padding: .8rem;
  overflow-x: auto; } .note { background: #f4f4f4; padding: .6rem 1rem; }
"""
_LONGEST_NUMBER = 32
_VERDICTS = (
    "A claim <b>holds</b> where its whole interval, adjusted for the number of questions asked together, "
    "lies beyond the smallest effect of interest; it is <b>reversed</b> where it lies beyond on the other "
    "side; both sides are <b>equivalent</b> where it lies between; else the question is <b>open</b>."
)


def write_report(
    folder: Path, sections: Sequence[Section], *, title: str, about: Mapping[str, Any], rerun: str
) -> None:
    """Writes ``report.html``, ``report.json`` and ``data/NAME.parquet`` to ``folder``, each whole or not.

    Args:
        folder: Is there and can be written to.
        sections: In the order of reading.
        title: Of the page.
        about: Versions, size, seeds: what else there is to say of the run.
        rerun: The command that makes the same again.

    Raises:
        InputError: The folder cannot be written to.
    """
    numbers = {
        "title": title,
        "about": dict(about),
        "rerun": rerun,
        "sections": [_plain(s) for s in sections],
    }
    for section in sections:
        for name, rows in section.data.items():
            if rows:
                with replacing(folder / "data" / f"{name}.parquet") as temporary:
                    pq.write_table(pa.Table.from_pylist([dict(row) for row in rows]), temporary)
    with replacing(folder / "report.json") as temporary:
        temporary.write_text(json.dumps(numbers, indent=1), encoding="utf-8")
    with replacing(folder / "report.html") as temporary:
        page = render(sections, title=title, about=about, rerun=rerun)
        temporary.write_text(page, encoding="utf-8")


def remove_report(folder: Path) -> None:
    """Removes the report of a run that is begun anew, and the data that it names, and nothing else.

    They would be taken for the new one's.
    """
    for name in _data_of(folder / "report.json"):
        (folder / "data" / f"{name}.parquet").unlink(missing_ok=True)
    for name in ("report.html", "report.json"):
        (folder / name).unlink(missing_ok=True)


def _data_of(report: Path) -> list[str]:
    """The names of data in a ``report.json``; none where it cannot be read."""
    try:
        sections = json.loads(report.read_text(encoding="utf-8"))["sections"]
        names = [name for section in sections for name in section["data"]]
    except (OSError, ValueError, LookupError, TypeError):
        return []
    return [name for name in names if isinstance(name, str) and name.isidentifier()]


def render(sections: Sequence[Section], *, title: str, about: Mapping[str, Any], rerun: str) -> str:
    """The page; the arguments are those of `write_report`."""
    contents = "".join(
        f'<li><a href="#s{number}">{html.escape(section.title)}</a></li>'
        for number, section in enumerate(sections, 1)
    )
    claims = [claim for section in sections for claim in section.claims]
    body = "".join(_section(number, section) for number, section in enumerate(sections, 1))
    told = "".join(
        f"<tr><th>{html.escape(name)}</th><td>{html.escape(str(value))}</td></tr>"
        for name, value in about.items()
    )
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{html.escape(title)}</title><style>{_STYLE}</style></head><body>
<h1>{html.escape(title)}</h1>
<p class="note">Every operator in this report is simulated. Nothing in it is a result about people.</p>
<nav><ol>{contents}</ol></nav>
<h2>Claims and verdicts</h2><p>{_VERDICTS}</p>{_claims(claims)}
{body}
<h2>How to rerun</h2><pre>{html.escape(rerun)}</pre>
<div class="wide"><table>{told}</table></div>
<p>The numbers are in <code>report.json</code> and, row by row, in <code>data/</code> beside this page.</p>
</body></html>
"""


def _section(number: int, section: Section) -> str:
    text = "".join(f"<p>{html.escape(paragraph)}</p>" for paragraph in section.text)
    pictures = "".join(
        f"<figure>{_own_names(picture.svg, f's{number}p{index}')}"
        f"<figcaption>{html.escape(picture.caption)}</figcaption></figure>"
        for index, picture in enumerate(section.pictures)
    )
    tables = "".join(_table(table) for table in section.tables)
    replays = "".join(
        f"<details><summary>{html.escape(caption)}</summary>"
        f'<iframe loading="lazy" sandbox="allow-scripts" srcdoc="{html.escape(page)}"></iframe></details>'
        for caption, page in section.replays.items()
    )
    return (
        f'<section id="s{number}"><h2>{html.escape(section.title)}</h2>{text}{pictures}{tables}'
        f"{_claims(section.claims)}{replays}</section>"
    )


def _own_names(svg: str, prefix: str) -> str:
    """The drawing with ids of its own: two on one page must not use each other's parts."""
    for mark in ('id="', 'xlink:href="#', "url(#"):
        svg = svg.replace(mark, f"{mark}{prefix}-")
    return svg


def _table(table: Table) -> str:
    head = "".join(f"<th>{html.escape(name)}</th>" for name in table.head)
    rows = "".join("<tr>" + "".join(_cell(cell) for cell in row) + "</tr>" for row in table.rows)
    return (
        f'<div class="wide"><table class="numbers"><caption>{html.escape(table.caption)}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _cell(text: str) -> str:
    # A number with its interval stays in one line; what is longer is to be read, and wraps.
    prose = ' class="prose"' if len(text) > _LONGEST_NUMBER else ""
    return f"<td{prose}>{html.escape(text)}</td>"


def _claims(claims: Sequence[Claim]) -> str:
    if not claims:
        return ""
    rows = []
    for claim in claims:
        estimate, unit = claim.estimate, html.escape(claim.unit)
        more = [] if claim.effect is None else [f"d<sub>z</sub> = {number(claim.effect)}"]
        more += [] if claim.p is None else [f"p = {number(claim.p)}"]
        rows.append(
            f"<tr><td>{html.escape(claim.text)}</td>"
            f"<td>{with_interval(estimate)} {unit}"
            f"{'<br>' if more else ''}{', '.join(more)}</td>"
            f"<td>{number(claim.smallest)} {unit}</td><td>{estimate.count}</td>"
            f'<td class="verdict {claim.verdict}">{claim.verdict}</td></tr>'
        )
    return (
        '<div class="wide"><table><thead><tr><th>claim</th><th>estimate and interval</th>'
        "<th>smallest effect</th><th>n</th><th>verdict</th></tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def with_interval(estimate: Estimate) -> str:
    """A mean and its interval, as `number` writes each."""
    return f"{number(estimate.mean)} [{number(estimate.low)}, {number(estimate.high)}]"


def number(value: float | None) -> str:
    """A number as it is read: three digits, more of whole thousands, and a dash where there is none."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return f"{value:{'.0f' if 1e3 <= abs(value) < 1e6 else '.3g'}}".replace("-", "−")


def _plain(section: Section) -> dict[str, Any]:
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
    """What is no finite number is null in JSON."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
