"""Fig. 2 of Amirshirzad et al. 2022 with other widths of Pd: from where on is the weighted path free?

All learners have the same demonstrations; training seeds count from 0.
"""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np

from drake_shared.analysis.ambiguity import ambiguity, mean_weights
from drake_shared.analysis.statistics import PERCENT
from drake_shared.demonstrations import Demonstrations, sampling_weights
from drake_shared.experiments.common import (
    TRIAL_COST,
    Teaching,
    demonstrated,
    row_of,
    run_all,
    scenario_of,
)
from drake_shared.experiments.drawing import (
    COLOURS,
    draw_demonstrations,
    draw_interval,
    draw_scene,
    label_lines,
    limit_to_workspace,
    new_figure,
)
from drake_shared.experiments.measures import INTENT_SUCCESS, Measure, estimate, means_table, select
from drake_shared.experiments.paired_trials import groups, route_settings
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size
from drake_shared.experiments.text import number, paragraphs
from drake_shared.experiments.training import PRESETS, stopped_early, train_all, training_cost
from drake_shared.learners import Learner
from drake_shared.scenario import clearance_scorer
from drake_shared.simulation.runner import Task

WIDTHS = ("even", "1 m", "2", "1", "0.5", "0.25")
"""Of the density over the scores: in standard deviations of the scores, or the unit of the scores."""
QUICK_WIDTHS = ("2", "0.25")
SEED, _TRIAL_SEED = 910_000, 915_000
"""Of the demonstrations, and of the trials."""
_GROUP, _TRIALS = 10, 6
# The width is at least 1% of the demonstrations' extent; with scores in mm this has no effect.
_MILLIMETRES = 1_000.0
_FREE = Measure("free", "path free of obstacles", "% of learners", 100.0, limits=PERCENT)
MEASURES = (
    Measure("clearance", "clearance of the path", "m"),
    _FREE,
    Measure("to_best", "distance from the best demonstration", "m"),
    Measure("weight_at_start", "w at the start", limits=(0.0, 1.0)),
    Measure("weight_where_ambiguous", "w where ambiguous", limits=(0.0, 1.0)),
    Measure("weight_where_clear", "w where clear", limits=(0.0, 1.0)),
    INTENT_SUCCESS,
)


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each preset, width and ten training seeds."""
    trials = min(size.trials, _TRIALS)
    return [
        PlannedTask(
            Task.of(run_width, scenario=scenario, preset=preset, width=width, seeds=seeds, trials=trials),
            training_cost(preset, len(seeds)) + len(seeds) * TRIAL_COST * trials,
        )
        for preset in PRESETS
        for width in (WIDTHS if size.all_arms else QUICK_WIDTHS)
        for seeds in groups(min(size.of(preset).learners, _GROUP), _GROUP)
    ]


def run_width(scenario: str | None, preset: str, width: str, seeds: list[int], trials: int) -> dict[str, Any]:
    """Trains a learner from each seed, and evaluates its path from the start and its trials.

    Args:
        scenario: File or name.
        preset: Of the learners.
        width: One of `WIDTHS`.
        seeds: Of the trainings.
        trials: Number of trials of the primary operator with each learner.
    """
    (demonstrations,) = demonstrated(scenario, [Teaching(seed=SEED)])
    deviations, scaled = scores_and_width(demonstrations, width)
    learners = train_all(
        [scaled] * len(seeds), seeds, preset=preset, weighted=width != "even", score_width=deviations
    )
    settings = [
        route_settings(scenario, "primary", trial, seed=_TRIAL_SEED + trial) for trial in range(trials)
    ]
    driven = run_all(scenario, [one for one in learners for _ in range(trials)], settings * len(seeds))
    rows, drawn = [], []
    for seed, learner in zip(seeds, learners, strict=True):
        own = list(itertools.islice(driven, trials))
        path, values = _from_start(scenario, learner)
        drawn.append(np.round(path, 3))
        parts = [ambiguity(one, learner.grid, learner.demonstrations) for one in own]
        succeeded = [row_of(one)["intent_success"] for one in own]
        rows.append(
            {
                "preset": preset,
                "width": width,
                "learner": seed,
                **values,
                **mean_weights(parts),
                "weight_at_start": float(np.mean([one["human_weight"][0] for one in own])),
                "intent_success": float(np.mean(succeeded)),
                "stopped_early": stopped_early(learner),
                "probability": float(np.max(learner.weights)),
            }
        )
    return {"rows": rows, "paths": drawn, "routes": np.round(learners[0].demonstrations, 3)}


def scores_and_width(demonstrations: Demonstrations, width: str) -> tuple[float, Demonstrations]:
    """The width in standard deviations of the scores, and the demonstrations with scores in mm."""
    scores = demonstrations.scores
    assert scores is not None
    items = tuple(
        dataclasses.replace(item, score=_MILLIMETRES * score)
        for item, score in zip(demonstrations, scores, strict=True)
    )
    if width == "even":
        deviations = 1.0
    elif width.endswith(" m"):
        deviations = float(width.removesuffix(" m")) / float(np.std(scores))
    else:
        deviations = float(width)
    return deviations, dataclasses.replace(demonstrations, items=items)


def _from_start(scenario: str | None, learner: Learner) -> tuple[Any, dict[str, Any]]:
    """The path predicted from the start until the goal is reached, and its clearance."""
    world = scenario_of(scenario)
    paths, grid = learner.demonstrations, learner.grid
    assert paths is not None
    at_goal = np.hypot(*(paths - (world.goal.x, world.goal.y)).T) <= world.goal.radius
    moving = slice(0, int(at_goal.argmax(axis=0).max()) + 1)
    mean, _ = learner.predict(grid[:1], paths[:, 0].mean(axis=0)[None], grid)
    scores = [clearance_scorer(world)(path) for path in paths]
    best = paths[int(np.argmax(scores))]
    clearance = clearance_scorer(world)(mean[moving])
    return mean[moving], {
        "clearance": clearance,
        "free": clearance > 0.0,
        "to_best": float(np.linalg.norm(mean - best, axis=1)[moving].mean()),
    }


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """The paths by width, and what they cost in human weight and intent success."""
    rows = [row for result in results for row in result["rows"]]
    widths = list(dict.fromkeys(row["width"] for row in rows))
    first_free = {
        preset: next(
            (width for width in widths if estimate(rows, _FREE, preset=preset, width=width).mean == 100.0),
            None,
        )
        for preset in PRESETS
    }
    (demonstrations,) = demonstrated(scenario, [Teaching(seed=SEED)])
    return Section(
        title="The width of Pd (Fig. 2)",
        text=paragraphs(
            "weighting_width",
            trials=min(size.trials, _TRIALS),
            learners={preset: len(select(rows, preset=preset, width=widths[0])) for preset in PRESETS},
            first_free=first_free,
            probabilities={width: _probabilities(demonstrations, width) for width in widths},
        ),
        pictures=[
            Picture.of(
                _paths(scenario, results, widths),
                "The paths that the learners predict from the start, one line for each training seed, by the "
                "width of Pd in standard deviations of the scores; the demonstrations are dotted.",
            ),
            Picture.of(
                _costs(rows, widths),
                "By width: clearance of the path from the start, the human weight, and intent success in "
                "trials whose routes take turns. Means over training seeds with 95% intervals.",
            ),
        ],
        tables=[
            means_table(
                rows,
                MEASURES,
                [
                    ([preset, width], {"preset": preset, "width": width})
                    for preset in PRESETS
                    for width in widths
                ],
                head=["preset", "width"],
                caption="Means and 95% intervals over training seeds.",
            )
        ],
        data={"weighting_width": rows},
    )


def _probabilities(demonstrations: Demonstrations, width: str) -> str:
    deviations, scaled = scores_and_width(demonstrations, width)
    assert scaled.scores is not None
    found = (
        np.full(len(scaled), 1.0 / len(scaled))
        if width == "even"
        else sampling_weights(scaled.scores, deviations * float(np.std(scaled.scores)))
    )
    return ", ".join(number(round(float(one), 4)) for one in found)


def _paths(scenario: str | None, results: list[Any], widths: list[str]) -> Any:
    world = scenario_of(scenario)
    figure, axes = new_figure(1.35 * len(widths), rows=len(widths), columns=2, sharex=True, sharey=True)
    for result in results:
        preset, width = result["rows"][0]["preset"], result["rows"][0]["width"]
        place = axes[widths.index(width), PRESETS.index(preset)]
        draw_scene(place, world)
        draw_demonstrations(place, result["routes"])
        for path in result["paths"]:
            place.plot(*np.array(path).T, color=COLOURS["weighted"], linewidth=1.0, alpha=0.7)
        limit_to_workspace(place, world)
        place.set_title(f"{preset}: width {width}", fontsize=9)
        place.label_outer()
    return figure


def _costs(rows: Rows, widths: list[str]) -> Any:
    measures = [measure for measure in MEASURES if measure.name not in ("free", "to_best", "weight_at_start")]
    figure, axes = new_figure(2.8, columns=len(measures), sharey=True)
    label_lines(axes[0], widths)
    axes[0].set_ylabel("width of Pd", fontsize=9)
    for place, measure in zip(axes, measures, strict=True):
        for offset, preset in zip((-0.12, 0.12), PRESETS, strict=True):
            for height, width in enumerate(widths):
                found = estimate(rows, measure, preset=preset, width=width)
                label = f"preset {preset}" if height == 0 else "_"
                draw_interval(
                    place, height + offset, found, COLOURS[preset], marker="o", markersize=3, label=label
                )
        place.set_xlabel(measure.label, fontsize=8)
    axes[0].axvline(0.0, color="0.6", linewidth=0.8)
    axes[0].legend(fontsize=7, frameon=False)
    return figure


EXPERIMENT = Experiment(name="weighting_width", plan=plan, report=report)
