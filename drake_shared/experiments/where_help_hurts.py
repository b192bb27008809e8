"""Where help hurts: assisted less alone, over how good the operator is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from drake_shared.analysis.statistics import Estimate, interval
from drake_shared.experiments.common import (
    ALONE_COST,
    TRIAL_COST,
    measured,
    run,
    train_all,
    training_cost,
)
from drake_shared.experiments.drawing import new_figure
from drake_shared.experiments.paired_trials import by_learner, groups, settings, taught
from drake_shared.experiments.report import number
from drake_shared.experiments.section import Experiment, Picture, Section, Size
from drake_shared.operators.behaviour import Behaviour
from drake_shared.simulation.runner import Task

PRESETS = ("paper", "default")
# From drivers who never fail alone to some who always do.
SKILLS = (0.2, 0.45, 0.7, 0.95, 1.2)
RANGES: Mapping[str, tuple[float, ...]] = {
    "delay": (0.05, 0.25, 0.45, 0.65, 0.85),
    "noise": (0.0, 0.4, 0.8, 1.2, 1.6),
}
_UNITS = {"delay": "s", "noise": "rad/s"}
# Of each measure its name, its unit, a factor, and the sign of what hurts.
_MEASURES = {
    "intent_success": ("intent success", "points", 100.0, -1.0),
    "human_effort": ("human effort", "rad", 1.0, 1.0),
}
# Three trials take each route of the shipped scenarios once.
_LEAST, _GROUP, _TRIALS = 2, 4, 3


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """One for four learners: both presets of each, all cells of both maps."""
    coarse = slice(None, None, 2) if size.name == "quick" else slice(None)
    grid = {"skills": SKILLS[coarse], **{name: values[coarse] for name, values in RANGES.items()}}
    return [
        Task(
            "drake_shared.experiments.where_help_hurts:run_maps",
            {"scenario": scenario, "learners": learners, "trials": min(size.trials, _TRIALS), "grid": grid},
        )
        for learners in groups(max(_LEAST, 2 * size.learners // 5), _GROUP)
    ]


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    grid = task.arguments["grid"]
    cells = len(grid["skills"]) * sum(len(grid[name]) for name in RANGES)
    trial = ALONE_COST + len(PRESETS) * TRIAL_COST
    learners = len(task.arguments["learners"])
    training = sum(training_cost(preset, learners) for preset in PRESETS)
    return training + learners * trial * cells * task.arguments["trials"]


def run_maps(
    scenario: str | None, learners: list[int], trials: int, grid: dict[str, list[float]]
) -> list[dict[str, Any]]:
    """Trials alone and with a learner of each preset, in every cell with the same routes and seeds.

    Args:
        scenario: File or name.
        learners: Their indices; they fix demonstrations, trainings and trials.
        trials: In each cell, alone and assisted, with each learner.
        grid: The values of "skills", and of the behaviour that varies with them, by its name.
    """
    sets = [taught(scenario, index) for index in learners]
    trained = {preset: train_all(sets, learners, preset=preset) for preset in PRESETS}
    arms: dict[str, Any] = {"alone": [None] * len(learners), **trained}
    return [
        measured(
            run(
                scenario,
                taking_part,
                **{
                    **settings(scenario, "primary", index, trial),
                    "behaviour": Behaviour(skill=skill, **{name: value}),
                },
            ),
            map=name,
            skill=skill,
            value=value,
            arm=arm,
            learner=index,
        )
        for name in RANGES
        for skill in grid["skills"]
        for value in grid[name]
        for arm, taking_parts in arms.items()
        for index, taking_part in zip(learners, taking_parts, strict=True)
        for trial in range(trials)
    ]


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Maps of the differences, and the cells where they speak against help."""
    rows = [row for result in results for row in result]
    cells = differences(rows)
    alone = [cell["alone"] for cell in cells if cell["measure"] == "intent_success"]
    learners = len({row["learner"] for row in rows})
    trials = len({row["seed"] for row in rows}) // learners
    return Section(
        title="Where help hurts",
        text=[
            "What assistance does to simulated operators who drive well or badly: maps over skill and delay "
            "and over skill and noise, of assisted less alone. Everything else is as with the primary "
            f"operator. {learners} learners of each preset and {trials} trials of each, alone and assisted "
            "with the same routes and seeds; alone, intent success goes from "
            f"{number(min(alone))}% to {number(max(alone))}% over the cells.",
            "A cell is marked where its 95% bootstrap interval over learners excludes 0. The cells are not "
            f"adjusted for their number: of {len(cells) // len(PRESETS) // len(_MEASURES)} in a preset's two "
            "maps, one in twenty would be marked by chance, and somewhat more as the learners are few. "
            "Effort is summed to the end of a trial, so that whoever never arrives is at it longest.",
            *(_told(cells, measure, preset) for measure in _MEASURES for preset in PRESETS),
        ],
        pictures=[
            Picture.of(
                _maps(cells, measure),
                f"Assisted less alone in {_MEASURES[measure][0]}, in {_MEASURES[measure][1]}; below each, in "
                "brackets, the value alone. Frames and bold figures mark cells whose interval excludes 0; "
                "orange is where help hurts, purple where it helps.",
            )
            for measure in _MEASURES
        ],
        data={"where_help_hurts": rows, "where_help_hurts_cells": cells},
    )


def differences(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Of each measure, preset and cell: the mean of assisted less alone, its interval, and that of alone."""
    places = sorted({(row["map"], row["skill"], row["value"]) for row in rows})
    found = []
    for name, skill, value in places:
        here = [row for row in rows if (row["map"], row["skill"], row["value"]) == (name, skill, value)]
        for measure, (_, _, factor, _) in _MEASURES.items():
            alone = factor * by_learner(here, measure, arm="alone")
            for preset in PRESETS:
                estimate: Estimate = interval(factor * by_learner(here, measure, arm=preset) - alone)
                found.append(
                    {
                        "measure": measure,
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
    """Whether the whole interval of a cell of `differences` speaks against help."""
    sign = _MEASURES[cell["measure"]][3]
    return min(sign * cell["low"], sign * cell["high"]) > 0.0


def helps(cell: Mapping[str, Any]) -> bool:
    """Whether the whole interval of a cell of `differences` speaks for help."""
    sign = _MEASURES[cell["measure"]][3]
    return max(sign * cell["low"], sign * cell["high"]) < 0.0


def _told(cells: Sequence[Mapping[str, Any]], measure: str, preset: str) -> str:
    title, unit, _, _ = _MEASURES[measure]
    own = [cell for cell in cells if cell["measure"] == measure and cell["preset"] == preset]
    bad = [cell for cell in own if hurts(cell)]
    listed = "; ".join(
        f"skill {number(cell['skill'])} with {cell['map']} {number(cell['value'])} {_UNITS[cell['map']]} "
        f"({number(cell['difference'])} [{number(cell['low'])}, {number(cell['high'])}] {unit})"
        for cell in bad
    )
    where = f"hurts in {len(bad)}: {listed}" if bad else "hurts in none"
    return (
        f"In {title}, with learners of preset {preset}, assistance helps in {sum(map(helps, own))} of "
        f"{len(own)} cells and {where}."
    )


def _maps(cells: Sequence[Mapping[str, Any]], measure: str) -> Any:
    import numpy as np
    from matplotlib.patches import Rectangle

    title, unit, _, sign = _MEASURES[measure]
    own = [cell for cell in cells if cell["measure"] == measure]
    bound = max([abs(cell["difference"]) for cell in own if np.isfinite(cell["difference"])] + [1e-9])
    figure, axes = new_figure(6.2, rows=len(PRESETS), columns=len(RANGES))
    for line, preset in zip(axes, PRESETS, strict=True):
        for place, name in zip(line, RANGES, strict=True):
            here = [cell for cell in own if cell["preset"] == preset and cell["map"] == name]
            skills = sorted({cell["skill"] for cell in here})
            values = sorted({cell["value"] for cell in here})
            grid = np.full((len(skills), len(values)), np.nan)
            for cell in here:
                at = skills.index(cell["skill"]), values.index(cell["value"])
                grid[at] = cell["difference"]
                marked = hurts(cell) or helps(cell)
                place.text(
                    at[1],
                    at[0],
                    f"{number(cell['difference'])}\n({number(cell['alone'])})",
                    ha="center",
                    va="center",
                    fontsize=7,
                    fontweight="bold" if marked else "normal",
                    color="white" if abs(cell["difference"]) > 0.65 * bound else "black",
                )
                if marked:
                    place.add_patch(
                        Rectangle((at[1] - 0.46, at[0] - 0.46), 0.92, 0.92, fill=False, linewidth=1.2)
                    )
            # Orange is what hurts, whichever way the measure goes.
            image = place.imshow(
                grid,
                cmap="PuOr" if sign < 0 else "PuOr_r",
                vmin=-bound,
                vmax=bound,
                origin="lower",
                aspect="auto",
            )
            place.set_xticks(range(len(values)), [number(value) for value in values])
            place.set_yticks(range(len(skills)), [number(skill) for skill in skills])
            place.set_xlabel(f"{name}, {_UNITS[name]}", fontsize=9)
            place.set_ylabel("skill", fontsize=9)
            place.set_title(f"preset {preset}", fontsize=9)
    bar = figure.colorbar(image, ax=axes, shrink=0.6)
    bar.set_label(f"{title}: assisted less alone, {unit}", fontsize=9)
    bar.ax.tick_params(labelsize=8)
    return figure


EXPERIMENT = Experiment(name="where_help_hurts", tasks=tasks, cost=cost, report=report)
