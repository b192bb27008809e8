"""Fig. 2 of Amirshirzad et al. 2022: the effect of drawing better demonstrations more often."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.statistics import Claim, at_least, interval, judge, larger
from drake_shared.demonstrations import sampling_weights
from drake_shared.experiments.common import Teaching, demonstrated, scenario_of
from drake_shared.experiments.drawing import (
    COLOURS,
    ROUTES,
    draw_band,
    draw_demonstrations,
    draw_scene,
    legend_below,
    limit_to_workspace,
    new_figure,
)
from drake_shared.experiments.measures import select
from drake_shared.experiments.paired_trials import groups
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size, Table
from drake_shared.experiments.text import paragraphs, with_interval
from drake_shared.experiments.training import (
    PRESETS,
    ignores_observations,
    stopped_early,
    train_all,
    training_cost,
)
from drake_shared.learners import Learner
from drake_shared.scenario import Scenario
from drake_shared.simulation.runner import Task

SEED = 910_000
"""Of the demonstrations, which are the same for all learners; training seeds count from 0."""
_GROUP = 5
"""Number of training seeds in a task, with a plain and a weighted learner each."""
_MODELS = ("plain", "weighted")
_UNITS = "training seeds"
_CLOSER, _PASSED, _ON_ROUTE = 0.02, 0.05, 0.1
"""In [m]: smallest effect of interest, and tolerances for passing a point and for being on a route."""
_DISTANCES = {
    "to_best": "to the best demonstration",
    "to_average": "to the average",
    "to_route": "to the route of the point",
    "missed": "from the point",
    "plain_to_weighted": "plain to weighted",
}
"""Columns of the rows and of the table."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Condition:
    """A point that a path must pass.

    Attributes:
        name: In figures and tables.
        step: Index on the grid of the time at which it must be passed.
        route: Index of the only demonstration that passes it; None if all do.
    """

    name: str
    step: int
    route: int | None = None


def conditions(paths: NDArray[np.float64]) -> list[Condition]:
    """The start, and one point of each of the two demonstrations that are farthest from the others.

    Args:
        paths: Shape (m, N, 2), the demonstrations on a grid, in [m]; m >= 2.
    """
    gaps = np.linalg.norm(paths[:, None] - paths[None], axis=-1)
    gaps[np.arange(len(paths)), np.arange(len(paths))] = np.inf
    separation = gaps.min(axis=1)
    farthest = np.argsort(-separation.max(axis=1), kind="stable")[:2]
    return [
        Condition(name="the start", step=0),
        *(
            Condition(
                name=f"a point of route {route + 1} alone",
                step=int(separation[route].argmax()),
                route=int(route),
            )
            for route in sorted(farthest)
        ),
    ]


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each preset and five training seeds."""
    return [
        PlannedTask(
            Task.of(run_seeds, scenario=scenario, preset=preset, seeds=seeds),
            training_cost(preset, 2 * len(seeds)),
        )
        for preset in PRESETS
        for seeds in groups(size.of(preset).learners, _GROUP)
    ]


def run_seeds(scenario: str | None, preset: str, seeds: list[int]) -> dict[str, Any]:
    """Trains a plain and a weighted learner from each seed, and evaluates their predictions."""
    world = scenario_of(scenario)
    (demonstrations,) = demonstrated(scenario, [Teaching(seed=SEED)])
    weighted = [False, True] * len(seeds)
    learners = train_all(
        [demonstrations] * len(weighted), np.repeat(seeds, 2).tolist(), preset=preset, weighted=weighted
    )
    scores = demonstrations.scores
    assert scores is not None
    rows, drawn = [], {}
    for index, seed in enumerate(seeds):
        pair = dict(zip(_MODELS, learners[2 * index : 2 * index + 2], strict=True))
        found, predicted = _evaluate(world, pair, best=int(np.argmax(scores)))
        rows += [{"preset": preset, "seed": seed, **row} for row in found]
        if seed == 0:
            drawn = predicted
    paths = np.round(learners[0].demonstrations, 3)
    return {"rows": rows, "drawn": drawn, "ways": paths, "scores": scores}


def _evaluate(
    world: Scenario, pair: dict[str, Learner], *, best: int
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The rows of a seed, and the predicted paths with their spread by condition and learner."""
    paths, grid = pair["plain"].demonstrations, pair["plain"].grid
    assert paths is not None
    # Once all demonstrations are at the goal their paths no longer differ.
    at_goal = np.hypot(*(paths - (world.goal.x, world.goal.y)).T) <= world.goal.radius
    moving = slice(0, int(at_goal.argmax(axis=0).max()) + 1)

    def distance(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(one - other, axis=1)[moving].mean())

    rows, predicted = [], {}
    for condition in conditions(paths):
        step, route = condition.step, condition.route
        point = paths[:, step].mean(axis=0) if route is None else paths[route, step]
        means = {}
        for name, learner in pair.items():
            means[name], variance = learner.predict(grid[[step]], np.array([point]), grid)
            predicted[f"{condition.name}/{name}"] = {
                "point": np.round(point, 4),
                "mean": np.round(means[name][moving], 4),
                "sigma": np.round(np.sqrt(variance[moving]), 4),
            }
        for name, mean in means.items():
            rows.append(
                {
                    "condition": condition.name,
                    "common": route is None,
                    "model": name,
                    "to_best": distance(mean, paths[best]),
                    "to_average": distance(mean, paths.mean(axis=0)),
                    "to_route": None if route is None else distance(mean, paths[route]),
                    "missed": float(np.linalg.norm(mean[step] - point)),
                    "plain_to_weighted": distance(means["plain"], means["weighted"]),
                    "ignores": ignores_observations(pair[name]),
                    "stopped_early": stopped_early(pair[name]),
                }
            )
    return rows, predicted


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Fig. 2 for both presets, and distances over all seeds."""
    rows = [row for result in results for row in result["rows"]]
    scores = np.array(results[0]["scores"])
    probabilities = sampling_weights(scores)
    learners = {
        preset: {(row["seed"], row["model"]): row["ignores"] for row in select(rows, preset=preset)}
        for preset in PRESETS
    }
    return Section(
        title="Weighted demonstrations (Fig. 2)",
        text=paragraphs(
            "weighting",
            size=size,
            scores=[f"{score:.3f}" for score in scores],
            best=int(scores.argmax()),
            probability=probabilities.max(),
            largest=sampling_weights([1.0] + [0.0] * (len(scores) - 1))[0],
            ignoring={preset: (sum(found.values()), len(found)) for preset, found in learners.items()},
        ),
        pictures=[
            Picture.of(
                _figure(scenario_of(scenario), results, scores, probabilities),
                "Paths predicted by the learners of seed 0 from one observed point (black cross), with a "
                "band of one standard deviation. Below: the demonstrations, their scores and probabilities "
                "Pd.",
            )
        ],
        tables=[_table(rows)],
        claims=claims(rows),
        data={"weighting": rows},
    )


def _largest(rows: Rows, name: str, **where: Any) -> list[float]:
    """The largest value of a column for each seed, in the order of seeds."""
    found: dict[int, float] = {}
    for row in select(rows, **where):
        if row[name] is not None:
            found[row["seed"]] = max(row[name], found.get(row["seed"], -np.inf))
    return [found[seed] for seed in sorted(found)]


def claims(rows: Rows) -> list[Claim]:
    """Weighting moves the path towards the best demonstration, and paths pass the observed points."""
    closer = [
        larger(
            f"At the start the weighted path is closer to the best demonstration than the plain "
            f"one ({preset})",
            _largest(rows, "to_best", preset=preset, common=True, model="plain"),
            _largest(rows, "to_best", preset=preset, common=True, model="weighted"),
            smallest=_CLOSER,
            unit="m",
            units=_UNITS,
        )
        for preset in PRESETS
    ]
    passed = [
        at_least(
            f"Both paths pass within {_PASSED} m of each of the three points: {_PASSED} m minus the largest "
            f"distance ({preset})",
            _PASSED - np.array(_largest(rows, "missed", preset=preset)),
            least=0.0,
            unit="m",
            units=_UNITS,
        )
        for preset in PRESETS
    ]
    on_route = [
        at_least(
            f"Through a point of one route both paths stay within {_ON_ROUTE} m of that route: {_ON_ROUTE} m "
            f"minus the larger distance ({preset})",
            _ON_ROUTE - np.array(_largest(rows, "to_route", preset=preset, common=False)),
            least=0.0,
            unit="m",
            units=_UNITS,
        )
        for preset in PRESETS
    ]
    return judge("weighting", closer + passed + on_route)


def _table(rows: Rows) -> Table:
    lines = []
    for preset in PRESETS:
        for condition in dict.fromkeys(row["condition"] for row in rows):
            for model in _MODELS:
                where = {"preset": preset, "condition": condition, "model": model}
                cells = [with_interval(interval(_largest(rows, name, **where))) for name in _DISTANCES]
                lines.append([preset, condition, model, *cells])
    return Table(
        caption="Distances in m, with 95% intervals over training seeds. The average is the mean "
        "of the demonstrations with equal weights.",
        head=["preset", "observed point", "learner", *_DISTANCES.values()],
        rows=lines,
    )


def _figure(
    world: Scenario, results: list[Any], scores: NDArray[np.float64], probabilities: NDArray[np.float64]
) -> Any:
    shown = {
        preset: next(
            result for result in results if result["drawn"] and result["rows"][0]["preset"] == preset
        )
        for preset in PRESETS
    }
    names = list(dict.fromkeys(key.rpartition("/")[0] for key in shown[PRESETS[0]]["drawn"]))
    figure, axes = new_figure(8.2, rows=len(names) + 1, columns=2)
    for column, (preset, result) in enumerate(shown.items()):
        for line, name in enumerate(names):
            place = axes[line, column]
            _draw_predictions(place, world, result, name)
            place.set_title(f"{preset}: observed {name}", fontsize=9)
            place.set(xlabel="", ylabel="" if column else "y, m")
    paths = np.array(shown[PRESETS[0]]["ways"])
    colours = [ROUTES[index % len(ROUTES)] for index in range(len(paths))]
    scene, bars = axes[-1]
    draw_scene(scene, world)
    for path, colour in zip(paths, colours, strict=True):
        scene.plot(*path.T, color=colour, linewidth=1.3)
    limit_to_workspace(scene, world)
    scene.set_title("the demonstrations", fontsize=9)
    _draw_probabilities(bars, scores, probabilities, colours)
    legend_below(figure, *axes[0, 0].get_legend_handles_labels(), columns=3)
    return figure


def _draw_predictions(place: Any, world: Scenario, result: dict[str, Any], name: str) -> None:
    draw_scene(place, world)
    draw_demonstrations(place, result["ways"])
    for model in _MODELS:
        drawn = result["drawn"][f"{name}/{model}"]
        style: dict[str, Any] = {"linestyle": "--"} if model == "weighted" else {"linewidth": 2.5}
        mean, sigma = np.array(drawn["mean"]), np.array(drawn["sigma"])
        draw_band(place, mean, sigma, COLOURS[model], model, **style)
    place.plot(*drawn["point"], marker="x", color="black", markersize=7, zorder=5)
    limit_to_workspace(place, world)


def _draw_probabilities(
    place: Any,
    scores: NDArray[np.float64],
    probabilities: NDArray[np.float64],
    colours: Sequence[str],
) -> None:
    count = len(scores)
    place.bar(range(1, count + 1), probabilities, color=colours, width=0.6)
    place.axhline(1 / count, color=COLOURS["plain"], linestyle="--", linewidth=1.2)
    place.annotate("plain", (count + 0.4, 1 / count), va="bottom", ha="right", fontsize=8, color="0.3")
    for index, (score, probability) in enumerate(zip(scores, probabilities, strict=True)):
        text = f"score\n{score:.3f} m"
        place.annotate(text, (index + 1, 0.1 * probability), ha="center", fontsize=8, color="white")
    place.set(
        xlabel="demonstration of route",
        ylabel="probability Pd",
        xticks=range(1, count + 1),
        xlim=(0.5, count + 0.5),
    )


EXPERIMENT = Experiment(name="weighting", plan=plan, report=report)
