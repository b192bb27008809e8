"""The text of the report: paragraphs from templates, and numbers."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Any

from drake_shared.analysis.statistics import Estimate

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup


def paragraphs(name: str, **values: Any) -> list[str]:
    """The paragraphs of ``templates/NAME.txt``, which are separated by empty lines.

    Args:
        name: Of the template.
        values: The variables of the template.
    """
    text = templates().get_template(f"{name}.txt").render(values)
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]


@functools.cache
def templates() -> Environment:
    """The Jinja2 environment of the report's templates; only HTML is escaped."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("drake_shared.experiments"),
        autoescape=jinja2.select_autoescape(["html"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": number,
        "with_interval": with_interval,
        "with_own_ids": _with_own_ids,
    }
    return environment


def _with_own_ids(svg: str, prefix: str) -> Markup:
    """A drawing with unique ids: otherwise drawings on the same page share their parts."""
    import markupsafe

    for mark in ('id="', 'xlink:href="#', "url(#"):
        svg = svg.replace(mark, f"{mark}{prefix}-")
    return markupsafe.Markup(svg)


def with_interval(estimate: Estimate) -> str:
    """A mean and its interval as text, or a dash for an empty sample."""
    if not estimate.count:
        return number(None)
    return f"{number(estimate.mean)} [{number(estimate.low)}, {number(estimate.high)}]"


def number(value: float | None) -> str:
    """A number with three significant digits, or all digits of its whole part; a dash for None and NaN."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return f"{value:{'.0f' if 1e3 <= abs(value) < 1e6 else '.3g'}}".replace("-", "−")
