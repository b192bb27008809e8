"""Figures and tables of mispredictions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import interval
from drake_shared.experiments.drawing import (
    BLACK,
    COLOURS,
    draw_interval,
    draw_scene,
    label_lines,
    legend_below,
    limit_to_workspace,
    new_figure,
    rule_lines,
)
from drake_shared.experiments.measures import (
    COLLISIONS,
    INTENT_SUCCESS,
    Measure,
    by_learner,
    estimate,
    select,
)
from drake_shared.experiments.misprediction_cases import (
    ARMS,
    CASES,
    LEAST,
    LINES,
    OPERATORS,
    PASSAGES,
    Drive,
    drive_of,
    points_of,
)
from drake_shared.experiments.section import Rows, Table
from drake_shared.experiments.text import number, with_interval
from drake_shared.experiments.training import PRESETS

_MEASURES = (INTENT_SUCCESS, COLLISIONS, Measure("strayed", "largest deviation", "m"))
_FACES = dict(zip(OPERATORS, ("0.3", "white"), strict=True))


def successes(rows: Rows) -> Any:
    """Intent success by case, arm and operator."""
    figure, axes = new_figure(2.7, columns=len(CASES), sharey=True)
    label_lines(axes[0], list(LINES.values()))
    for place, (case, words) in zip(axes, CASES.items(), strict=True):
        for operator, offset in zip(OPERATORS, (-0.13, 0.13), strict=True):
            for height, (preset, arm) in enumerate(LINES):
                where = {"case": case, "preset": preset, "arm": arm, "operator": operator}
                colour = COLOURS.get(preset, BLACK)
                face = "white" if _FACES[operator] == "white" else colour
                draw_interval(
                    place,
                    height + offset,
                    estimate(rows, INTENT_SUCCESS, **where),
                    colour,
                    marker="o",
                    markersize=4.5,
                    markerfacecolor=face,
                )
        place.axvline(LEAST, color="0.7", linestyle=":", linewidth=1)
        place.set_title(words.replace(" without", "\nwithout"), fontsize=9)
        place.set(xlim=(-4, 104))
        place.set_xlabel(INTENT_SUCCESS.label, fontsize=9)
        rule_lines(place)
    style = {"color": "0.3", "marker": "o", "linestyle": "", "markersize": 4.5}
    handles = [axes[0].plot([], [], **style, markerfacecolor=face)[0] for face in _FACES.values()]
    legend_below(figure, handles, OPERATORS, columns=2)
    return figure


def recoveries(rows: Rows) -> Any:
    """The share of trials in which w is above 0.5, over time."""
    figure, axes = new_figure(4.2, rows=len(OPERATORS), columns=len(CASES), sharex=True, sharey=True)
    met = [row for row in rows if row["arm"] != "human" and row["weight"] != "unmet"]
    latest = max((row["recovery"] for row in select(met, weight="back")), default=1.0)
    for line, operator in zip(axes, OPERATORS, strict=True):
        for place, (case, words) in zip(line, CASES.items(), strict=True):
            for preset, arm in list(LINES)[1:]:
                own = select(met, case=case, preset=preset, arm=arm, operator=operator)
                if own:
                    _draw_recoveries(place, own, latest)
            place.set_title(f"{words},\n{operator}", fontsize=9)
            place.set(ylim=(-3, 103), xlim=(0.0, latest))
        line[0].set_ylabel("w above 0.5, % of trials", fontsize=9)
    for place in axes[-1]:
        place.set_xlabel("time since the misprediction, s", fontsize=9)
    legend_below(figure, *axes[0, 0].get_legend_handles_labels(), columns=4)
    return figure


def _draw_recoveries(place: Any, rows: Rows, latest: float) -> None:
    preset, arm = rows[0]["preset"], rows[0]["arm"]
    above = len(select(rows, weight="above"))
    back = sorted(row["recovery"] for row in select(rows, weight="back"))
    shares = 100.0 * np.arange(above, above + len(back) + 1) / len(rows)
    # Curves often coincide: one is visible beneath the other.
    style = {"linestyle": "-", "linewidth": 2.8, "alpha": 0.5}
    if arm == "off":
        style = {"linestyle": "--", "linewidth": 1.2, "alpha": 1.0}
    times, shares = [0.0, *back, latest], np.append(shares, shares[-1])
    place.step(times, shares, where="post", color=COLOURS[preset], label=LINES[preset, arm], **style)


def paths(scenario: str | None, results: Sequence[Any]) -> Any:
    """The first trial of the first learner in each case, from above."""
    drawn = {
        (result["rows"][0]["preset"], *name.split()): np.array(path)
        for result in results
        for name, path in result["drawn"].items()
    }
    figure, axes = new_figure(3.6, rows=len(PRESETS), columns=len(CASES), sharex=True, sharey=True)
    styles = {"human": (BLACK, "-"), "on": (COLOURS["shared"], "-"), "off": (COLOURS["agent"], "--")}
    for column, (case, words) in zip(axes.T, CASES.items(), strict=True):
        drive = drive_of(scenario, case, 0, 0)
        for place, preset in zip(column, PRESETS, strict=True):
            _draw_drive(place, drive, case)
            for arm, (colour, style) in styles.items():
                path = drawn["none" if arm == "human" else preset, case, arm]
                place.plot(*path.T, color=colour, linestyle=style, linewidth=1.3, zorder=3)
            place.set_title(f"{words},\n{preset}", fontsize=9)
            place.label_outer()
    handles = [
        axes[0, 0].plot([], [], color=colour, linestyle=style, linewidth=1.3)[0]
        for colour, style in styles.values()
    ]
    legend_below(figure, handles, ["human alone", *ARMS.values()], columns=3)
    return figure


def _draw_drive(place: Any, drive: Drive, case: str) -> None:
    """The scene and the instructed route; after a change, the old route in grey."""
    draw_scene(place, drive.world)
    if case in PASSAGES:
        place.patches[len(drive.world.obstacles) - 1].set_facecolor("0.45")
    place.plot(*points_of(drive.path(drive.route)).T, ":", color="0.6" if drive.then else BLACK, lw=1.2)
    if drive.then is not None:
        place.plot(*points_of(drive.path(drive.then)).T, ":", color=BLACK, lw=1.2)
    limit_to_workspace(place, drive.world, left=0.3, right=0.2)


def table(rows: Rows, operator: str) -> Table:
    """Outcomes and recovery by case and arm."""
    cells = []
    for case, words in CASES.items():
        for (preset, arm), label in LINES.items():
            own = select(rows, case=case, preset=preset, arm=arm, operator=operator)
            line = [words, label, *(with_interval(estimate(own, measure)) for measure in _MEASURES)]
            cells.append([*line, *(["–"] * 3 if arm == "human" else _recovery_cells(own))])
    return Table(
        caption=f"Operator {operator}: means and 95% intervals over learners. The time is over the "
        "trials in which w fell and rose again; the last two columns are shares of all trials.",
        head=[
            *("case", "control", *(measure.label for measure in _MEASURES)),
            *("w above 0.5 again after, s", "always above, %", "never again, %"),
        ],
        rows=cells,
    )


def _recovery_cells(rows: Rows) -> list[str]:
    met = [row for row in rows if row["weight"] != "unmet"]
    shares = [
        number(100.0 * len(select(met, weight=kind)) / len(met)) if met else "–"
        for kind in ("above", "never")
    ]
    return [with_interval(interval(by_learner(met, "recovery"))), *shares]
