"""Fig. 2 of Amirshirzad et al. 2022: what it changes that better demonstrations are drawn more often."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import Claim, Estimate, claim, interval, paired_claims
from drake_shared.demonstrations import sampling_weights
from drake_shared.experiments.common import (
    as_demonstrations,
    drives,
    scenario_of,
    train_all,
    training_cost,
)
from drake_shared.experiments.drawing import COLOURS, ROUTES, draw_band, draw_scene, legend_below, new_figure
from drake_shared.experiments.paired_trials import groups
from drake_shared.experiments.report import with_interval
from drake_shared.experiments.section import Experiment, Picture, Section, Size, Table
from drake_shared.learners import Learner
from drake_shared.scenario import Scenario
from drake_shared.simulation.runner import Task

_SEED = 910_000
"""Of the demonstrations, which are the same for all; training seeds are counted from 0."""
_PRESETS = ("paper", "default")
_TOGETHER = 5
"""So many seeds are trained side by side, plain and weighted each."""
_NEARER, _MET, _ON_ROUTE = 0.02, 0.05, 0.1
"""In [m]: the smallest effect of interest, and what counts as meeting a condition and as on a route."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Condition:
    """A point that a path must pass.

    Attributes:
        name: As figures and tables call it.
        step: Of the grid at which it is to be passed.
        route: Index of the one demonstration that passes it; None if all do.
    """

    name: str
    step: int
    route: int | None = None


def conditions(ways: np.ndarray) -> list[Condition]:
    """A point of all demonstrations, and one of each of the two that keep furthest from the others.

    Args:
        ways: Shape (m, N, 2), the demonstrations on a grid, in [m]; m >= 2.
    """
    gaps = np.linalg.norm(ways[:, None] - ways[None], axis=-1)
    gaps[np.arange(len(ways)), np.arange(len(ways))] = np.inf
    alone = gaps.min(axis=1)
    furthest = np.argsort(-alone.max(axis=1), kind="stable")[:2]
    return [
        Condition(name="the start", step=0),
        *(
            Condition(name=f"a point of route {way + 1} alone", step=int(alone[way].argmax()), route=int(way))
            for way in sorted(furthest)
        ),
    ]


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """Some training seeds of one preset each."""
    return [
        Task(
            "drake_shared.experiments.fig2_weighting:run_seeds",
            {
                "scenario": scenario,
                "preset": preset,
                "seeds": seeds,
            },
        )
        for preset in _PRESETS
        for seeds in groups(size.learners, _TOGETHER)
    ]


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    return training_cost(task.arguments["preset"], 2 * len(task.arguments["seeds"]))


def run_seeds(scenario: str | None, preset: str, seeds: list[int]) -> dict[str, Any]:
    """From each seed a plain and a weighted learner of the same demonstrations, and what they expect."""
    world = scenario_of(scenario)
    taught = as_demonstrations(scenario, drives(scenario, count=len(world.routes), seed=_SEED))
    leaning = [False, True] * len(seeds)
    learners = train_all(
        [taught] * len(leaning), np.repeat(seeds, 2).tolist(), preset=preset, weighted=leaning
    )
    scores = taught.scores
    assert scores is not None
    rows, drawn = [], {}
    for index, seed in enumerate(seeds):
        pair = {"plain": learners[2 * index], "weighted": learners[2 * index + 1]}
        found, expected = _measure(world, pair, best=int(np.argmax(scores)))
        rows += [{"preset": preset, "seed": seed, **row} for row in found]
        if seed == 0:
            drawn = expected
    ways = np.round(learners[0].demonstrations, 3)
    return {"rows": rows, "drawn": drawn, "ways": ways, "scores": scores}


def _measure(
    world: Scenario, pair: dict[str, Learner], *, best: int
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Rows of one seed, and the expected paths with their spread by condition and learner."""
    ways = pair["plain"].demonstrations
    assert ways is not None
    grid = pair["plain"].grid
    # Where all stand at the goal there is nothing to tell.
    there = np.hypot(*(ways - (world.goal.x, world.goal.y)).T) <= world.goal.radius
    under_way = slice(0, int(there.argmax(axis=0).max()) + 1)

    def apart(one: np.ndarray, other: np.ndarray) -> float:
        return float(np.linalg.norm(one - other, axis=1)[under_way].mean())

    rows, expected = [], {}
    for condition in conditions(ways):
        step, route = condition.step, condition.route
        point = ways[:, step].mean(axis=0) if route is None else ways[route, step]
        means = {}
        for name, learner in pair.items():
            means[name], variance = learner.predict(grid[[step]], np.array([point]), grid)
            expected[f"{condition.name}/{name}"] = {
                "point": np.round(point, 4),
                "mean": np.round(means[name][under_way], 4),
                "sigma": np.round(np.sqrt(variance[under_way]), 4),
            }
        for name, mean in means.items():
            rows.append(
                {
                    "condition": condition.name,
                    "common": route is None,
                    "model": name,
                    "to_best": apart(mean, ways[best]),
                    "to_average": apart(mean, ways.mean(axis=0)),
                    "to_route": None if route is None else apart(mean, ways[route]),
                    "missed": float(np.linalg.norm(mean[step] - point)),
                    "plain_to_weighted": apart(means["plain"], means["weighted"]),
                    "ignores": bool(pair[name].metadata["training"]["ignores_observations"]),
                }
            )
    return rows, expected


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Fig. 2 for both presets, and what lies behind it over all seeds."""
    world = scenario_of(scenario)
    rows = [row for result in results for row in result["rows"]]
    scores = np.array(results[0]["scores"])
    drawn_share = sampling_weights(scores)
    best = int(scores.argmax())
    most = sampling_weights([1.0] + [0.0] * (len(scores) - 1))[0]
    return Section(
        title="Weighted demonstrations (Fig. 2)",
        text=[
            f"A simulated operator drove each of the {len(scores)} routes alone once; the score is the least "
            f"clearance. Learners of the same drives were trained from {size.learners} seeds (0 to "
            f"{size.learners - 1}) with each preset: plain, where all drives are drawn alike, and weighted, "
            "where Pd of Alg. 1 decides. They are asked for the whole path through one point: the start, "
            "which tells nothing of the route, and two points at which only one route is.",
            f"The scores are {', '.join(f'{score:.3f}' for score in scores)} m, so the weighted learners "
            f"draw the best drive, of route {best + 1}, with probability {drawn_share[best]:.2f} in place of "
            f"{1 / len(scores):.2f}. More than {most:.2f} is never possible with {len(scores)} drives, "
            "whatever the scores, since the width of Pd is twice their standard deviation: a weighted "
            "average can lean to the best way, but not become it.",
            _ignoring(rows),
            "Distances are means over the time under way between points at equal times. Intervals are 95% "
            "bootstrap intervals over the training seeds; those of claims are adjusted. They say what "
            "training does to these drives, not what other drives would do.",
        ],
        pictures=[
            Picture.of(
                _figure(world, results, scores, drawn_share),
                "Paths expected by the learners of seed 0 that were shown one point (black cross), with a "
                "band of one standard deviation. Below: the drives, with scores and the probabilities Pd.",
            )
        ],
        tables=[_table(rows)],
        claims=_claims(rows),
        data={"weighting": rows},
    )


def _ignoring(rows: list[dict[str, Any]]) -> str:
    """How many learners do not answer to what they are shown."""
    counts = []
    for preset in _PRESETS:
        learners = {(row["seed"], row["model"]): row["ignores"] for row in rows if row["preset"] == preset}
        counts.append(f"{sum(learners.values())} of {len(learners)} with preset {preset}")
    return (
        f"Learners that expect the same whatever they are shown: {' and '.join(counts)}. Such a learner "
        "meets no condition but by chance; preset paper takes Alg. 1 by the letter, one point of one drive "
        "in each step, while preset default finds such learners and begins them anew."
    )


def _values(
    rows: Iterable[dict[str, Any]],
    name: str,
    **wanted: Any,
) -> list[float]:
    """Of each seed the largest value of a measure over the rows wanted, in the order of seeds."""
    found: dict[int, float] = {}
    for row in rows:
        if row[name] is not None and all(row[key] == value for key, value in wanted.items()):
            found[row["seed"]] = max(row[name], found.get(row["seed"], -np.inf))
    return [found[seed] for seed in sorted(found)]


def _claims(rows: list[dict[str, Any]]) -> list[Claim]:
    nearer = paired_claims(
        [
            {
                "text": f"At the start the weighted path is nearer to the best drive than the plain one "
                f"({preset})",
                "one": _values(rows, "to_best", preset=preset, common=True, model="plain"),
                "other": _values(rows, "to_best", preset=preset, common=True, model="weighted"),
                "smallest": _NEARER,
                "unit": "m",
            }
            for preset in _PRESETS
        ]
    )
    met = [
        claim(
            f"Both paths pass within {_MET} m of each of the three points: what is left of {_MET} m at the "
            f"worst ({preset})",
            _MET - np.array(_values(rows, "missed", preset=preset)),
            smallest=0.0,
            unit="m",
        )
        for preset in _PRESETS
    ]
    on_route = [
        claim(
            f"Through a point of one route both paths lie within {_ON_ROUTE} m of that route: what is left "
            f"of {_ON_ROUTE} m at the worse point ({preset})",
            _ON_ROUTE - np.array(_values(rows, "to_route", preset=preset, common=False)),
            smallest=0.0,
            unit="m",
        )
        for preset in _PRESETS
    ]
    return nearer + met + on_route


def _table(rows: list[dict[str, Any]]) -> Table:
    lines = []
    for preset in _PRESETS:
        for condition in dict.fromkeys(row["condition"] for row in rows):
            for model in ("plain", "weighted"):
                chosen = {"preset": preset, "condition": condition, "model": model}
                measures = ("to_best", "to_average", "to_route", "missed", "plain_to_weighted")
                cells = [_cell(interval(_values(rows, name, **chosen))) for name in measures]
                lines.append([preset, condition, model, *cells])
    return Table(
        caption="Distances in m, with 95% bootstrap intervals over training seeds; the average is that of "
        "the drives, each counted alike.",
        head=[
            "preset",
            "point shown",
            "learner",
            "to the best drive",
            "to the average",
            "to the route of the point",
            "past the point",
            "plain to weighted",
        ],
        rows=lines,
    )


def _cell(estimate: Estimate) -> str:
    if not estimate.count:
        return "–"
    return with_interval(estimate)


def _figure(world: Scenario, results: list[Any], scores: np.ndarray, shares: np.ndarray) -> Any:
    shown = [next(r for r in results if r["drawn"] and r["rows"][0]["preset"] == p) for p in _PRESETS]
    names = list(dict.fromkeys(key.rpartition("/")[0] for key in shown[0]["drawn"]))
    figure, axes = new_figure(8.2, rows=len(names) + 1, columns=2)
    for column, (preset, result) in enumerate(zip(_PRESETS, shown, strict=True)):
        for line, name in enumerate(names):
            place = axes[line, column]
            _scene(place, world, result["ways"])
            for model in ("plain", "weighted"):
                drawn = result["drawn"][f"{name}/{model}"]
                style = {"linestyle": "--"} if model == "weighted" else {"linewidth": 2.5}
                draw_band(
                    place, np.array(drawn["mean"]), np.array(drawn["sigma"]), COLOURS[model], model, **style
                )
            place.plot(*drawn["point"], marker="x", color="black", markersize=7, zorder=5)
            place.set_title(f"{preset}: shown {name}", fontsize=9)
    ways = np.array(shown[0]["ways"])
    place = axes[-1, 0]
    draw_scene(place, world)
    for index, way in enumerate(ways):
        place.plot(*way.T, color=ROUTES[index % len(ROUTES)], linewidth=1.3)
    place.set_title("the scene and the drives", fontsize=9)
    for one in (*axes[:-1].flat, place):
        space = world.workspace
        one.set(xlim=(space.x_min, space.x_max), ylim=(space.y_min, space.y_max))
    for one in axes[:-1].flat:
        one.set_xlabel("")
    for one in axes[:-1, 1]:
        one.set_ylabel("")
    place = axes[-1, 1]
    colours = [ROUTES[index % len(ROUTES)] for index in range(len(ways))]
    place.bar(range(1, len(ways) + 1), shares, color=colours, width=0.6)
    place.axhline(1 / len(ways), color=COLOURS["plain"], linestyle="--", linewidth=1.2)
    place.annotate(
        "plain", (len(ways) + 0.4, 1 / len(ways)), va="bottom", ha="right", fontsize=8, color="0.3"
    )
    for index, (score, share) in enumerate(zip(scores, shares, strict=True)):
        place.annotate(
            f"score\n{score:.3f} m", (index + 1, 0.1 * share), ha="center", fontsize=8, color="white"
        )
    place.set(
        xlabel="drive of route",
        ylabel="drawn with probability",
        xticks=range(1, len(ways) + 1),
        xlim=(0.5, len(ways) + 0.5),
    )
    handles, labels = axes[0, 0].get_legend_handles_labels()
    legend_below(figure, handles, labels, columns=3)
    return figure


def _scene(place: Any, world: Scenario, ways: list[Any]) -> None:
    draw_scene(place, world)
    for index, way in enumerate(ways):
        label = None if index else "demonstrations"
        place.plot(*np.array(way).T, ":", color=COLOURS["demonstration"], linewidth=0.7, label=label)


EXPERIMENT = Experiment(name="weighting", tasks=tasks, cost=cost, report=report)
