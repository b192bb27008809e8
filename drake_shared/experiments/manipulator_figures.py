"""Figures and tables of the trials of an arm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from drake_shared.experiments.drawing import (
    BLACK,
    COLOURS,
    ORANGE,
    PURPLE,
    draw_interval,
    label_lines,
    marker_legend,
    new_figure,
    title_panel,
)
from drake_shared.experiments.manipulator_trials import (
    AGENT,
    ALONE,
    CLEARANCE,
    COMPARED,
    CONTROLS,
    NOISY_CLICK,
    OPERATORS,
    SHARED,
    STEADY,
    STEADY_CLICK,
    UNSTEADY,
    WITH_CLEARANCE,
)
from drake_shared.experiments.measures import (
    COLLISIONS,
    INTENT_SUCCESS,
    MEAN_HUMAN_WEIGHT,
    Measure,
    estimate,
    means_table,
)
from drake_shared.experiments.section import Rows, Table
from drake_shared.experiments.text import number

TIME = Measure("completion_time", "time", "s", limits=(0.0, 15.0))
SWITCHES = Measure("plane_switches", "switches of plane", limits=(0.0, 22.0))
_DRAWN = (INTENT_SUCCESS, COLLISIONS, TIME, MEAN_HUMAN_WEIGHT)
_MEASURES = (*_DRAWN, Measure("wrong_goal", "wrong cup", "%", 100.0))
_TARGET_MEASURES = (
    Measure("selected", "targets selected", "%", 100.0),
    Measure("throughput", "throughput", "bit/s"),
)


def cases_table(rows: Rows) -> Table:
    """The measures of each operator, control and clearance."""
    cases = dict.fromkeys((row["operator"], row["control"], row["keeps_clear"]) for row in rows)
    operators, controls = list(OPERATORS), list(CONTROLS)
    ordered = sorted(cases, key=lambda case: (operators.index(case[0]), controls.index(case[1]), case[2]))
    return means_table(
        rows,
        _MEASURES,
        [
            (
                [operator, control, number(1000.0 * CLEARANCE if keeps_clear else None)],
                _where(operator, control, keeps_clear),
            )
            for operator, control, keeps_clear in ordered
        ],
        head=["operator", "control", "clearance kept, mm"],
        caption="The task with three cups: means and 95% intervals over learners. The time is that of trials "
        "that reached a cup.",
    )


def switches_table(rows: Rows) -> Table:
    """Switches of plane of the operators with two axes."""
    return means_table(
        rows,
        [SWITCHES],
        [
            ([operator, control], _where(operator, control))
            for operator in (STEADY_CLICK, NOISY_CLICK)
            for control in (ALONE, SHARED)
        ],
        head=["operator", "control"],
        caption="Switches between the planes x-y and y-z: means and 95% intervals over learners.",
    )


def targets_table(targets: Rows) -> Table:
    """Throughput of each operator, alone and in shared control."""
    return means_table(
        targets,
        _TARGET_MEASURES,
        [
            ([operator, control], {"operator": operator, "control": control})
            for operator, control in dict.fromkeys((row["operator"], row["control"]) for row in targets)
        ],
        head=["operator", "control"],
        caption="Targets at three distances and of two sizes: means and 95% intervals over learners. The "
        "throughput of an operator who selects one of the targets less than twice is not defined.",
    )


def _where(operator: str, control: str, keeps_clear: bool = False) -> dict[str, Any]:
    return {"operator": operator, "control": control, "keeps_clear": keeps_clear}


def draw_operators(rows: Rows) -> Any:
    """A line for each operator, alone and in shared control."""
    figure, axes = _panels(2.9, list(OPERATORS))
    styles = {ALONE: ("human", -0.24), SHARED: ("shared", 0.08)}
    for place, measure in zip(axes, _DRAWN, strict=True):
        for height, operator in enumerate(OPERATORS):
            for control, (colour, offset) in styles.items():
                for keeps_clear in (False, True) if operator in WITH_CLEARANCE else (False,):
                    found = estimate(rows, measure, **_where(operator, control, keeps_clear))
                    marker = {"markerfacecolor": "white"} if keeps_clear else {}
                    at = height + offset + 0.16 * keeps_clear
                    draw_interval(place, at, found, COLOURS[colour], marker="o", markersize=3.5, **marker)
    legend = {control: (COLOURS[colour], "o") for control, (colour, _) in styles.items()}
    marker_legend(figure, legend, columns=len(legend))
    return figure


def draw_controls(rows: Rows) -> Any:
    """A line for each way to share control."""
    figure, axes = _panels(3.6, list(CONTROLS))
    styles = {STEADY: (BLACK, 0.0), UNSTEADY: (PURPLE, -0.12), NOISY_CLICK: (ORANGE, 0.12)}
    for place, measure in zip(axes, _DRAWN, strict=True):
        for height, control in enumerate(CONTROLS):
            for operator in (STEADY,) if control == AGENT else COMPARED:
                colour, offset = styles[operator]
                found = estimate(rows, measure, **_where(operator, control))
                draw_interval(place, height + offset, found, colour, marker="o", markersize=3.5)
    legend = {operator: (styles[operator][0], "o") for operator in COMPARED}
    marker_legend(figure, legend, columns=len(legend))
    return figure


def _panels(height: float, labels: Sequence[str]) -> tuple[Any, Any]:
    """A panel for each measure, with one line for each label."""
    figure, axes = new_figure(height, columns=len(_DRAWN), sharey=True)
    label_lines(axes[0], labels)
    for place, measure in zip(axes, _DRAWN, strict=True):
        title_panel(place, measure.title, measure.unit)
    return figure, axes
