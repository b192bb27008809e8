"""Where assistance hurts: shared control minus the human alone, over the abilities of the operator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import differences as differences_of, interval
from drake_shared.experiments.common import ALONE_COST, TRIAL_COST
from drake_shared.experiments.drawing import new_figure
from drake_shared.experiments.measures import HUMAN_EFFORT, INTENT_SUCCESS, by_learner, select
from drake_shared.experiments.paired_trials import Condition, demonstrations_of, groups, run_conditions
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size
from drake_shared.experiments.text import number, paragraphs
from drake_shared.experiments.training import PRESETS, train_all, training_cost
from drake_shared.operators.behaviour import Behaviour
from drake_shared.simulation.runner import Task

# From operators who always succeed alone to operators who never do.
SKILLS = (0.2, 0.45, 0.7, 0.95, 1.2)
RANGES: Mapping[str, tuple[float, ...]] = {
    "delay": (0.05, 0.25, 0.45, 0.65, 0.85),
    "noise": (0.0, 0.4, 0.8, 1.2, 1.6),
}
_UNITS = {"delay": "s", "noise": "rad/s"}
# Differences of percentages are in points; the sign is that of a difference that hurts.
_MEASURES = {
    "intent_success": (INTENT_SUCCESS, "points", -1.0),
    "human_effort": (HUMAN_EFFORT, "rad", 1.0),
}
# Twelve trials take each route of the shipped scenarios four times; with ten learners a cell has 120.
_LEARNERS, _GROUP, _TRIALS = 10, 5, 12


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for four learners: both presets, and all cells of both maps."""
    step = 2 if size.name == "quick" else 1
    grid = {"skills": SKILLS[::step]}
    grid |= {name: values[::step] for name, values in RANGES.items()}
    trials = _TRIALS if size.all_arms else min(size.trials, _TRIALS)
    cells = len(grid["skills"]) * sum(len(grid[name]) for name in RANGES)
    seconds = (ALONE_COST + len(PRESETS) * TRIAL_COST) * cells * trials
    return [
        PlannedTask(
            Task.of(run_maps, scenario=scenario, learners=learners, trials=trials, grid=grid),
            sum(training_cost(preset, len(learners)) for preset in PRESETS) + len(learners) * seconds,
        )
        for learners in groups(min(size.learners, _LEARNERS), _GROUP)
    ]


def run_maps(
    scenario: str | None, learners: list[int], trials: int, grid: dict[str, list[float]]
) -> list[dict[str, Any]]:
    """Runs trials alone and with a learner of each preset; all cells have the same routes and seeds.

    Args:
        scenario: File or name.
        learners: Indices, which determine demonstrations, trainings and trials.
        trials: Number of trials in each cell, alone and assisted, with each learner.
        grid: The values of "skills", and of the fields of `Behaviour` that are varied with them, by name.
    """
    sets = demonstrations_of(scenario, learners)
    arms: dict[str, list[Any]] = {"alone": [None] * len(learners)}
    arms |= {preset: train_all(sets, learners, preset=preset) for preset in PRESETS}
    return [
        row
        for arm, taking_part in arms.items()
        for row in run_conditions(
            scenario,
            dict(zip(learners, taking_part, strict=True)),
            [
                Condition(
                    columns={"map": name, "skill": skill, "value": value, "arm": arm},
                    behaviour=Behaviour(skill=skill, **{name: value}),
                )
                for name in RANGES
                for skill in grid["skills"]
                for value in grid[name]
            ],
            trials,
        )
    ]


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Maps of the differences, and a list of the cells in which assistance hurts."""
    rows = [row for result in results for row in result]
    cells = differences(rows)
    alone = [cell["alone"] for cell in select(cells, measure="intent_success")]
    learners = len({row["learner"] for row in rows})
    return Section(
        title="Where help hurts",
        text=paragraphs(
            "where_help_hurts",
            learners=learners,
            trials=len({row["seed"] for row in rows}) // learners,
            alone=alone,
            cells=len(cells) // len(PRESETS) // len(_MEASURES),
            outcomes=[_outcome(cells, name, preset) for name in _MEASURES for preset in PRESETS],
        ),
        pictures=[
            Picture.of(
                _maps(cells, name),
                f"Shared control minus the human alone in {measure.title}, in {unit}; below each difference, "
                "in brackets, the value alone. Frames and bold type mark cells whose interval excludes 0. "
                "Orange: assistance hurts; purple: it helps.",
            )
            for name, (measure, unit, _) in _MEASURES.items()
        ],
        data={"where_help_hurts": rows, "where_help_hurts_cells": cells},
    )


def differences(rows: Rows) -> list[dict[str, Any]]:
    """For each measure, preset and cell the difference, its interval, and the mean of the human alone."""
    found = []
    for name, skill, value in sorted({(row["map"], row["skill"], row["value"]) for row in rows}):
        here = select(rows, map=name, skill=skill, value=value)
        for measure, _, _ in _MEASURES.values():
            alone = measure.factor * by_learner(here, measure.name, arm="alone")
            for preset in PRESETS:
                shared = measure.factor * by_learner(here, measure.name, arm=preset)
                estimate = interval(differences_of(shared, alone), bounds=measure.difference_bounds)
                found.append(
                    {
                        "measure": measure.name,
                        "preset": preset,
                        "map": name,
                        "skill": skill,
                        "value": value,
                        "alone": float(alone.mean()),
                        "difference": estimate.mean,
                        "low": estimate.low,
                        "high": estimate.high,
                    }
                )
    return found


def hurts(cell: Mapping[str, Any]) -> bool:
    """Whether the whole interval of a cell of `differences` is on the side that hurts."""
    sign = _sign(cell["measure"])
    return bool(min(sign * cell["low"], sign * cell["high"]) > 0.0)


def helps(cell: Mapping[str, Any]) -> bool:
    """Whether the whole interval of a cell of `differences` is on the side that helps."""
    sign = _sign(cell["measure"])
    return bool(max(sign * cell["low"], sign * cell["high"]) < 0.0)


def _sign(measure: str) -> float:
    return _MEASURES[measure][2]


def _outcome(cells: Rows, name: str, preset: str) -> dict[str, Any]:
    own = select(cells, measure=name, preset=preset)
    measure, unit, _ = _MEASURES[name]
    return {
        "title": measure.title,
        "preset": preset,
        "unit": unit,
        "cells": len(own),
        "helps": sum(map(helps, own)),
        "hurts": [{**cell, "value_unit": _UNITS[cell["map"]]} for cell in own if hurts(cell)],
    }


def _maps(cells: Rows, name: str) -> Any:
    measure, unit, sign = _MEASURES[name]
    own = select(cells, measure=name)
    bound = max([abs(cell["difference"]) for cell in own if np.isfinite(cell["difference"])] + [1e-9])
    figure, axes = new_figure(6.2, rows=len(PRESETS), columns=len(RANGES))
    for line, preset in zip(axes, PRESETS, strict=True):
        for place, quantity in zip(line, RANGES, strict=True):
            image = _draw_map(place, select(own, preset=preset, map=quantity), bound, sign)
            place.set_xlabel(f"{quantity}, {_UNITS[quantity]}", fontsize=9)
            place.set_ylabel("skill", fontsize=9)
            place.set_title(f"preset {preset}", fontsize=9)
    bar = figure.colorbar(image, ax=axes, shrink=0.6)
    bar.set_label(f"{measure.title}: shared minus alone, {unit}", fontsize=9)
    bar.ax.tick_params(labelsize=8)
    return figure


def _draw_map(place: Any, cells: Rows, bound: float, sign: float) -> Any:
    from matplotlib.patches import Rectangle

    skills = sorted({cell["skill"] for cell in cells})
    values = sorted({cell["value"] for cell in cells})
    grid = np.full((len(skills), len(values)), np.nan)
    for cell in cells:
        y, x = skills.index(cell["skill"]), values.index(cell["value"])
        grid[y, x] = cell["difference"]
        marked = hurts(cell) or helps(cell)
        place.text(
            x,
            y,
            # Differences that cancel out leave rounding errors.
            f"{number(round(cell['difference'], 9) + 0.0)}\n({number(cell['alone'])})",
            ha="center",
            va="center",
            fontsize=7,
            fontweight="bold" if marked else "normal",
            color="white" if abs(cell["difference"]) > 0.65 * bound else "black",
        )
        if marked:
            place.add_patch(Rectangle((x - 0.46, y - 0.46), 0.92, 0.92, fill=False, linewidth=1.2))
    place.set_xticks(range(len(values)), [number(value) for value in values])
    place.set_yticks(range(len(skills)), [number(skill) for skill in skills])
    colours = "PuOr" if sign < 0 else "PuOr_r"
    return place.imshow(grid, cmap=colours, vmin=-bound, vmax=bound, origin="lower", aspect="auto")


EXPERIMENT = Experiment(name="where_help_hurts", plan=plan, report=report)
