"""The analysis of a study: data checks, contrasts, effects of order, figures, and the report."""

from __future__ import annotations

import dataclasses
import io
import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from drake_shared.analysis.glossary import measure as describe
from drake_shared.analysis.statistics import Estimate
from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing
from drake_shared.experiments.drawing import BLUE, draw_interval, label_lines, new_figure
from drake_shared.experiments.report import write_report
from drake_shared.experiments.section import Picture, Section, Table
from drake_shared.experiments.text import number, templates
from drake_shared.study.design import DeclaredMeasure
from drake_shared.study.models import Contrast, contrasts_of, fit, is_share, trend
from drake_shared.study.orders import imbalance
from drake_shared.study.steps import PRACTICE
from drake_shared.study.store import StudyData
from drake_shared.study.tidy import Row, answer_rows, trial_rows, values_of

REPORT = "report"
"""Folder of the report in that of the study."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Analysis:
    """The analysis of a study.

    Attributes:
        trials, answers: Tidy rows.
        primary, secondary: Contrasts, each family decided together.
        checks: What the data checks found, as (check, finding).
    """

    trials: Sequence[Row]
    answers: Sequence[Row]
    primary: Sequence[Contrast]
    secondary: Sequence[Contrast]
    checks: Sequence[tuple[str, str]]

    def to_json(self) -> dict[str, Any]:
        """Contrasts and checks as plain values."""
        return {
            "checks": dict(self.checks),
            "primary": [dataclasses.asdict(item) for item in self.primary],
            "secondary": [dataclasses.asdict(item) for item in self.secondary],
        }


def analyze(data: StudyData) -> Analysis:
    """Analyses the trials and answers that are on disk.

    Raises:
        InputError: There are no trials that count, or data of another study.
    """
    trials, answers = trial_rows(data), answer_rows(data)
    if not any(not row["excluded"] for row in trials):
        raise InputError(data.folder, "", "must hold trials that count; see `drake-shared study status`")
    within = data.study.design == "within"
    families = [
        contrasts_of(
            [(item, values_of(item.name, trials, answers, data.study)) for item in measures],
            list(data.study.conditions),
            within=within,
        )
        for measures in (data.study.measures.primary, data.study.measures.secondary)
    ]
    return Analysis(
        trials=trials,
        answers=answers,
        primary=families[0],
        secondary=families[1],
        checks=data_checks(data, trials),
    )


def data_checks(data: StudyData, trials: Sequence[Row]) -> list[tuple[str, str]]:
    """What is missing or excluded and why, balance of orders among those who finished, and timing."""
    study = data.study
    names = list(study.conditions)
    begun = [name for name in data.steps if data.completed(name)]
    finished = [name for name in begun if data.next_step(name) is None and data.ended(name) is None]
    ended = {name: found for name in begun if (found := data.ended(name)) is not None}
    places, pairs = imbalance([study.orders()[list(data.steps).index(name)] for name in finished])
    counted = [row for row in trials if row["block"] != PRACTICE]
    planned = sum(
        step.kind == "trial" and step.block != PRACTICE for name in begun for step in data.steps[name]
    )
    reasons = Counter(row["excluded"] for row in counted if row["excluded"])
    late = [row["latency_p99"] for row in counted if row["latency_p99"] is not None]
    per_condition = Counter(row["condition"] for row in counted if not row["excluded"])
    return [
        ("participants", f"{len(finished)} finished of {len(begun)} begun and {study.participants} planned"),
        (
            "ended early",
            "; ".join(f"{who}: {why['kind']}, {why['reason']}" for who, why in ended.items()) or "none",
        ),
        ("missing trials", f"{planned - len(counted)} of {planned} of those who began"),
        (
            "excluded trials",
            "; ".join(f"{count} ({why})" for why, count in sorted(reasons.items())) or "none",
        ),
        ("trials that count", ", ".join(f"{name} {per_condition[name]}" for name in names)),
        ("balance of orders", f"places differ by {places}, pairs by {pairs}"),
        ("largest latency, p99", f"{max(late):.3f} s" if late else "not measured"),
    ]


def write_analysis(data: StudyData, found: Analysis, *, rerun: str) -> Path:
    """Writes report, tidy data (Parquet and CSV) and a notebook that reads them, to ``report/``.

    Returns:
        The page.
    """
    folder = data.folder / REPORT
    with replacing(folder / "analysis.ipynb") as temporary:
        temporary.write_text(json.dumps(_notebook(data), indent=1), encoding="utf-8")
    tables = {"trials": found.trials, "answers": found.answers}
    sections = _sections(data, found)
    simulated = any(row["simulated"] for row in found.trials)
    about = {
        "protocol (SHA-256)": data.protocol["hash"],
        "planned": data.protocol["created"],
        "amendments": "; ".join(
            f"{item['date']}: {item['reason']} ({', '.join(item['changes'])})"
            for item in data.protocol["amendments"]
        )
        or "none",
        "participants": "simulated" if simulated else "people",
    }
    write_report(
        folder,
        sections,
        title=data.study.title or data.study.name,
        about=about,
        rerun=rerun,
        template=_templates().get_template("study.html"),
    )
    for name, rows in tables.items():
        if rows:
            with replacing(folder / "data" / f"{name}.csv") as temporary:
                buffer = io.StringIO()
                pd.DataFrame(rows).to_csv(buffer, index=False)
                temporary.write_text(buffer.getvalue(), encoding="utf-8")
    return folder / "report.html"


def _templates() -> Any:
    """The templates of the experiments' reports and those of studies."""
    import jinja2

    loaders = [jinja2.PackageLoader("drake_shared.study"), templates().loader]
    return templates().overlay(loader=jinja2.ChoiceLoader(loaders))  # type: ignore[arg-type]


def _notebook(data: StudyData) -> dict[str, Any]:
    """A Jupyter notebook that repeats the analysis from the tidy data; run it in the folder of the report."""
    cells = _templates().get_template("analysis.txt").render(name=data.study.name)
    return {
        "nbformat": 4,
        "nbformat_minor": 5,
        "metadata": {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}},
        "cells": [
            {
                "cell_type": "code",
                "id": f"cell{index}",
                "metadata": {},
                "execution_count": None,
                "outputs": [],
                "source": source.strip(),
            }
            for index, source in enumerate(cells.split("# %%")[1:])
        ],
    }


def _sections(data: StudyData, found: Analysis) -> list[Section]:
    checks = Table(caption="Data checks, before anything else.", head=["check", "finding"], rows=found.checks)
    return [
        Section(
            title="Data",
            text=[],
            tables=[checks, _means_table(data, found)],
            data={"trials": _columns(found.trials), "answers": _columns(found.answers)},
        ),
        _contrast_section(data, "Primary measures", found.primary, "They decide."),
        *(
            [
                _contrast_section(
                    data, "Secondary measures", found.secondary, "Exploratory: a family of their own."
                )
            ]
            if found.secondary
            else []
        ),
        _order_section(data, found),
    ]


def _means_table(data: StudyData, found: Analysis) -> Table:
    """Means of the measures in each condition, and how the participants' means vary."""
    rows = []
    for item in (*data.study.measures.primary, *data.study.measures.secondary):
        values = values_of(item.name, found.trials, found.answers, data.study)
        row = [_label(item, data)]
        for name in data.study.conditions:
            own = pd.DataFrame([value for value in values if value["condition"] == name])
            means = own.groupby("participant")["value"].mean() if len(own) else pd.Series(dtype=float)
            row.append(f"{number(means.mean())} ({number(means.std())})")
        rows.append(row)
    caption = "Mean of the participants' means in each condition, and their standard deviation."
    return Table(caption=caption, head=["measure", *data.study.conditions], rows=rows)


def _columns(rows: Sequence[Row]) -> list[Row]:
    """The rows with all columns in each, as Parquet needs them."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    return [{name: row.get(name) for name in names} for row in rows]


def _contrast_section(data: StudyData, title: str, contrasts: Sequence[Contrast], role: str) -> Section:
    rows = [
        [
            _label(item.measure, data),
            f"{item.one} − {item.other}",
            item.verdict,
            f"{number(item.mean)} [{number(item.low)}, {number(item.high)}]",
            f"{item.level:.1%}",
            number(item.p),
            f"{number(item.effect)} [{number(item.effect_low)}, {number(item.effect_high)}]",
            f"{item.participants} ({item.observations})",
            f"{item.measure.hypothesis}, {number(item.measure.smallest_effect)}",
        ]
        for item in contrasts
    ]
    head = ["measure", "contrast", "verdict", "difference", "level", "p (Holm)", "d and 95% interval"]
    head += ["n (values)", "test"]
    figure, axes = new_figure(0.5 + 0.45 * len(contrasts))
    for height, item in enumerate(contrasts):
        scaled = [value / item.measure.smallest_effect for value in (item.mean, item.low, item.high)]
        estimate = Estimate(mean=scaled[0], low=scaled[1], high=scaled[2], count=item.participants)
        draw_interval(axes, height, estimate, BLUE, marker="o")
    axes.axvline(0.0, color="0.6", linewidth=0.8)
    for bound in (-1.0, 1.0):
        axes.axvline(bound, color="0.6", linewidth=0.8, linestyle="--")
    label_lines(axes, [f"{item.measure.name}: {item.one} − {item.other}" for item in contrasts])
    axes.set(xlabel="difference, in smallest effects of interest", ylim=(len(contrasts) - 0.5, -0.5))
    models = sorted({item.model for item in contrasts})
    return Section(
        title=title,
        text=[
            f"{role} Models: {'; '.join(models)}. The last columns: number of participants and of values; "
            "what was tested, and the smallest effect of interest."
        ],
        pictures=[Picture.of(figure, "Differences with the intervals at which they were decided.")],
        tables=[Table(caption=f"{title}: contrasts between conditions.", head=head, rows=rows)],
    )


def _order_section(data: StudyData, found: Analysis) -> Section:
    """Changes of the measures from place to place in the order."""
    within = data.study.design == "within"
    rows = []
    for item in (*data.study.measures.primary, *data.study.measures.secondary):
        values = values_of(item.name, found.trials, found.answers, data.study)
        if within and len({row["participant"] for row in values}) > 2:
            change = trend(fit(values, within=within, share=is_share(item.name)))
            if change is not None:
                mean, low, high = (0.0 if abs(value) < 1e-12 else value for value in change)
                rows.append([_label(item, data), f"{number(mean)} [{number(low)}, {number(high)}]"])
    text = "Learning and fatigue: the linear change of each measure from one place in the order to the next."
    table = Table(
        caption="Effects of order, with 95% intervals.", head=["measure", "change a place"], rows=rows
    )
    return Section(title="Effects of order", text=[text], tables=[table] if rows else [])


def _label(item: DeclaredMeasure, data: StudyData) -> str:
    described = describe(item.name)
    unit = described.unit_for(data.study.load_scenario().robot.command_units[0]) if described else ""
    return f"{item.name}, {unit}" if unit else item.name
