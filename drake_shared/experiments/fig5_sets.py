"""Fig. 5 of Amirshirzad et al. 2022: the second training sets, and how often each demonstration is drawn.

Seeds: repeat k starts with demonstrations with seeds from 1 200 000 + 100 k on and adds demonstrations with
seeds from 20 after that on, the same for both sets; its learner is trained from seed k.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import interval
from drake_shared.analysis.weight_figure import draw_weights_on
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration, Demonstrations, sampling_weights
from drake_shared.experiments.common import (
    Teaching,
    demonstrate,
    demonstrated,
    route_count,
    scenario_of,
)
from drake_shared.experiments.drawing import draw_scene, limit_to_workspace, new_figure
from drake_shared.experiments.measures import select
from drake_shared.experiments.paired_trials import groups
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size, Table
from drake_shared.experiments.text import paragraphs, with_interval
from drake_shared.experiments.training import PRESETS, train_all, training_cost
from drake_shared.scenario import Scenario
from drake_shared.simulation.runner import Task

_SEED, _STRIDE, _ADDED = 1_200_000, 100, 20
_GROUP = {"paper": 10, "default": 5}
_NAMES = {
    "paper": "Setup 1: shared control, preset paper",
    "default": "Setup 1: shared control, preset default",
    "human": "Setup 2: the human alone",
}


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each preset and a group of repeats."""
    return [
        PlannedTask(
            Task.of(run_repeats, scenario=scenario, preset=preset, repeats=repeats),
            0.4 * len(repeats) + training_cost(preset, len(repeats)),
        )
        for preset in PRESETS
        for repeats in groups(size.of(preset).learners, _GROUP[preset])
    ]


def run_repeats(scenario: str | None, preset: str, repeats: list[int]) -> dict[str, Any]:
    """Makes the first demonstrations, and those added in shared control and by the human alone."""
    seeds = [_SEED + _STRIDE * repeat for repeat in repeats]
    first = demonstrated(scenario, [Teaching(seed=seed) for seed in seeds])
    # The demonstrations of the human alone are the same for both presets: one task makes them.
    partners: dict[str, list[Any]] = {preset: train_all(first, repeats, preset=preset)}
    if preset == "default":
        partners["human"] = [None] * len(repeats)
    rows: list[dict[str, Any]] = []
    shown: dict[str, Any] = {}
    missing: list[dict[str, Any]] = []
    for name, learners in partners.items():
        added = demonstrate(
            scenario,
            [
                Teaching(seed=seed + _ADDED, learner=learner)
                for seed, learner in zip(seeds, learners, strict=True)
            ],
        )
        for repeat, known, new in zip(repeats, first, added, strict=True):
            if isinstance(new, RunError):
                missing.append({"set": name, "repeat": repeat, "why": str(new)})
                continue
            rows += _rows(name, repeat, known, new)
            shown.setdefault(name, [_as_json(item) for item in (*known, *new)])
    return {"rows": rows, "shown": shown, "missing": missing}


def _rows(name: str, repeat: int, known: Demonstrations, new: list[Demonstration]) -> list[dict[str, Any]]:
    items = (*known, *new)
    return [
        {
            "set": name,
            "repeat": repeat,
            "drive": index,
            "new": index >= len(known),
            "route": item.provenance["route"],
            "score": item.score,
            "probability": float(probability),
        }
        for index, (item, probability) in enumerate(
            zip(items, sampling_weights([item.score for item in items]), strict=True)
        )
    ]


def _as_json(item: Demonstration) -> dict[str, Any]:
    return {
        "times": np.round(item.times, 3),
        "positions": np.round(item.positions, 3),
        "score": item.score,
    }


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Fig. 5 for both presets, and the probability of new demonstrations over all repeats."""
    rows = [row for result in results for row in result["rows"]]
    # The first repeat of each set.
    shown = {name: drawn for result in reversed(results) for name, drawn in result["shown"].items()}
    missing = [one for result in results for one in result["missing"]]
    return Section(
        title="The second training sets (Fig. 5)",
        text=paragraphs(
            "second_sets",
            repeats={name: len({row["repeat"] for row in select(rows, set=name)}) for name in _NAMES},
            routes=route_count(scenario),
            missing=missing,
            names=_NAMES,
        ),
        pictures=[
            Picture.of(
                _figure(scenario_of(scenario), {name: shown[name] for name in _NAMES if name in shown}),
                "Left: known demonstrations (dashed) and new ones (solid), in stronger colours the more "
                "often they are drawn. Right: the probability of each by its score, and the normal density "
                "from which it follows.",
            )
        ],
        tables=[_table(rows)],
        data={"second_sets": rows},
    )


def _table(rows: Rows) -> Table:
    columns: Mapping[str, tuple[bool, str, Callable[[Any], Any]]] = {
        "probability of the new ones": (True, "probability", np.sum),
        "mean score of the known ones, m": (False, "score", np.mean),
        "mean score of the new ones, m": (True, "score", np.mean),
        "best score of the new ones, m": (True, "score", np.max),
    }
    lines = []
    for name, title in _NAMES.items():
        own = select(rows, set=name)
        cells = []
        for new, column, statistic in columns.values():
            repeats = sorted({row["repeat"] for row in own})
            values = [
                statistic([row[column] for row in select(own, repeat=repeat, new=new)]) for repeat in repeats
            ]
            cells.append(with_interval(interval(values)))
        lines.append([title, *cells])
    return Table(
        caption="The probability that a demonstration drawn for training is a new one, and the scores.",
        head=["set", *columns],
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
        limit_to_workspace(left, world)
        left.set_title(_NAMES[name], fontsize=9)
        right.set(xlabel="score, m")
        left.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.25), ncols=2, frameon=False)
    # The same range of scores in all rows.
    scores = [one["score"] for drawn in shown.values() for one in drawn]
    margin = 0.1 * (max(scores) - min(scores))
    for right in axes[:, 1]:
        right.set_xlim(min(scores) - margin, max(scores) + margin)
    return figure


EXPERIMENT = Experiment(name="second_sets", plan=plan, report=report)
