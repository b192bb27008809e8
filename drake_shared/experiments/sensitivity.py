"""How much hangs on the calibrated K, and on the number of demonstrations."""

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
from drake_shared.experiments.drawing import COLOURS, draw_curve, legend_below, new_figure
from drake_shared.experiments.paired_trials import by_learner, groups, settings, taught
from drake_shared.experiments.report import number, with_interval
from drake_shared.experiments.section import Experiment, Picture, Section, Size, Table
from drake_shared.simulation.runner import Task

PRESETS = ("paper", "default")
OPERATORS = ("primary", "unskilled")
FACTORS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
COUNTS = (3, 6, 12, 30)
_MEASURES = {
    "intent_success": ("intent success, %", 100.0),
    "human_effort": ("human effort, rad", 1.0),
    "mean_human_weight": ("mean human weight", 1.0),
}
_STYLES = {"primary": "-", "unskilled": "--"}
# Six trials take each route of the shipped scenarios twice.
_GROUP, _TRIALS = 5, 6


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """One for each preset and five learners of each number of demonstrations; half as many as elsewhere.

    A quick run takes the fewest and the most demonstrations alone.
    """
    return [
        Task(
            "drake_shared.experiments.sensitivity:run_variants",
            {
                "scenario": scenario,
                "preset": preset,
                "learners": learners,
                "counts": _counts(size),
                "factors": FACTORS,
                "trials": min(size.trials, _TRIALS),
            },
        )
        for preset in PRESETS
        for learners in groups(_learners(size), _GROUP)
    ]


def _counts(size: Size) -> tuple[int, ...]:
    return COUNTS if size.all_arms else (COUNTS[0], COUNTS[-1])


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    told = task.arguments
    learners, counts = len(told["learners"]), told["counts"]
    trials = told["trials"] * (len(told["factors"]) + len(counts) - 1) * len(OPERATORS)
    training = training_cost(told["preset"], learners * len(counts))
    return training + learners * (ALONE_COST * sum(counts) + TRIAL_COST * trials)


def run_variants(
    scenario: str | None,
    preset: str,
    learners: list[int],
    counts: list[int],
    factors: list[float],
    trials: int,
) -> list[dict[str, Any]]:
    """Trials with learners of so many demonstrations, those of the fewest at multiples of their K as well.

    Args:
        scenario: File or name.
        preset: Of the learners.
        learners: Their indices; they fix demonstrations, trainings and trials.
        counts: Of demonstrations.
        factors: Of the calibrated K.
        trials: With each operator and factor.
    """
    kinds = [(count, index) for count in counts for index in learners]
    sets = [taught(scenario, index, count=count) for count, index in kinds]
    trained = train_all(sets, [index for _, index in kinds], preset=preset)
    return [
        measured(
            run(
                scenario,
                learner,
                confidence_gain=factor * learner.confidence_gain,
                **settings(scenario, operator, index, trial),
            ),
            preset=preset,
            operator=operator,
            learner=index,
            factor=factor,
            demonstrations=count,
            confidence_gain=factor * learner.confidence_gain,
        )
        for (count, index), learner in zip(kinds, trained, strict=True)
        for factor in (factors if count == min(counts) else (1.0,))
        for operator in OPERATORS
        for trial in range(trials)
    ]


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Curves over K and over demonstrations, with their numbers."""
    rows = [row for result in results for row in result]
    counts = _counts(size)
    by_gain = {"demonstrations": min(counts)}
    by_count = {"factor": 1.0}
    return Section(
        title="Sensitivity to K and to the number of demonstrations",
        text=[
            "K of eq. (1) turns a variance into a confidence, and training calibrates it. Here learners of "
            f"{min(counts)} demonstrations take part with {number(FACTORS[0])} to {number(FACTORS[-1])} "
            f"times that K, and others are taught {', '.join(str(count) for count in counts)} "
            "demonstrations, routes in turn, each set holding the smaller ones.",
            f"{_learners(size)} learners of each preset and {min(size.trials, _TRIALS)} trials with each of "
            f"the simulated operators {' and '.join(OPERATORS)}; learners, routes and seeds are the same "
            "along each curve. Bands are 95% bootstrap intervals over learners. Learners of preset default "
            "leave to the human what that preset does, those of preset paper nothing.",
            "Each curve's two ends, as paired differences over learners: "
            + "; ".join(_changes(rows, "factor", FACTORS, by_gain, "from the least K to the largest"))
            + "; "
            + "; ".join(
                _changes(rows, "demonstrations", counts, by_count, "from the fewest demonstrations to most")
            )
            + ".",
        ],
        pictures=[
            Picture.of(
                _curves(rows, "factor", FACTORS, by_gain, "K / calibrated K"),
                "Intent success, effort and mean human weight over K, by preset and operator. A larger K is "
                "a less confident agent.",
            ),
            Picture.of(
                _curves(rows, "demonstrations", counts, by_count, "demonstrations"),
                "The same over the number of demonstrations, at the calibrated K.",
            ),
        ],
        tables=[
            _table(rows, "factor", FACTORS, by_gain, "K / calibrated K"),
            _table(rows, "demonstrations", counts, by_count, "demonstrations"),
        ],
        data={"sensitivity": rows},
    )


def _learners(size: Size) -> int:
    return max(2, size.learners // 2)


def _estimate(rows: Sequence[Mapping[str, Any]], measure: str, **told: Any) -> Estimate:
    return interval(_MEASURES[measure][1] * by_learner(rows, measure, **told))


def _changes(
    rows: Sequence[Mapping[str, Any]],
    name: str,
    values: Sequence[float],
    fixed: Mapping[str, Any],
    words: str,
) -> list[str]:
    said = []
    for preset in PRESETS:
        parts = []
        for operator in OPERATORS:
            told = {"preset": preset, "operator": operator, **fixed}
            last, first = (
                by_learner(rows, "intent_success", **told, **{name: value})
                for value in (values[-1], values[0])
            )
            found = interval(100.0 * (last - first))
            parts.append(
                f"{number(found.mean)} points [{number(found.low)}, {number(found.high)}] for {operator}"
            )
        said.append(f"intent success {words} changes by {' and '.join(parts)} (preset {preset})")
    return said


def _curves(
    rows: Sequence[Mapping[str, Any]],
    name: str,
    values: Sequence[float],
    fixed: Mapping[str, Any],
    label: str,
) -> Any:
    figure, axes = new_figure(3.0, columns=len(_MEASURES))
    for place, (measure, (title, _)) in zip(axes, _MEASURES.items(), strict=True):
        for preset in PRESETS:
            for operator, style in _STYLES.items():
                told = {"preset": preset, "operator": operator, **fixed}
                found = [_estimate(rows, measure, **told, **{name: value}) for value in values]
                draw_curve(place, values, found, COLOURS[preset], f"{preset}, {operator}", linestyle=style)
        place.set_xscale("log")
        place.set_xticks(values, [number(value) for value in values])
        place.minorticks_off()
        place.set_xlabel(label, fontsize=9)
        place.set_title(title, fontsize=9)
    axes[0].set_ylim(None, 102)
    axes[2].set_ylim(0, 1)
    legend_below(figure, *axes[0].get_legend_handles_labels(), columns=4)
    return figure


def _table(
    rows: Sequence[Mapping[str, Any]],
    name: str,
    values: Sequence[float],
    fixed: Mapping[str, Any],
    label: str,
) -> Table:
    cells = []
    for preset in PRESETS:
        for operator in OPERATORS:
            for value in values:
                told = {"preset": preset, "operator": operator, **fixed, name: value}
                estimates = [_estimate(rows, measure, **told) for measure in _MEASURES]
                cells.append(
                    [
                        preset,
                        operator,
                        number(value),
                        *(with_interval(one) for one in estimates),
                    ]
                )
    return Table(
        caption="Means and 95% bootstrap intervals over learners.",
        head=["preset", "operator", label, *(title for title, _ in _MEASURES.values())],
        rows=cells,
    )


EXPERIMENT = Experiment(name="sensitivity", tasks=tasks, cost=cost, report=report)
