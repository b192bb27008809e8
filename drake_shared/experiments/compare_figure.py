"""The table and the figure of the frozen benchmark."""

from __future__ import annotations

import itertools

from drake_shared.experiments.compare_trials import HUMAN
from drake_shared.experiments.drawing import (
    BLACK,
    BLUE,
    VERMILION,
    draw_interval,
    label_lines,
    new_figure,
    rule_lines,
)
from drake_shared.experiments.measures import (
    COLLISIONS,
    HUMAN_EFFORT,
    INTENT_SUCCESS,
    Measure,
    estimate,
    select,
)
from drake_shared.experiments.section import Picture, Rows, Table
from drake_shared.experiments.text import number, with_interval

MEASURES = (
    INTENT_SUCCESS,
    COLLISIONS,
    Measure("wrong_route", "wrong route or goal", "%", 100.0),
    HUMAN_EFFORT,
    Measure("completion_time", "time", "s"),
    Measure("recovery", "recovery after a switch", "s"),
)
_COLUMNS = 4


def cells_of(rows: Rows) -> list[tuple[str, str]]:
    """World and condition of each cell, in the order of the rows."""
    return list(dict.fromkeys((row["world"], row["condition"]) for row in rows))


def losses(rows: Rows, arbiter: str) -> list[str]:
    """The cells in which the mean intent success of an arbiter is below that of the human alone."""
    found = []
    for world, condition in cells_of(rows):
        one, alone = (
            estimate(rows, INTENT_SUCCESS, unit="case", arbiter=name, world=world, condition=condition).mean
            for name in (arbiter, HUMAN)
        )
        if one < alone - 1e-9:
            label = condition if world == "as taught" else f"{world}, {condition}"
            found.append(f"{label} ({number(one - alone)})")
    return found


def table(rows: Rows) -> Table:
    """A line for each arbiter: means over cases, and where it loses against the human alone."""
    arbiters = list(dict.fromkeys(row["arbiter"] for row in rows))
    return Table(
        caption="Means with 95% intervals over cases, all conditions together; and the cells in which the "
        "mean intent success is below that of the human alone, with the difference in points.",
        head=["arbiter", *(measure.label for measure in MEASURES), "losses"],
        rows=[
            [
                name,
                *(with_interval(estimate(rows, measure, unit="case", arbiter=name)) for measure in MEASURES),
                ", ".join(losses(rows, name)) or "none",
            ]
            for name in arbiters
        ],
    )


def picture(rows: Rows) -> Picture:
    """The intent success of each arbiter in each cell; red where it is below that of the human alone."""
    arbiters = list(dict.fromkeys(row["arbiter"] for row in rows))
    cells = cells_of(rows)
    lines = -(-len(cells) // _COLUMNS)
    height = lines * (0.7 + 0.19 * len(arbiters))
    figure, axes = new_figure(height, rows=lines, columns=_COLUMNS, sharey=True, squeeze=False)
    label_lines(axes[0, 0], arbiters)
    for place, cell in itertools.zip_longest(axes.flat, cells):
        if cell is None:
            place.set_visible(False)
            continue
        world, condition = cell
        inside = select(rows, world=world, condition=condition)
        alone = estimate(inside, INTENT_SUCCESS, unit="case", arbiter=HUMAN)
        place.axvline(alone.mean, color="0.7", linewidth=1.0)
        for at, name in enumerate(arbiters):
            found = estimate(inside, INTENT_SUCCESS, unit="case", arbiter=name)
            colour = BLACK if name == HUMAN else BLUE if found.mean >= alone.mean - 1e-9 else VERMILION
            draw_interval(place, at, found, colour, marker="o", markersize=3.5)
        place.set_title(condition if world == "as taught" else f"{world}: {condition}", fontsize=9)
        place.set_xlim(-5, 105)
        rule_lines(place)
    figure.supxlabel("intent success, %", fontsize=8)
    return Picture.of(
        figure,
        "Intent success by arbiter, world and simulated operator: means with 95% intervals over cases. The "
        "grey line is the human alone; red arbiters are below it.",
    )
