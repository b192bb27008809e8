"""How second learners are shown: the paper's bars, paired differences, tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.experiments.drawing import BLACK, COLOURS, legend_below, new_figure
from drake_shared.experiments.fig6_comparison import (
    MEASURES,
    PRESETS,
    PRIMARY_ARM,
    PRIMARY_OPERATOR,
    SETUPS,
    Compared,
    Means,
)
from drake_shared.experiments.report import number
from drake_shared.experiments.section import Picture, Table

_SETUPS = {
    "shared": "Setup 1: shared runs",
    "human": "Setup 2: human runs",
    "more": "control: more of the first kind",
}
_GOLDEN = 0.618034


def named(measure: str) -> str:
    """A measure's name as it is read."""
    return measure.replace("_", " ")


def amount(measure: str, value: float) -> str:
    """A number with the measure's unit."""
    return f"{number(value)} {MEASURES[measure].unit}".strip()


def bars(rows: Sequence[Mapping[str, Any]]) -> Picture:
    """As the paper did it: one pair of learners, ten trials each."""
    figure, axes = new_figure(3.0, columns=2)
    own = [row for row in rows if (row["operator"], row["arm"]) == (PRIMARY_OPERATOR, PRIMARY_ARM)]
    for place, name in zip(axes, (name for name in MEASURES if MEASURES[name].paper), strict=True):
        for offset, preset in enumerate(PRESETS):
            mine = [row for row in own if row["preset"] == preset]
            shown = min((row["repeat"] for row in mine), default=None)
            for position, setup in enumerate(SETUPS[:2]):
                values = [row[name] for row in mine if (row["repeat"], row["setup"]) == (shown, setup)]
                if values:
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
        place.set_ylabel(_axis(name))
    handles, labels = axes[0].get_legend_handles_labels()
    legend_below(figure, handles, labels, columns=2)
    return Picture.of(
        figure,
        "As the paper did it: the first repeat alone, one pair of learners for each preset, 10 trials each, "
        "the primary simulated operator. Bars are means, whiskers standard deviations over trials. One pair "
        "says nothing about another, so nothing is concluded from it.",
    )


def spread(answers: Sequence[Compared]) -> Picture:
    """Of each preset the difference of every repeat, for both measures of the paper."""
    figure, axes = new_figure(2.6, columns=2, sharey=True)
    for place, name in zip(axes, (name for name in MEASURES if MEASURES[name].paper), strict=True):
        _zone(place, name)
        for line, preset in enumerate(reversed(PRESETS)):
            for one in answers:
                if (one.measure, one.cell.preset) != (name, preset):
                    continue
                # Strewn over a strip, always the same way.
                strewn = np.modf(_GOLDEN * np.arange(len(one.differences)))[0] - 0.5
                place.scatter(
                    one.differences,
                    line + 0.42 * strewn,
                    s=11,
                    color=COLOURS[preset],
                    alpha=0.6,
                    linewidth=0,
                )
                place.plot(
                    [one.estimate.low, one.estimate.high], [line - 0.36] * 2, color=BLACK, linewidth=1.5
                )
                place.plot(one.estimate.mean, line - 0.36, marker="o", markersize=4, color=BLACK)
        place.set_ylim(-0.6, len(PRESETS) - 0.5)
        place.set_yticks(range(len(PRESETS)), [f"preset {preset}" for preset in reversed(PRESETS)])
        place.set_xlabel(f"{_axis(name)}:\nSetup 2 minus Setup 1", fontsize=9)
    return Picture.of(
        figure,
        "The primary operator in the primary arm: a point for each repeat. Right of 0 speaks for the paper. "
        "Black: the mean and its adjusted 95% interval. Shaded: less than the smallest effect of interest.",
    )


def forest(answers: Sequence[Compared]) -> Picture:
    """Mean paired differences of a measure, for each operator and arm, with the zone of no interest."""
    name = answers[0].measure
    # Beside each other what differs in the preset alone.
    lines = sorted(dict.fromkeys((one.cell.operator, one.cell.arm) for one in answers), key=_first_primary)
    at = {line: len(lines) - 1 - index for index, line in enumerate(lines)}
    figure, place = new_figure(1.2 + 0.27 * len(lines))
    _zone(place, name)
    for offset, preset in enumerate(PRESETS):
        own = [one for one in answers if one.cell.preset == preset]
        height = [at[one.cell.operator, one.cell.arm] + 0.26 * (0.5 - offset) for one in own]
        place.hlines(
            height,
            [one.estimate.low for one in own],
            [one.estimate.high for one in own],
            color=COLOURS[preset],
            linewidth=1.5,
        )
        means = [one.estimate.mean for one in own]
        place.plot(means, height, "o", markersize=4, color=COLOURS[preset], label=f"preset {preset}")
    labels = [operator if arm == PRIMARY_ARM else f"{operator}: {arm}" for operator, arm in lines]
    place.set_yticks([at[line] for line in lines], labels, fontsize=8)
    place.set_xlabel(f"{_axis(name)}: Setup 2 minus Setup 1")
    handles, names = place.get_legend_handles_labels()
    legend_below(figure, handles, names, columns=2)
    return Picture.of(
        figure,
        f"Mean paired differences in {named(name)} with adjusted 95% intervals over repeats, by operator in "
        f"the primary arm ({PRIMARY_ARM}), and for the primary operator in the other arms. Right of 0 speaks "
        "for the paper. Shaded: less than the smallest effect of interest.",
    )


def means_table(means: Means) -> Table:
    """Of each cell and setup the means over repeats."""
    head = ["preset", "operator", "arm", "setup", "repeats"]
    head += [_axis(name) for name in MEASURES]
    rows = []
    for cell, repeats in means.items():
        for setup in SETUPS:
            values = [setups[setup] for setups in repeats.values() if setup in setups]
            if values:
                averages = [_mean([value[name] for value in values]) for name in MEASURES]
                short = _SETUPS[setup].split(":")[0]
                told = [cell.preset, cell.operator, cell.arm, short, str(len(values))]
                rows.append([*told, *map(number, averages)])
    return Table(caption=f"Means over repeats. {'; '.join(_SETUPS.values())}.", head=head, rows=rows)


def difference_table(answers: Sequence[Compared], caption: str) -> Table:
    """How much better Setup 1 is, with what is to be known of it."""
    return Table(
        caption=f"{caption} Positive is better with Setup 1: lower disagreement, human weight and effort, "
        "higher intent success and clearance. d_z: mean over standard deviation of the differences.",
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
                named(one.measure),
                str(one.estimate.count),
                amount(one.measure, one.estimate.mean),
                f"[{number(one.plain.low)}, {number(one.plain.high)}]",
                f"[{number(one.estimate.low)}, {number(one.estimate.high)}]",
                number(one.effect),
                number(one.p),
                amount(one.measure, MEASURES[one.measure].smallest),
                one.verdict,
            ]
            for one in answers
        ],
    )


def _axis(name: str) -> str:
    unit = MEASURES[name].unit
    return f"{named(name)}, {unit}" if unit else named(name)


def _zone(place: Any, name: str) -> None:
    smallest = MEASURES[name].smallest
    place.axvspan(-smallest, smallest, color="0.92", zorder=0)
    place.axvline(0.0, color="0.5", linewidth=0.8, zorder=1)


def _first_primary(line: tuple[str, str]) -> tuple[bool, bool]:
    operator, arm = line
    return arm != PRIMARY_ARM, operator != PRIMARY_OPERATOR


def _mean(values: Sequence[float]) -> float:
    finite = [value for value in values if np.isfinite(value)]
    return float(np.mean(finite)) if finite else np.nan
