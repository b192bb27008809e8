"""Figures and tables of second learners: the bars of the paper, and paired differences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from drake_shared.experiments.drawing import BLACK, COLOURS, legend_below, new_figure
from drake_shared.experiments.fig6_comparison import (
    CRITERIA,
    OF_PAPER,
    PRIMARY_ARM,
    PRIMARY_OPERATOR,
    SETUPS,
    Comparison,
    Means,
)
from drake_shared.experiments.measures import finite_mean, select
from drake_shared.experiments.section import Picture, Rows, Table
from drake_shared.experiments.text import number
from drake_shared.experiments.training import PRESETS

_SETUPS = {
    "shared": "Setup 1: shared runs",
    "human": "Setup 2: human runs",
    "more": "control: more of the first kind",
}
_GOLDEN = 0.618034


def title_of(measure: str) -> str:
    """The name of a measure in the report."""
    return measure.replace("_", " ")


def with_unit(measure: str, value: float) -> str:
    """A number with the unit of a measure."""
    return f"{number(value)} {CRITERIA[measure].unit}".strip()


def bars(rows: Rows) -> Picture:
    """The figure of the paper: one pair of learners, ten trials each."""
    figure, axes = new_figure(3.0, columns=2)
    own = select(rows, operator=PRIMARY_OPERATOR, arm=PRIMARY_ARM)
    for place, name in zip(axes, OF_PAPER, strict=True):
        for offset, preset in enumerate(PRESETS):
            first = min((row["repeat"] for row in select(own, preset=preset)), default=None)
            for position, setup in enumerate(SETUPS[:2]):
                trials = select(own, preset=preset, repeat=first, setup=setup)
                if not trials:
                    continue
                values = [row[name] for row in trials]
                place.bar(
                    position + 0.36 * (offset - 0.5),
                    np.mean(values),
                    0.34,
                    yerr=np.std(values, ddof=1) if len(values) > 1 else 0.0,
                    capsize=3,
                    color=COLOURS[preset],
                    label=f"preset {preset}" if position == 0 else None,
                )
        place.set_xticks([0, 1], [_SETUPS[setup] for setup in SETUPS[:2]])
        place.set_ylabel(_label(name))
    legend_below(figure, *axes[0].get_legend_handles_labels(), columns=2)
    return Picture.of(
        figure,
        "As in the paper: the first repeat only, one pair of learners for each preset, 10 trials each, the "
        "primary simulated operator. Bars are means, whiskers standard deviations over trials. One pair does "
        "not represent others, so no conclusion is drawn from it.",
    )


def spread(comparisons: Sequence[Comparison]) -> Picture:
    """The difference of every repeat, for both measures of the paper and both presets."""
    figure, axes = new_figure(2.6, columns=2, sharey=True)
    for place, name in zip(axes, OF_PAPER, strict=True):
        _draw_zone(place, name)
        for line, preset in enumerate(reversed(PRESETS)):
            for one in comparisons:
                if (one.measure, one.cell.preset) != (name, preset):
                    continue
                # Scattered over a strip, always in the same way.
                height = line + 0.42 * (np.modf(_GOLDEN * np.arange(len(one.differences)))[0] - 0.5)
                place.scatter(one.differences, height, s=11, color=COLOURS[preset], alpha=0.6, linewidth=0)
                interval = [one.estimate.low, one.estimate.high]
                place.plot(interval, [line - 0.36] * 2, color=BLACK, linewidth=1.5)
                place.plot(one.estimate.mean, line - 0.36, marker="o", markersize=4, color=BLACK)
        place.set_ylim(-0.6, len(PRESETS) - 0.5)
        place.set_yticks(range(len(PRESETS)), [f"preset {preset}" for preset in reversed(PRESETS)])
        place.set_xlabel(f"{_label(name)}:\nSetup 2 minus Setup 1", fontsize=9)
    return Picture.of(
        figure,
        "The primary operator in the primary arm: one point for each repeat. Positive differences support "
        "the paper. Black: the mean and its adjusted 95% interval. Shaded: less than the smallest effect of "
        "interest.",
    )


def forest(comparisons: Sequence[Comparison]) -> Picture:
    """Mean paired differences of a measure for each operator and arm."""
    name = comparisons[0].measure
    # Lines that differ only in the preset share a label.
    lines = sorted({(one.cell.operator, one.cell.arm): None for one in comparisons}, key=_primary_first)
    figure, place = new_figure(1.2 + 0.27 * len(lines))
    _draw_zone(place, name)
    for offset, preset in enumerate(PRESETS):
        own = [one for one in comparisons if one.cell.preset == preset]
        height = [
            len(lines) - 1 - lines.index((one.cell.operator, one.cell.arm)) + 0.26 * (0.5 - offset)
            for one in own
        ]
        place.hlines(
            height,
            [one.estimate.low for one in own],
            [one.estimate.high for one in own],
            color=COLOURS[preset],
            linewidth=1.5,
        )
        means = [one.estimate.mean for one in own]
        place.plot(means, height, "o", markersize=4, color=COLOURS[preset], label=f"preset {preset}")
    labels = [operator if arm == PRIMARY_ARM else f"{operator}: {arm}" for operator, arm in reversed(lines)]
    place.set_yticks(range(len(lines)), labels, fontsize=8)
    place.set_xlabel(f"{_label(name)}: Setup 2 minus Setup 1")
    legend_below(figure, *place.get_legend_handles_labels(), columns=2)
    return Picture.of(
        figure,
        f"Mean paired differences in {title_of(name)} with adjusted 95% intervals over repeats, by operator "
        f"in the primary arm ({PRIMARY_ARM}), and for the primary operator in the other arms. Positive "
        "differences support the paper. Shaded: less than the smallest effect of interest.",
    )


def means_table(means: Means) -> Table:
    """The means over repeats by cell and setup."""
    rows = []
    for cell, repeats in means.items():
        for setup in SETUPS:
            values = [setups[setup] for setups in repeats.values() if setup in setups]
            if values:
                averages = [number(finite_mean([value[name] for value in values])) for name in CRITERIA]
                label = _SETUPS[setup].split(":")[0]
                rows.append([cell.preset, cell.operator, cell.arm, label, str(len(values)), *averages])
    return Table(
        caption=f"Means over repeats. {'; '.join(_SETUPS.values())}.",
        head=["preset", "operator", "arm", "setup", "repeats", *map(_label, CRITERIA)],
        rows=rows,
    )


def difference_table(comparisons: Sequence[Comparison], caption: str) -> Table:
    """By how much Setup 1 is better, with intervals, effect sizes and verdicts."""
    return Table(
        caption=f"{caption} Positive values are better with Setup 1: lower disagreement, human weight and "
        "effort, higher intent success and clearance. d_z: mean divided by standard deviation of the "
        "differences.",
        head=[
            *("preset", "operator", "arm", "Setup 1 against", "measure", "repeats", "better by"),
            *("95% interval", "adjusted", "d_z", "adjusted p", "smallest of interest", "verdict"),
        ],
        rows=[
            [
                one.cell.preset,
                one.cell.operator,
                one.cell.arm,
                "Setup 2" if one.against == "human" else "the control",
                title_of(one.measure),
                str(one.estimate.count),
                with_unit(one.measure, one.estimate.mean),
                f"[{number(one.plain.low)}, {number(one.plain.high)}]",
                f"[{number(one.estimate.low)}, {number(one.estimate.high)}]",
                number(one.claim.effect),
                number(one.claim.p),
                with_unit(one.measure, CRITERIA[one.measure].smallest),
                one.verdict,
            ]
            for one in comparisons
        ],
    )


def _label(name: str) -> str:
    unit = CRITERIA[name].unit
    return f"{title_of(name)}, {unit}" if unit else title_of(name)


def _draw_zone(place: Any, name: str) -> None:
    smallest = CRITERIA[name].smallest
    place.axvspan(-smallest, smallest, color="0.92", zorder=0)
    place.axvline(0.0, color="0.5", linewidth=0.8, zorder=1)


def _primary_first(line: tuple[str, str]) -> tuple[bool, bool]:
    operator, arm = line
    return arm != PRIMARY_ARM, operator != PRIMARY_OPERATOR
