"""The learners over their training: in which range of the loss each figure of the paper holds.

All learners are evaluated at the same numbers of iterations, from the first to well below the loss threshold
Lt of Alg. 1. Demonstrations and trials are those of `drake_shared.experiments.paired_trials`.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.ambiguity import ambiguity, mean_weights
from drake_shared.analysis.mean_tests import UNBOUNDED
from drake_shared.analysis.metrics import metrics
from drake_shared.analysis.statistics import POINTS, Estimate, interval
from drake_shared.experiments.common import TRIAL_COST, run_all
from drake_shared.experiments.drawing import COLOURS, draw_curve, new_figure
from drake_shared.experiments.measures import Measure, by_learner, estimate, means_table, select
from drake_shared.experiments.paired_trials import demonstrations_of, groups, settings_of
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size, Table
from drake_shared.experiments.text import number, paragraphs, with_interval
from drake_shared.experiments.training import PRESETS, studied, train_all, training_cost
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.parameters import TrainingParameters
from drake_shared.simulation.runner import Task
from drake_shared.simulation.trial import Trial

# The first and the last iteration, and more where the loss falls fast.
SHARES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
OPERATORS = {"steady": "primary", "noisy": "unskilled"}
"""Name of the simulated operator by that of the column with its intent success."""
_MOMENTS = 7
"""Number of points of each demonstration from which a learner predicts."""
_GROUP, _TRIALS = 10, 6

LOSS = Measure("loss", "loss", "nats per point")
MEASURES = (
    LOSS,
    Measure("missed", "largest distance from a point shown", "m"),
    Measure("follow", "error on its route", "m"),
    Measure("toward_best", "moved toward the best", "m"),
    Measure("weight_where_ambiguous", "w where ambiguous", limits=(0.0, 1.0)),
    Measure("weight_where_clear", "w where clear", limits=(0.0, 1.0)),
    Measure("steady", "intent success, steady operator", "%", 100.0),
    Measure("noisy", "noisy operator", "%", 100.0),
)
_ALONE = Measure("noisy_alone", "noisy operator alone", "%", 100.0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Criterion:
    """When a figure of the paper holds.

    Attributes:
        figure: Of the paper.
        words: What has to be above 0, with its unit.
        excess: Of a learner, from its row.
        bounds: The least and the largest possible excess.
    """

    figure: str
    words: str
    excess: Callable[[Mapping[str, Any]], float]
    bounds: tuple[float, float] = UNBOUNDED


CRITERIA = (
    Criterion(
        figure="Fig. 2, conditions",
        words="every predicted path passes within 0.1 m of the point shown",
        excess=lambda row: 0.1 - row["missed"],
    ),
    Criterion(
        figure="Fig. 2, weighting",
        words="shown the start, the path is closer by 0.02 m to the best demonstration than their mean is",
        excess=lambda row: row["toward_best"] - 0.02,
    ),
    Criterion(
        figure="Figs. 2 and 3, intention",
        words="shown a point of one route, the prediction follows it with an RMSE below 0.1 m",
        excess=lambda row: 0.1 - row["follow"],
    ),
    Criterion(
        figure="Fig. 4, human weight",
        words="w is higher by 0.1 where the route is ambiguous than where it is clear",
        excess=lambda row: row["weight_where_ambiguous"] - row["weight_where_clear"] - 0.1,
        bounds=(-1.1, 0.9),
    ),
    Criterion(
        figure="the steady operator is not hindered",
        words="intent success in shared control is above 70%",
        excess=lambda row: 100.0 * row["steady"] - 70.0,
        bounds=(-70.0, 30.0),
    ),
    Criterion(
        figure="the noisy operator is helped",
        words="intent success in shared control is higher than alone",
        excess=lambda row: 100.0 * (row["noisy"] - row["noisy_alone"]),
        bounds=POINTS,
    ),
)


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each preset and ten learners."""
    trials = min(size.trials, _TRIALS)
    return [
        PlannedTask(
            Task.of(run_trainings, scenario=scenario, preset=preset, learners=group, trials=trials),
            1.4 * training_cost(preset, len(group))
            + len(group) * len(SHARES) * (0.3 + TRIAL_COST * trials * len(OPERATORS)),
        )
        for preset in PRESETS
        for group in groups(_learners(size, preset), _GROUP)
    ]


def _learners(size: Size, preset: str) -> int:
    """As many of each preset, except in a quick run."""
    return size.learners if size.name == "full" else size.of(preset).learners


def parameters_of(preset: str) -> TrainingParameters:
    """Those of the experiments, for one cycle of the schedule that no threshold ends."""
    usual = studied(preset)
    return dataclasses.replace(
        usual, iterations=usual.cycle or usual.iterations, loss_threshold=None, patience=0.0, restarts=0
    )


def run_trainings(
    scenario: str | None, preset: str, learners: list[int], trials: int
) -> list[dict[str, Any]]:
    """Trains learners once, and evaluates them on the way; returns a row for each learner and checkpoint.

    Args:
        scenario: File or name.
        preset: Of the learners.
        learners: Indices, which determine demonstrations, trainings and trials.
        trials: Number of trials with each operator at each checkpoint.
    """
    parameters = parameters_of(preset)
    steps = sorted({max(1, round(share * parameters.iterations)) for share in SHARES})
    rows, taught = [], []

    def keep(index: int, iteration: int, loss: float, learner: CnmpLearner) -> None:
        columns = {"preset": preset, "learner": learners[index], "iterations": iteration, "loss": loss}
        rows.append({**columns, **prediction_errors(learner)})
        taught.append((learners[index], learner))

    train_all(
        demonstrations_of(scenario, learners),
        learners,
        preset=preset,
        parameters=parameters,
        checkpoints=steps,
        on_checkpoint=keep,
    )
    settings = {
        (index, column): [settings_of(scenario, operator, index, trial) for trial in range(trials)]
        for index in learners
        for column, operator in OPERATORS.items()
    }
    alone = {
        index: _success(run_all(scenario, [None] * trials, settings[index, "noisy"])) for index in learners
    }
    driven = run_all(
        scenario,
        [learner for _, learner in taught for _ in range(len(OPERATORS) * trials)],
        [one for index, _ in taught for operator in OPERATORS for one in settings[index, operator]],
    )
    for row, (index, learner) in zip(rows, taught, strict=True):
        assert learner.demonstrations is not None
        for operator in OPERATORS:
            own = list(itertools.islice(driven, trials))
            row[operator] = _success(own)
            if operator == "steady":
                row |= mean_weights([ambiguity(one, learner.grid, learner.demonstrations) for one in own])
        row["noisy_alone"] = alone[index]
        row["confidence_gain"] = learner.confidence_gain
    return rows


def _success(trials: Iterable[Trial]) -> float:
    return float(np.mean([metrics(trial)["intent_success"] for trial in trials]))


def prediction_errors(learner: CnmpLearner) -> dict[str, float]:
    """How well a learner meets conditions, and follows the route of the point that it is shown.

    Returns:
        missed: The largest distance, in [m], between a point shown, at 7 moments of each demonstration, and
            the predicted mean at that time.
        follow: The root mean square error, in [m], after the point of each demonstration that is farthest
            from the others, shown that point.
        toward_best: Shown the start, how much closer the path is to the best demonstration, which has the
            largest weight, than the mean of the demonstrations: mean distance over time, in [m].
    """
    paths, grid = learner.demonstrations, learner.grid
    assert paths is not None
    missed = []
    for path in paths:
        for step in np.linspace(0, len(grid) - 1, _MOMENTS).round().astype(int):
            mean, _ = learner.predict(grid[[step]], path[[step]], grid[[step]])
            missed.append(float(np.linalg.norm(mean[0] - path[step])))
    squares = []
    for step, path in zip(_farthest(paths), paths, strict=True):
        mean, _ = learner.predict(grid[[step]], path[[step]], grid[step:])
        squares.append(np.square(mean - path[step:]).sum(axis=1).mean())
    start = paths[:, 0].mean(axis=0)
    predicted, _ = learner.predict(grid[:1], start[None], grid)
    best = paths[int(np.argmax(learner.weights))]
    of_mean, of_path = (
        np.linalg.norm(path - best, axis=1).mean() for path in (paths.mean(axis=0), predicted)
    )
    return {
        "missed": max(missed),
        "follow": float(np.sqrt(np.mean(squares))),
        "toward_best": float(of_mean - of_path),
    }


def _farthest(paths: NDArray[np.float64]) -> NDArray[np.intp]:
    """The step at which each of the paths (m, N, D), m >= 2, is farthest from the others at that time."""
    apart = np.linalg.norm(paths[:, None] - paths[None], axis=-1)
    apart[np.arange(len(paths)), np.arange(len(paths))] = np.inf
    steps: NDArray[np.intp] = apart.min(axis=1).argmax(axis=1)
    return steps


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Curves over the loss, and where along them each figure of the paper holds."""
    rows = [row for result in results for row in result]
    return Section(
        title="The learners over their training",
        text=paragraphs(
            "training_curve",
            learners={preset: _learners(size, preset) for preset in PRESETS},
            trials=min(size.trials, _TRIALS),
            threshold=studied("paper").loss_threshold,
            operators=OPERATORS,
            checkpoints=len(SHARES),
            alone={preset: estimate(_checkpoint(rows, preset, -1), _ALONE) for preset in PRESETS},
            outcomes={
                preset: [(one.figure, one.words, _ranges(rows, preset, one)) for one in CRITERIA]
                for preset in PRESETS
            },
        ),
        pictures=[
            Picture.of(
                _curves(rows),
                "Measures of the checkpoints in the order of their running mean loss, which falls from left "
                "to right: means over learners with 95% intervals. The vertical line is the loss threshold "
                "Lt of preset paper, the horizontal one the noisy operator alone.",
            )
        ],
        tables=[_ranges_table(rows), *(_table(rows, preset) for preset in PRESETS)],
        data={"training_curve": rows},
    )


def _iterations(rows: Rows, preset: str) -> list[int]:
    return sorted({row["iterations"] for row in select(rows, preset=preset)})


def _at(preset: str, iterations: int) -> dict[str, Any]:
    return {"preset": preset, "iterations": iterations}


def _checkpoint(rows: Rows, preset: str, place: int) -> Rows:
    return select(rows, preset=preset, iterations=_iterations(rows, preset)[place])


def _excess(rows: Rows, criterion: Criterion) -> Estimate:
    """Of the learners of one checkpoint; the interval is adjusted for the number of checkpoints."""
    values = [criterion.excess(row) for row in rows]
    return interval(values, level=1.0 - 0.05 / len(SHARES), bounds=criterion.bounds)


def _ranges(rows: Rows, preset: str, criterion: Criterion) -> list[tuple[float, float]]:
    """The ranges of the mean loss, from the earliest checkpoint, in which a criterion holds."""
    ranges: list[tuple[float, float]] = []
    held = False
    for iterations in _iterations(rows, preset):
        own = select(rows, preset=preset, iterations=iterations)
        holds = _excess(own, criterion).low > 0.0
        loss = float(np.mean([row["loss"] for row in own]))
        if holds:
            begin = ranges.pop()[0] if held else loss
            ranges.append((begin, loss))
        held = holds
    return ranges


def _ranges_table(rows: Rows) -> Table:
    def words(preset: str, criterion: Criterion) -> str:
        found = [
            number(first) if first == last else f"{number(first)} to {number(last)}"
            for first, last in _ranges(rows, preset, criterion)
        ]
        return ", ".join(found) or "nowhere"

    def at_end(preset: str, criterion: Criterion) -> str:
        return with_interval(_excess(_checkpoint(rows, preset, -1), criterion))

    return Table(
        caption="The mean losses, in nats per point, of the checkpoints at which the whole interval of the "
        "criterion is above 0, and by how much it is exceeded at the last one. Intervals are adjusted for "
        "the number of checkpoints.",
        head=[
            "figure",
            "criterion",
            *(f"{preset}: {column}" for preset in PRESETS for column in ("holds at", "last")),
        ],
        rows=[
            [one.figure, one.words, *(cell(preset, one) for preset in PRESETS for cell in (words, at_end))]
            for one in CRITERIA
        ],
    )


def _table(rows: Rows, preset: str) -> Table:
    return means_table(
        rows,
        MEASURES,
        [([str(iterations)], _at(preset, iterations)) for iterations in _iterations(rows, preset)],
        head=["iterations"],
        caption=f"Preset {preset}: means and 95% intervals over learners.",
    )


def _curves(rows: Rows) -> Any:
    panels: Sequence[tuple[str, Sequence[tuple[str, str, str]]]] = (
        ("distance, m", (("missed", "from a point shown, at most", "-"), ("follow", "on its route", "--"))),
        (
            "w",
            (("weight_where_ambiguous", "ambiguous", "-"), ("weight_where_clear", "clear", "--")),
        ),
        ("intent success, %", (("steady", "steady operator", "-"), ("noisy", "noisy operator", "--"))),
    )
    measures = {measure.name: measure for measure in MEASURES}
    figure, axes = new_figure(5.6, rows=2, columns=3, sharey="col")
    for line, preset in zip(axes, PRESETS, strict=True):
        points = [_at(preset, iterations) for iterations in _iterations(rows, preset)]
        # Not always the order of the training: the loss rises when the floor under sigma becomes the last.
        points.sort(key=lambda where: -by_learner(rows, "loss", **where).mean())
        losses = [float(by_learner(rows, "loss", **where).mean()) for where in points]
        for place, (label, curves) in zip(line, panels, strict=True):
            for name, words, style in curves:
                measure = measures[name]
                found = [estimate(rows, measure, **where) for where in points]
                colour = COLOURS["human" if style == "-" else "agent"]
                draw_curve(place, losses, found, colour, words, linestyle=style)
            place.invert_xaxis()
            if threshold := studied(preset).loss_threshold:
                place.axvline(threshold, color="0.5", linewidth=0.8)
            place.set_title(f"preset {preset}", fontsize=9)
            place.set_xlabel(LOSS.label, fontsize=8)
            place.set_ylabel(label, fontsize=8)
            place.legend(fontsize=7, frameon=False)
        alone = by_learner(rows, "noisy_alone", **points[-1]).mean()
        line[2].axhline(100.0 * alone, color="0.3", linestyle="--", linewidth=0.8)
    axes[0, 0].set_yscale("log")
    return figure


EXPERIMENT = Experiment(name="training_curve", plan=plan, report=report)
