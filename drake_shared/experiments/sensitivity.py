"""How much depends on the calibrated K, and on the number of demonstrations."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from drake_shared.analysis.statistics import POINTS, interval
from drake_shared.experiments.common import ALONE_COST, TRIAL_COST
from drake_shared.experiments.drawing import COLOURS, draw_curve, legend_below, new_figure
from drake_shared.experiments.measures import (
    HUMAN_EFFORT,
    INTENT_SUCCESS,
    MEAN_HUMAN_WEIGHT,
    by_learner,
    estimate,
    means_table,
)
from drake_shared.experiments.paired_trials import Condition, demonstrations_of, groups, run_conditions
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size, Table
from drake_shared.experiments.text import number, paragraphs
from drake_shared.experiments.training import PRESETS, train_all, training_cost
from drake_shared.simulation.runner import Task

OPERATORS = {"primary": "-", "unskilled": "--"}
"""Name to style of line."""
FACTORS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
COUNTS = (3, 6, 12, 30)
_MEASURES = (INTENT_SUCCESS, HUMAN_EFFORT, MEAN_HUMAN_WEIGHT)
# Six trials take each route of the shipped scenarios twice.
_GROUP, _TRIALS = 5, 6


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sweep:
    """A quantity that is varied.

    Attributes:
        column: Its name in the rows.
        values: Its values.
        fixed: The values of the other quantities.
        label: In figures and tables.
        change: The change from the first value to the last, in words.
    """

    column: str
    values: Sequence[float]
    fixed: Mapping[str, Any]
    label: str
    change: str

    def lines(self) -> Iterator[tuple[str, str, list[dict[str, Any]]]]:
        """Preset and operator of each curve, with the values of the rows of each of its points."""
        for preset in PRESETS:
            for operator in OPERATORS:
                where = {"preset": preset, "operator": operator, **self.fixed}
                yield preset, operator, [{**where, self.column: value} for value in self.values]


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each preset and five learners; half as many learners as in other experiments.

    A quick run uses only the smallest and the largest number of demonstrations.
    """
    counts, trials = _counts(size), min(size.trials, _TRIALS)
    seconds = ALONE_COST * sum(counts)
    seconds += TRIAL_COST * trials * (len(FACTORS) + len(counts) - 1) * len(OPERATORS)
    return [
        PlannedTask(
            Task.of(
                run_variants,
                scenario=scenario,
                preset=preset,
                learners=learners,
                counts=counts,
                factors=FACTORS,
                trials=trials,
            ),
            training_cost(preset, len(learners))
            + training_cost(preset, len(learners) * (len(counts) - 1))
            + len(learners) * seconds,
        )
        for preset in PRESETS
        for learners in groups(size.fewer(preset), _GROUP)
    ]


def _counts(size: Size) -> tuple[int, ...]:
    return COUNTS if size.all_arms else (COUNTS[0], COUNTS[-1])


def run_variants(
    scenario: str | None,
    preset: str,
    learners: list[int],
    counts: list[int],
    factors: list[float],
    trials: int,
) -> list[dict[str, Any]]:
    """Runs trials for each number of demonstrations, and for the smallest also with multiples of K.

    Args:
        scenario: File or name.
        preset: Of the learners.
        learners: Indices, which determine demonstrations, trainings and trials.
        counts: Numbers of demonstrations.
        factors: Multiples of the calibrated K.
        trials: Number of trials with each operator and factor.
    """
    sets = [one for count in counts for one in demonstrations_of(scenario, learners, count=count)]
    trained = train_all(sets, list(learners) * len(counts), preset=preset)
    rows = []
    for count in counts:
        own = {index: trained.pop(0) for index in learners}
        conditions = [
            Condition(
                columns={
                    "preset": preset,
                    "operator": operator,
                    "factor": factor,
                    "demonstrations": count,
                },
                operator=operator,
                gain_factor=factor,
            )
            for factor in (factors if count == min(counts) else (1.0,))
            for operator in OPERATORS
        ]
        rows += run_conditions(scenario, own, conditions, trials)
    return rows


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Curves and tables over K and over the number of demonstrations."""
    rows = [row for result in results for row in result]
    counts = _counts(size)
    gain = Sweep(
        column="factor",
        values=FACTORS,
        fixed={"demonstrations": min(counts)},
        label="K / calibrated K",
        change="from the smallest K to the largest",
    )
    count = Sweep(
        column="demonstrations",
        values=counts,
        fixed={"factor": 1.0},
        label="demonstrations",
        change="from the smallest number of demonstrations to the largest",
    )
    return Section(
        title="Sensitivity to K and to the number of demonstrations",
        text=paragraphs(
            "sensitivity",
            learners={preset: size.fewer(preset) for preset in PRESETS},
            trials=min(size.trials, _TRIALS),
            operators=OPERATORS,
            factors=FACTORS,
            counts=counts,
            changes=[*_changes(rows, gain), *_changes(rows, count)],
        ),
        pictures=[
            Picture.of(
                _curves(rows, gain),
                "Intent success, effort and mean human weight over K, by preset and operator. With a larger "
                "K the agent is less confident.",
            ),
            Picture.of(
                _curves(rows, count),
                "The same over the number of demonstrations, with the calibrated K.",
            ),
        ],
        tables=[_table(rows, gain), _table(rows, count)],
        data={"sensitivity": rows},
    )


def _changes(rows: Rows, sweep: Sweep) -> list[str]:
    """For each preset, by how much the intent success changes along the curves, in words."""
    changes: dict[str, list[str]] = {preset: [] for preset in PRESETS}
    for preset, operator, points in sweep.lines():
        first, last = (by_learner(rows, "intent_success", **points[at]) for at in (0, -1))
        found = interval(100.0 * (last - first), bounds=POINTS)
        changes[preset].append(
            f"{number(found.mean)} points [{number(found.low)}, {number(found.high)}] for {operator}"
        )
    return [
        f"intent success {sweep.change} changes by {' and '.join(parts)} (preset {preset})"
        for preset, parts in changes.items()
    ]


def _curves(rows: Rows, sweep: Sweep) -> Any:
    figure, axes = new_figure(3.0, columns=len(_MEASURES))
    for place, measure in zip(axes, _MEASURES, strict=True):
        for preset, operator, points in sweep.lines():
            found = [estimate(rows, measure, **where) for where in points]
            label, style = f"{preset}, {operator}", OPERATORS[operator]
            draw_curve(place, sweep.values, found, COLOURS[preset], label, linestyle=style)
        place.set_xscale("log")
        place.set_xticks(sweep.values, [number(value) for value in sweep.values])
        place.minorticks_off()
        place.set_xlabel(sweep.label, fontsize=9)
        place.set_title(measure.label, fontsize=9)
    axes[0].set_ylim(None, 102)
    axes[2].set_ylim(0, 1)
    legend_below(figure, *axes[0].get_legend_handles_labels(), columns=4)
    return figure


def _table(rows: Rows, sweep: Sweep) -> Table:
    return means_table(
        rows,
        _MEASURES,
        [
            ([preset, operator, number(where[sweep.column])], where)
            for preset, operator, points in sweep.lines()
            for where in points
        ],
        head=["preset", "operator", sweep.label],
        caption="Means and 95% intervals over learners.",
    )


EXPERIMENT = Experiment(name="sensitivity", plan=plan, report=report)
