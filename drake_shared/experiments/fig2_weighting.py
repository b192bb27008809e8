"""Fig. 2 of Amirshirzad et al. 2022: the effect of drawing better demonstrations more often.

Each pair of learners has demonstrations of its own, as in `drake_shared.experiments.paired_trials`, so that
intervals contain the variation of demonstrations as well as that of trainings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.statistics import Claim, at_least, interval, judge, larger
from drake_shared.demonstrations import sampling_weights
from drake_shared.experiments.common import scenario_of
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
from drake_shared.experiments.paired_trials import demonstrations_of, groups
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

_GROUP = 5
"""Number of sets of demonstrations in a task, with a plain and a weighted learner each."""
_MODELS = ("plain", "weighted")
_UNITS = "pairs of learners"
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
    """One task for each preset and five pairs of learners."""
    return [
        PlannedTask(
            Task.of(run_pairs, scenario=scenario, preset=preset, learners=learners),
            training_cost(preset, 2 * len(learners)),
        )
        for preset in PRESETS
        for learners in groups(size.of(preset).learners, _GROUP)
    ]


def run_pairs(scenario: str | None, preset: str, learners: list[int]) -> dict[str, Any]:
    """Trains a plain and a weighted learner on each set of demonstrations, and evaluates their predictions.

    Args:
        scenario: File or name.
        preset: Of the learners.
        learners: Indices, which determine demonstrations and trainings; index 0 is drawn.
    """
    sets = demonstrations_of(scenario, learners)
    trained = train_all(
        [one for one in sets for _ in _MODELS],
        [index for index in learners for _ in _MODELS],
        preset=preset,
        weighted=[False, True] * len(sets),
    )
    rows, drawn = [], {}
    for place, (index, demonstrations) in enumerate(zip(learners, sets, strict=True)):
        pair = dict(zip(_MODELS, trained[2 * place : 2 * place + 2], strict=True))
        scores = demonstrations.scores
        assert scores is not None
        found, predicted = _evaluate(scenario_of(scenario), pair, best=int(np.argmax(scores)))
        rows += [{"preset": preset, "learner": index, **row} for row in found]
        if index == 0:
            paths = np.round(pair["plain"].demonstrations, 3)
            drawn = {"predicted": predicted, "ways": paths, "scores": scores}
    return {"rows": rows, "drawn": drawn}


def _evaluate(
    world: Scenario, pair: dict[str, Learner], *, best: int
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The rows of a pair, and the predicted paths with their spread by condition and learner."""
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
    """Fig. 2 for both presets, and distances over all pairs of learners."""
    rows = [row for result in results for row in result["rows"]]
    shown = {result["rows"][0]["preset"]: result["drawn"] for result in results if result["drawn"]}
    scores = np.array(shown[PRESETS[0]]["scores"])
    probabilities = sampling_weights(scores)
    learners = {
        preset: {(row["learner"], row["model"]): row["ignores"] for row in select(rows, preset=preset)}
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
                _figure(scenario_of(scenario), shown, scores, probabilities),
                "Paths predicted by the first pair of learners from one observed point (black cross), with a "
                "band of one standard deviation. Below: the demonstrations, their scores and probabilities "
                "Pd.",
            )
        ],
        tables=[_table(rows)],
        claims=claims(rows),
        data={"weighting": rows},
    )


def _largest(rows: Rows, name: str, **where: Any) -> list[float]:
    """The largest value of a column for each pair of learners, in the order of their indices."""
    found: dict[int, float] = {}
    for row in select(rows, **where):
        if row[name] is not None:
            found[row["learner"]] = max(row[name], found.get(row["learner"], -np.inf))
    return [found[index] for index in sorted(found)]


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
        for point, common in (("the start", True), ("points of one route", False)):
            for model in _MODELS:
                where = {"preset": preset, "common": common, "model": model}
                cells = [with_interval(interval(_largest(rows, name, **where))) for name in _DISTANCES]
                lines.append([preset, point, model, *cells])
    return Table(
        caption="Distances in m, with 95% intervals over pairs of learners; of two points, the larger one. "
        "The average is the mean of the demonstrations with equal weights.",
        head=["preset", "observed point", "learner", *_DISTANCES.values()],
        rows=lines,
    )


def _figure(
    world: Scenario,
    shown: Mapping[str, Any],
    scores: NDArray[np.float64],
    probabilities: NDArray[np.float64],
) -> Any:
    names = list(dict.fromkeys(key.rpartition("/")[0] for key in shown[PRESETS[0]]["predicted"]))
    figure, axes = new_figure(8.2, rows=len(names) + 1, columns=2)
    for column, preset in enumerate(PRESETS):
        for line, name in enumerate(names):
            place = axes[line, column]
            _draw_predictions(place, world, shown[preset], name)
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


def _draw_predictions(place: Any, world: Scenario, shown: Mapping[str, Any], name: str) -> None:
    draw_scene(place, world)
    draw_demonstrations(place, shown["ways"])
    for model in _MODELS:
        drawn = shown["predicted"][f"{name}/{model}"]
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
