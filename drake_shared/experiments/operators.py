"""The simulated operators: their models, and their trials alone and in shared control."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from drake_shared.experiments.common import (
    ALONE_COST,
    TRIAL_COST,
    Teaching,
    demonstrated,
    row_of,
    run_all,
    scenario_of,
)
from drake_shared.experiments.drawing import COLOURS, draw_scene, legend_below, new_figure
from drake_shared.experiments.measures import select
from drake_shared.experiments.paired_trials import route_settings
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size, Table
from drake_shared.experiments.text import paragraphs
from drake_shared.experiments.training import train_all
from drake_shared.operators.named import OPERATORS, changes_of_route
from drake_shared.simulation.runner import Task

_DRIVERS = {"human": ("alone", "--"), "shared": ("shared control", "-")}
"""Name to label and style of line."""
_SEED = 900_000
_DRAWN_STEPS = 2
"""Distance between the steps of a trial that are drawn."""


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each operator. The learner is trained once in each process, which is not counted."""
    trials = 2 * size.trials
    return [
        PlannedTask(
            Task.of(run_operator, scenario=scenario, name=name, trials=trials),
            (ALONE_COST + TRIAL_COST) * trials,
        )
        for name in OPERATORS
    ]


def run_operator(scenario: str | None, name: str, trials: int) -> dict[str, Any]:
    """Runs trials of an operator alone and with a learner, on the same routes and seeds."""
    world, learner = scenario_of(scenario), _learner(scenario)
    drawn_trials = len(changes_of_route(world)) if OPERATORS[name].switches else len(world.routes)
    runs = [(index, driver) for index in range(trials) for driver in _DRIVERS]
    settings = [
        route_settings(scenario, name, index, seed=_SEED + 1_000 + index, driver=driver)
        for index, driver in runs
    ]
    rows, drawn = [], {}
    driven = run_all(scenario, [learner] * len(runs), settings)
    for (index, driver), trial in zip(runs, driven, strict=True):
        rows.append(row_of(trial, operator=name, mode=driver))
        if index < drawn_trials:
            every = slice(None, None, _DRAWN_STEPS)
            drawn[f"{driver} {index}"] = {
                "path": np.round(trial.positions[every], 3),
                "t": trial["t"][every],
                "command": np.round(trial.commands("human")[every], 3),
            }
    return {"rows": rows, "drawn": drawn}


@functools.cache
def _learner(scenario: str | None) -> Any:
    return train_all(demonstrated(scenario, [Teaching(seed=_SEED)]), [0], preset="default")[0]


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """A drawing and a line of the table for each operator."""
    return Section(
        title="The simulated operators",
        text=paragraphs("operators", trials=len(results[0]["rows"]) // 2),
        pictures=[
            Picture.of(
                _figure(scenario, results),
                "The first drive of each route from above: alone (dashed) and in shared control. The green "
                "circle is the goal.",
            )
        ],
        tables=[
            Table(
                caption="Intent success is the share of trials that reached the goal without contact and "
                "passed every obstacle on the instructed side; w is the mean human weight in shared control.",
                head=["operator", "model", "source", "alone", "shared", "w"],
                rows=[_line(result["rows"]) for result in results],
            )
        ],
        data={"operators": [row for result in results for row in result["rows"]]},
    )


def _line(rows: Rows) -> list[str]:
    name = rows[0]["operator"]
    shares = [
        f"{100 * np.mean([row['intent_success'] for row in select(rows, mode=driver)]):.0f}%"
        for driver in _DRIVERS
    ]
    weight = np.mean([row["mean_human_weight"] for row in select(rows, mode="shared")])
    return [name, OPERATORS[name].model, OPERATORS[name].source, *shares, f"{weight:.2f}"]


def _figure(scenario: str | None, results: list[Any]) -> Any:
    columns = 3
    lines = -(-len(results) // columns)
    figure, axes = new_figure(1.9 * lines, rows=lines, columns=columns, sharex=True, sharey=True)
    for place in axes.flat[len(results) :]:
        place.set_visible(False)
    for place, result in zip(axes.flat, results, strict=False):
        draw_scene(place, scenario_of(scenario))
        for label, drawn in result["drawn"].items():
            driver = label.split()[0]
            style = _DRIVERS[driver][1]
            place.plot(*np.array(drawn["path"]).T, color=COLOURS[driver], linewidth=1.0, linestyle=style)
        place.set_title(result["rows"][0]["operator"], fontsize=9)
        place.set(xlim=(-0.4, 5.4), ylim=(-1.4, 1.4))
        place.label_outer()
    handles = [
        axes.flat[0].plot([], [], color=COLOURS[driver], linestyle=style, label=label)[0]
        for driver, (label, style) in _DRIVERS.items()
    ]
    legend_below(figure, handles, columns=2)
    return figure


EXPERIMENT = Experiment(name="operators_drawn", plan=plan, report=report)
