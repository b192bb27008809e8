"""The simulated operators: what each does, how it drives alone and with help."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import interval
from drake_shared.experiments.common import (
    ALONE_COST,
    TRIAL_COST,
    as_demonstrations,
    drives,
    measured,
    run,
    scenario_of,
    train_all,
)
from drake_shared.experiments.drawing import COLOURS, draw_scene, legend_below, new_figure
from drake_shared.experiments.section import Experiment, Picture, Section, Size, Table
from drake_shared.operators.named import OPERATORS, changes_of_route
from drake_shared.simulation.runner import Task

_SEED = 900_000
_DRAWN_STEPS = 2
"""Every so many steps of a trial that is drawn."""


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """One for each operator."""
    return [
        Task(
            "drake_shared.experiments.operators:run_operator",
            {"scenario": scenario, "name": name, "trials": 2 * size.trials},
        )
        for name in OPERATORS
    ]


def cost(task: Task) -> float:
    """Seconds of one core, roughly, but for the training of the one learner, once in each process."""
    return (ALONE_COST + TRIAL_COST) * task.arguments["trials"]


def run_operator(scenario: str | None, name: str, trials: int) -> dict[str, Any]:
    """Trials of one operator alone and with one learner of preset "default", seeds and routes matched."""
    world = scenario_of(scenario)
    named = OPERATORS[name]
    behaviour = named.behaviour_in(world)
    learner = _learner(scenario)
    changes: list[tuple[Any, Any]] = [(route, None) for route in world.routes]
    if named.switches:
        changes = list(changes_of_route(world))
    rows, drawn = [], {}
    for index in range(trials):
        route, then = changes[index % len(changes)]
        for mode in ("human", "shared"):
            trial = run(
                scenario,
                learner,
                driver=mode,
                route=route.name,
                then=None if then is None else then.name,
                seed=_SEED + 1_000 + index,
                behaviour=behaviour,
            )
            rows.append(measured(trial, operator=name, mode=mode))
            if index < len(changes):
                every = slice(None, None, _DRAWN_STEPS)
                drawn[f"{mode} {index}"] = {
                    "path": np.round(trial.positions[every], 3),
                    "t": trial["t"][every],
                    "command": np.round(trial.commands("human")[every], 3),
                }
    return {"rows": rows, "drawn": drawn}


@functools.cache
def _learner(scenario: str | None) -> Any:
    count = len(scenario_of(scenario).routes)
    taught = as_demonstrations(scenario, drives(scenario, count=count, seed=_SEED))
    return train_all([taught], [0], preset="default")[0]


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """A drawing and a row of the table for each operator."""
    world = scenario_of(scenario)
    columns = 3
    lines = -(-len(results) // columns)
    figure, axes = new_figure(1.9 * lines, rows=lines, columns=columns, sharex=True, sharey=True)
    for place in axes.flat[len(results) :]:
        place.set_visible(False)
    table, rows = [], []
    for place, result in zip(axes.flat, results, strict=False):
        name = result["rows"][0]["operator"]
        draw_scene(place, world)
        for label, drawn in result["drawn"].items():
            mode = label.split()[0]
            path = np.array(drawn["path"])
            colour = COLOURS["human" if mode == "human" else "shared"]
            place.plot(*path.T, color=colour, linewidth=1.0, linestyle="-" if mode == "shared" else "--")
        place.set_title(name, fontsize=9)
        place.set(xlim=(-0.4, 5.4), ylim=(-1.4, 1.4))
        place.label_outer()
        rows += result["rows"]
        by_mode = {
            mode: [row for row in result["rows"] if row["mode"] == mode] for mode in ("human", "shared")
        }
        shares = [
            f"{100 * np.mean([row['intent_success'] for row in by_mode[mode]]):.0f}%" for mode in by_mode
        ]
        weight = interval([row["mean_human_weight"] for row in by_mode["shared"]])
        table.append([name, OPERATORS[name].model, OPERATORS[name].source, *shares, f"{weight.mean:.2f}"])
    handles = [
        axes.flat[0].plot([], [], color=COLOURS["human"], linestyle="--", label="alone")[0],
        axes.flat[0].plot([], [], color=COLOURS["shared"], label="shared control")[0],
    ]
    legend_below(figure, handles, columns=2)
    count = len(results[0]["rows"]) // 2
    return Section(
        title="The simulated operators",
        text=[
            "Each operator steers along the route that it means by one law, and departs from it in its own "
            f"way. {count} trials of each, alone and with one learner (preset default), on the same routes "
            "and seeds. The table is a description, not an inference: the learner is one."
        ],
        pictures=[
            Picture.of(
                figure,
                "The first drive of each route from above: alone (dashed) and in shared control. The green "
                "circle is the goal.",
            )
        ],
        tables=[
            Table(
                caption="Intent success is the share of trials that reached the goal without contact, past "
                "every obstacle on the side meant; w is the mean human weight in shared control.",
                head=["operator", "model", "source", "alone", "shared", "w"],
                rows=table,
            )
        ],
        data={"operators": rows},
    )


EXPERIMENT = Experiment(name="operators_drawn", tasks=tasks, cost=cost, report=report)
