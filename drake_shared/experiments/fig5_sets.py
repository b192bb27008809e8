"""Fig. 5 of Amirshirzad et al. 2022: what is added for the second training, and how often it is drawn."""

from __future__ import annotations

from typing import Any

import numpy as np

from drake_shared.analysis.statistics import interval
from drake_shared.analysis.weight_figure import draw_weights_on
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration, Demonstrations, demonstration_weights
from drake_shared.experiments.common import (
    as_demonstrations,
    drives,
    scenario_of,
    train_all,
    training_cost,
)
from drake_shared.experiments.drawing import draw_scene, new_figure
from drake_shared.experiments.paired_trials import groups
from drake_shared.experiments.report import with_interval
from drake_shared.experiments.section import Experiment, Picture, Section, Size, Table
from drake_shared.scenario import Scenario
from drake_shared.simulation.runner import Task

_SEED, _REPEAT_STEP, _ADDED = 1_200_000, 100, 20
"""Seeds: repeat k begins with drives from _SEED + 100 k on and adds drives from 20 after that on, the same
for either set; its learner is trained from seed k."""
_PRESETS = ("paper", "default")
_TOGETHER = {"paper": 10, "default": 5}
_NAMES = {
    "paper": "Setup 1: shared control, preset paper",
    "default": "Setup 1: shared control, preset default",
    "human": "Setup 2: the human alone",
}


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """Some repeats of one preset each."""
    return [
        Task(
            "drake_shared.experiments.fig5_sets:run_repeats",
            {
                "scenario": scenario,
                "preset": preset,
                "repeats": repeats,
            },
        )
        for preset in _PRESETS
        for repeats in groups(size.learners, _TOGETHER[preset])
    ]


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    return 1.2 * len(task.arguments["repeats"]) + training_cost(
        task.arguments["preset"], len(task.arguments["repeats"])
    )


def run_repeats(scenario: str | None, preset: str, repeats: list[int]) -> dict[str, Any]:
    """The first drives, and those that are added with the learner that they taught and without."""
    count = len(scenario_of(scenario).routes)
    seeds = [_SEED + _REPEAT_STEP * repeat for repeat in repeats]
    taught = [as_demonstrations(scenario, drives(scenario, count=count, seed=seed)) for seed in seeds]
    learners = train_all(taught, repeats, preset=preset)
    rows: list[dict[str, Any]] = []
    shown: dict[str, Any] = {}
    missing: list[dict[str, Any]] = []
    for repeat, seed, first, learner in zip(repeats, seeds, taught, learners, strict=True):
        helpers = {preset: learner}
        if preset == "default":
            # What an operator adds alone is the same for both presets: told once.
            helpers["human"] = None
        for name, helper in helpers.items():
            try:
                new = drives(scenario, learner=helper, count=count, seed=seed + _ADDED)
            except RunError as error:
                missing.append({"set": name, "repeat": repeat, "why": str(error)})
                continue
            rows += _rows(name, repeat, first, new)
            shown.setdefault(name, [_plain(item) for item in (*first, *new)])
    return {"rows": rows, "shown": shown, "missing": missing}


def _rows(name: str, repeat: int, first: Demonstrations, new: list[Demonstration]) -> list[dict[str, Any]]:
    weights = demonstration_weights(Demonstrations(items=(*first, *new)))
    return [
        {
            "set": name,
            "repeat": repeat,
            "drive": index,
            "new": index >= len(first),
            "route": item.provenance["route"],
            "score": item.score,
            "probability": float(weights[index]),
        }
        for index, item in enumerate((*first, *new))
    ]


def _plain(item: Demonstration) -> dict[str, Any]:
    return {
        "times": np.round(item.times, 3),
        "positions": np.round(item.positions, 3),
        "score": item.score,
    }


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Fig. 5 with both presets, and the probability that falls on what is new over all repeats."""
    world = scenario_of(scenario)
    rows = [row for result in results for row in result["rows"]]
    # Of each set the first that there is.
    shown = {name: drawn for result in reversed(results) for name, drawn in result["shown"].items()}
    missing = [one for result in results for one in result["missing"]]
    count = len(world.routes)
    return Section(
        title="The second training sets (Fig. 5)",
        text=[
            f"The primary simulated operator drives each of the {count} routes alone, which teaches a "
            "learner, and then again: with that learner (Setup 1) or alone (Setup 2), on the same routes and "
            f"seeds. So either set holds {count} drives known before and {count} new ones. The score is the "
            "least clearance; Pd of Alg. 1, over the scores of all, decides how often each is drawn. A drive "
            "that fails is repeated with another seed, so the new drives of a learner that hinders are its "
            "better ones.",
            f"The figure shows the first of {size.learners} repeats, each from drives and seeds of its own; "
            "the table is over all, with 95% bootstrap intervals over repeats. If scores told nothing, half "
            "of the probability would fall on the new drives.",
            *(f"Repeat {one['repeat']} of {_NAMES[one['set']]} is missing: {one['why']}." for one in missing),
        ],
        pictures=[
            Picture.of(
                _figure(world, {name: shown[name] for name in _NAMES if name in shown}),
                "Left: drives known before (dashed) and new ones (solid), the stronger the likelier they are "
                "drawn. Right: how often each is drawn over its score, with the normal density that says so.",
            )
        ],
        tables=[_table(rows)],
        data={"second_sets": rows},
    )


def _table(rows: list[dict[str, Any]]) -> Table:
    lines = []
    for name, title in _NAMES.items():
        own = [row for row in rows if row["set"] == name]
        repeats = sorted({row["repeat"] for row in own})

        def over(new: bool, measure: str, how: Any, own: Any = own, repeats: Any = repeats) -> str:
            return with_interval(
                interval(
                    [
                        how([row[measure] for row in own if row["repeat"] == repeat and row["new"] == new])
                        for repeat in repeats
                    ]
                )
            )

        lines.append(
            [
                title,
                over(True, "probability", np.sum),
                over(False, "score", np.mean),
                over(True, "score", np.mean),
                over(True, "score", np.max),
            ]
        )
    return Table(
        caption="Probability that a drive drawn for training is a new one, and the scores.",
        head=[
            "set",
            "probability of the new drives",
            "mean score before, m",
            "mean score of the new, m",
            "best score of the new, m",
        ],
        rows=lines,
    )


def _figure(world: Scenario, shown: dict[str, list[dict[str, Any]]]) -> Any:
    figure, axes = new_figure(
        3.6 * len(shown), rows=len(shown), columns=2, squeeze=False, width_ratios=(3, 2)
    )
    for (left, right), (name, drawn) in zip(axes, shown.items(), strict=True):
        items = [
            Demonstration(
                times=np.array(one["times"]), positions=np.array(one["positions"]), score=one["score"]
            )
            for one in drawn
        ]
        draw_scene(left, world)
        draw_weights_on(left, right, Demonstrations(items=tuple(items)), previous=len(items) // 2)
        space = world.workspace
        left.set(xlim=(space.x_min, space.x_max), ylim=(space.y_min, space.y_max))
        left.set_title(_NAMES[name], fontsize=9)
        right.set(xlabel="score, m")
        left.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.25), ncols=2, frameon=False)
    # One range of scores for all, or the rows could not be compared.
    scores = [one["score"] for drawn in shown.values() for one in drawn]
    margin = 0.1 * (max(scores) - min(scores))
    for right in axes[:, 1]:
        right.set_xlim(min(scores) - margin, max(scores) + margin)
    return figure


EXPERIMENT = Experiment(name="second_sets", tasks=tasks, cost=cost, report=report)
