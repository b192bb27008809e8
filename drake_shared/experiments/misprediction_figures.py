"""Mispredictions on purpose, as figures and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import interval
from drake_shared.experiments.drawing import BLACK, COLOURS, draw_scene, legend_below, new_figure
from drake_shared.experiments.misprediction_cases import (
    ARMS,
    CASES,
    COMPARED,
    LEAST,
    OPERATORS,
    PRESETS,
    ROOMS,
    drive_of,
    points_of,
)
from drake_shared.experiments.paired_trials import by_learner
from drake_shared.experiments.report import number, with_interval
from drake_shared.experiments.section import Table


def successes(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Intent success by case, arm and operator."""
    figure, axes = new_figure(2.7, columns=len(CASES), sharey=True)
    for place, (case, words) in zip(axes, CASES.items(), strict=True):
        for operator, offset, face in zip(OPERATORS, (-0.13, 0.13), (None, "white"), strict=True):
            for height, (preset, arm) in enumerate(COMPARED):
                found = interval(
                    100.0
                    * by_learner(rows, "intent_success", case=case, preset=preset, arm=arm, operator=operator)
                )
                colour = COLOURS.get(preset, BLACK)
                place.errorbar(
                    [found.mean],
                    [height + offset],
                    xerr=[[found.mean - found.low], [found.high - found.mean]],
                    color=colour,
                    marker="o",
                    markersize=4.5,
                    markerfacecolor=face or colour,
                    capsize=2,
                    linewidth=1.2,
                )
        place.axvline(LEAST, color="0.7", linestyle=":", linewidth=1)
        place.set_title(words, fontsize=9)
        place.set(xlim=(-4, 104))
        place.set_xlabel("intent success, %", fontsize=9)
        place.grid(axis="y", color="0.93")
        place.set_axisbelow(True)
    axes[0].set_yticks(range(len(COMPARED)), list(COMPARED.values()), fontsize=8)
    axes[0].invert_yaxis()
    handles = [
        axes[0].plot([], [], color="0.3", marker="o", linestyle="", markersize=4.5, markerfacecolor=face)[0]
        for face in ("0.3", "white")
    ]
    legend_below(figure, handles, OPERATORS, columns=2)
    return figure


def recoveries(rows: Sequence[Mapping[str, Any]]) -> Any:
    """How many have w above 0.5 again, over time."""
    figure, axes = new_figure(4.2, rows=len(OPERATORS), columns=len(CASES), sharex=True, sharey=True)
    met = [row for row in rows if row["arm"] != "human" and row["weight"] != "unmet"]
    latest = max((row["recovery"] for row in met if row["weight"] == "back"), default=1.0)
    for line, operator in zip(axes, OPERATORS, strict=True):
        for place, (case, words) in zip(line, CASES.items(), strict=True):
            for preset, arm in list(COMPARED)[1:]:
                told = {"case": case, "preset": preset, "arm": arm, "operator": operator}
                own = [row for row in met if all(row[name] == value for name, value in told.items())]
                if not own:
                    continue
                above = sum(row["weight"] == "above" for row in own)
                back = sorted(row["recovery"] for row in own if row["weight"] == "back")
                shares = 100.0 * np.arange(above, above + len(back) + 1) / len(own)
                place.step(
                    [0.0, *back, latest],
                    [*shares, shares[-1]],
                    where="post",
                    color=COLOURS[preset],
                    # Lines often coincide: the one shows beneath the other.
                    linestyle="-" if arm == "on" else "--",
                    linewidth=2.8 if arm == "on" else 1.2,
                    alpha=0.5 if arm == "on" else 1.0,
                    label=COMPARED[preset, arm],
                )
            place.set_title(f"{words},\n{operator}", fontsize=9)
            place.set(ylim=(-3, 103), xlim=(0.0, latest))
        line[0].set_ylabel("w above 0.5, % of trials", fontsize=9)
    for place in axes[-1]:
        place.set_xlabel("time since the moment, s", fontsize=9)
    legend_below(figure, *axes[0, 0].get_legend_handles_labels(), columns=4)
    return figure


def paths(scenario: str | None, results: Sequence[Any]) -> Any:
    """The first trial of the first learner in each case, from above."""
    drawn = {
        (result["rows"][0]["preset"], *name.split()): np.array(path)
        for result in results
        for name, path in result["drawn"].items()
    }
    figure, axes = new_figure(3.6, rows=len(PRESETS), columns=len(CASES), sharex=True, sharey=True)
    styles = {"human": (BLACK, "-"), "on": (COLOURS["shared"], "-"), "off": (COLOURS["agent"], "--")}
    for line, (case, words) in zip(axes.T, CASES.items(), strict=True):
        drive = drive_of(scenario, case, 0, 0)
        for place, preset in zip(line, PRESETS, strict=True):
            draw_scene(place, drive.world)
            if case in ROOMS:
                place.patches[len(drive.world.obstacles) - 1].set_facecolor("0.45")
            place.plot(
                *points_of(drive.path(drive.route)).T, ":", color="0.6" if drive.then else BLACK, lw=1.2
            )
            if drive.then is not None:
                place.plot(*points_of(drive.path(drive.then)).T, ":", color=BLACK, lw=1.2)
            for arm, (colour, style) in styles.items():
                path = drawn["none" if arm == "human" else preset, case, arm]
                place.plot(*path.T, color=colour, linestyle=style, linewidth=1.3, zorder=3)
            space = drive.world.workspace
            place.set(xlim=(space.x_min + 0.3, space.x_max - 0.2), ylim=(space.y_min, space.y_max))
            place.set_title(f"{words},\n{preset}", fontsize=9)
            place.label_outer()
    handles = [
        axes[0, 0].plot([], [], color=colour, linestyle=style, linewidth=1.3)[0]
        for colour, style in styles.values()
    ]
    labels = ["human alone", *ARMS.values()]
    legend_below(figure, handles, labels, columns=3)
    return figure


def table(rows: Sequence[Mapping[str, Any]], operator: str) -> Table:
    """Outcomes and recovery by case and arm."""
    cells = []
    for case, words in CASES.items():
        for (preset, arm), label in COMPARED.items():
            told = {"case": case, "preset": preset, "arm": arm, "operator": operator}
            own = [row for row in rows if all(row[name] == value for name, value in told.items())]
            row = [words, label]
            for measure, factor in (("intent_success", 100.0), ("collision", 100.0), ("strayed", 1.0)):
                row.append(_told(factor * by_learner(own, measure)))
            if arm == "human":
                row += ["–", "–", "–"]
            else:
                met = [each for each in own if each["weight"] != "unmet"]
                row.append(_told(by_learner(met, "recovery")))
                row += [
                    number(100.0 * np.mean([each["weight"] == kind for each in met])) if met else "–"
                    for kind in ("above", "never")
                ]
            cells.append(row)
    return Table(
        caption=f"Operator {operator}: means and 95% bootstrap intervals over learners. The time is over the "
        "trials in which w fell and came back; the last two columns are shares of all trials.",
        head=[
            *("case", "control", "intent success, %", "collisions, %", "strayed, m"),
            *("w back above 0.5 after, s", "above all along, %", "never back, %"),
        ],
        rows=cells,
    )


def _told(values: np.ndarray) -> str:
    found = interval(values)
    return with_interval(found) if found.count else "–"
