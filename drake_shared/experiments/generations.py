"""The feedback loop over generations: shared runs are added to the demonstrations again and again.

Seeds of repeat k start at 40 000 000 + 1 000 k: those of the base demonstrations at 0 after that, of the runs
of generation g at 100 g, and of the trials at 900.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.confidence_calibration import (
    assess_confidence,
    confidence_calibration,
    intended_path,
)
from drake_shared.analysis.metrics import metrics
from drake_shared.analysis.statistics import (
    PERCENT,
    POINTS,
    Claim,
    differences,
    interval,
    judge,
    larger,
    not_worse,
)
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration
from drake_shared.experiments.common import (
    Teaching,
    as_demonstrations,
    demonstrate,
    demonstrated,
    route_count,
    run_all,
    scenario_of,
)
from drake_shared.experiments.drawing import COLOURS, draw_curve, legend_below, new_figure
from drake_shared.experiments.measures import (
    DISAGREEMENT,
    HUMAN_EFFORT,
    INTENT_SUCCESS,
    MEAN_HUMAN_WEIGHT,
    Measure,
    by_learner,
    estimate,
    means_table,
    select,
)
from drake_shared.experiments.paired_trials import groups, route_settings
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size, Table
from drake_shared.experiments.text import number, paragraphs, with_interval
from drake_shared.experiments.training import PRESETS, stopped_early, train_all, training_cost
from drake_shared.operators.named import OPERATORS
from drake_shared.simulation.runner import Task
from drake_shared.simulation.trial import Trial

OPERATOR = "unskilled"
"""The primary operator almost never fails, so no effect on its intent success would be visible."""
GENERATIONS, QUICK_GENERATIONS = 5, 1
ARMS = {"shared": COLOURS["shared"], "human": COLOURS["human"], "frozen": "0.35"}
"""Name to colour. The frozen learner receives no new data."""
FED = ("shared", "human")
_TRIAL_MEASURES = (INTENT_SUCCESS, HUMAN_EFFORT, DISAGREEMENT, MEAN_HUMAN_WEIGHT)
_CALIBRATION_ERROR = Measure("expected_calibration_error", "calibration error", limits=(0.0, 1.0))
_AUTONOMY_SHARE = Measure("autonomy_share", "share of data by autonomy", "%", 100.0)
_LOOP_MEASURES = (
    _CALIBRATION_ERROR,
    Measure("confident_and_wrong", "confident and wrong", "% of steps", 100.0, limits=PERCENT),
    _AUTONOMY_SHARE,
)
_MEASURES = (*_TRIAL_MEASURES, *_LOOP_MEASURES)
# Smallest effects of interest: one trial in twenty, 4% of the usual value, and 2% of the scale.
_SMALLEST = {INTENT_SUCCESS: 5.0, DISAGREEMENT: 20.0, _CALIBRATION_ERROR: 0.02}
_GROUP = 5
# A trial with its calibration, which steps through the diagram, and a drive that may have to be repeated.
_TRIAL_SECONDS, _DRIVE_SECONDS = 0.25, 0.04
_EVERY = 4
_FIRST_SEED, _STRIDE, _RUNS, _TRIALS = 40_000_000, 1_000, 100, 900


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each preset and a group of repeats, half as many as learners in other experiments."""
    generations = QUICK_GENERATIONS if size.name == "quick" else GENERATIONS
    return [
        PlannedTask(
            Task.of(
                run_repeats,
                scenario=scenario,
                preset=preset,
                repeats=repeats,
                generations=generations,
                trials=size.trials,
            ),
            _seconds(scenario, preset, len(repeats), generations, size.trials),
        )
        for preset in PRESETS
        for repeats in groups(size.fewer(preset), _GROUP)
    ]


def _seconds(scenario: str | None, preset: str, repeats: int, generations: int, trials: int) -> float:
    training = training_cost(preset, repeats)
    training += generations * training_cost(preset, len(FED) * repeats)
    learners = repeats * (1 + generations * len(FED))
    return training + learners * (_TRIAL_SECONDS * trials + _DRIVE_SECONDS * route_count(scenario))


def run_repeats(
    scenario: str | None, preset: str, repeats: Sequence[int], generations: int, trials: int
) -> list[dict[str, Any]]:
    """Runs repeats together; returns a row for each generation and arm.

    A repeat starts with a base demonstration of each route by the primary operator alone, and a learner. In
    each generation the operator under study drives each route once more, in shared control with the newest
    learner or alone, with the same noise seeds, and a new learner is trained on all data so far, with a K of
    its own. If the operator fails in many attempts nothing is added, and the learner stays ("stalled"). All
    learners of a repeat have the same training seed and the same trials, so the rows of the frozen learner
    are those of generation 0.

    Args:
        scenario: File or name.
        preset: Of the learners.
        repeats: Indices below 1000, which determine all seeds.
        generations: Number of generations after the first learner, at most 8.
        trials: Number of trials with each learner, at most 100.
    """
    behaviour = OPERATORS[OPERATOR].behaviour_in(scenario_of(scenario))
    driven = demonstrated(scenario, [Teaching(seed=seed_of(repeat)) for repeat in repeats])
    base = dict(zip(repeats, map(list, driven), strict=True))
    frozen_data = {(repeat, "frozen"): items for repeat, items in base.items()}
    first = {repeat: learner for (repeat, _), learner in _train(scenario, frozen_data, preset).items()}
    data = {(repeat, arm): list(base[repeat]) for repeat in repeats for arm in FED}
    newest = {(repeat, arm): first[repeat] for repeat, arm in data}

    def evaluate(cells: Mapping[Any, tuple[int, Any, Sequence[Demonstration]]]) -> dict[Any, dict[str, Any]]:
        found = _evaluate(
            scenario,
            [(learner, items, seed_of(repeat, _TRIALS)) for repeat, learner, items in cells.values()],
            trials,
        )
        return dict(zip(cells, found, strict=True))

    def row(repeat: int, arm: str, generation: int, values: Mapping[str, Any]) -> dict[str, Any]:
        cell = {"preset": preset, "operator": OPERATOR, "repeat": repeat}
        return {**cell, "arm": arm, "generation": generation, **values}

    frozen = evaluate({repeat: (repeat, first[repeat], base[repeat]) for repeat in repeats})
    rows = {repeat: [row(repeat, arm, 0, frozen[repeat]) for arm in ARMS] for repeat in repeats}
    for generation in range(1, generations + 1):
        grown = []
        teaching = [
            Teaching(
                learner=newest[repeat, arm] if arm == "shared" else None,
                seed=seed_of(repeat, _RUNS * generation),
                behaviour=behaviour,
            )
            for repeat, arm in data
        ]
        for key, added in zip(data, demonstrate(scenario, teaching), strict=True):
            # Without the repeats that fail, only the successful loops would be evaluated.
            if not isinstance(added, RunError):
                data[key] += added
                grown.append(key)
        newest |= _train(scenario, {key: data[key] for key in grown}, preset)
        evaluated = evaluate({key: (key[0], learner, data[key]) for key, learner in newest.items()})
        for (repeat, arm), values in evaluated.items():
            values["stalled"] = (repeat, arm) not in grown
            rows[repeat].append(row(repeat, arm, generation, values))
            if arm == FED[-1]:
                rows[repeat].append(row(repeat, "frozen", generation, frozen[repeat]))
    return [one for repeat in repeats for one in rows[repeat]]


def seed_of(repeat: int, purpose: int = 0) -> int:
    """The first seed of a repeat for a purpose; see the head of this module."""
    return _FIRST_SEED + _STRIDE * repeat + purpose


def _train(
    scenario: str | None, data: Mapping[tuple[int, str], Sequence[Demonstration]], preset: str
) -> dict[tuple[int, str], Any]:
    """A learner for each set of data, by repeat and arm."""
    sets = [as_demonstrations(scenario, items) for items in data.values()]
    return dict(zip(data, train_all(sets, [repeat for repeat, _ in data], preset=preset), strict=True))


def _evaluate(
    scenario: str | None, cells: Sequence[tuple[Any, Sequence[Demonstration], int]], trials: int
) -> Iterator[dict[str, Any]]:
    """Evaluates learners with their data, in trials with seeds from the given ones on."""
    settings = [
        route_settings(scenario, OPERATOR, index, seed=seed + index)
        for _, _, seed in cells
        for index in range(trials)
    ]
    driven = run_all(scenario, [learner for learner, _, _ in cells for _ in range(trials)], settings)
    for learner, data, _ in cells:
        yield _summary(scenario, learner, data, itertools.islice(driven, trials))


def _summary(
    scenario: str | None, learner: Any, data: Sequence[Demonstration], trials: Iterable[Trial]
) -> dict[str, Any]:
    """Means over the trials, the calibration over all their steps, and properties of the data."""
    found: list[Mapping[str, Any]] = []
    parts = []
    for trial in trials:
        found.append(metrics(trial))
        intended = intended_path(scenario_of(scenario), learner, trial.metadata["route"])
        parts.append(assess_confidence(learner, trial, intended, every=_EVERY))
    calibration = confidence_calibration(parts)
    return {
        **{one.name: float(np.mean([row[one.name] for row in found])) for one in _TRIAL_MEASURES},
        "expected_calibration_error": calibration["expected_calibration_error"],
        "confident_and_wrong": calibration["confident_and_wrong"],
        "autonomy_share": float(np.mean([1.0 - item.provenance["human_weight"] for item in data])),
        "demonstrations": len(data),
        "confidence_gain": learner.confidence_gain,
        "stalled": False,
        "stopped_early": stopped_early(learner),
    }


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Curves over generations, means and differences in the last one, and the claims."""
    rows = [row for result in results for row in result]
    last = max(row["generation"] for row in rows)
    stalled = {
        (preset, arm): sum(row["stalled"] for row in select(rows, preset=preset, arm=arm))
        for preset in PRESETS
        for arm in FED
    }
    return Section(
        title="The feedback loop over generations",
        text=paragraphs(
            "generations",
            size=size,
            last=last,
            operator=OPERATOR,
            routes=route_count(scenario),
            repeats={preset: len(_values(rows, INTENT_SUCCESS, preset, "frozen", 0)) for preset in PRESETS},
            outcomes={preset: _outcome(rows, preset, last) for preset in PRESETS},
            stalled={key: count for key, count in stalled.items() if count},
        ),
        pictures=[
            Picture.of(
                _curves(rows, _TRIAL_MEASURES, last),
                "Measures of the trials by generation; top: preset paper, bottom: preset default. Lines are "
                "means over repeats, bands their 95% intervals.",
            ),
            Picture.of(
                _curves(rows, _LOOP_MEASURES, last),
                "How well the confidence is calibrated, and the share of the training data that autonomy "
                "made.",
            ),
        ],
        tables=[_means_table(rows, last), _differences_table(rows, last)],
        claims=claims(rows, last),
        data={"generations": rows},
    )


def _values(rows: Rows, measure: Measure, preset: str, arm: str, generation: int) -> NDArray[np.float64]:
    """One value for each repeat, in the unit of the report."""
    where = {"preset": preset, "arm": arm, "generation": generation}
    return measure.factor * by_learner(rows, measure.name, unit="repeat", **where)


def claims(rows: Rows, last: int) -> list[Claim]:
    """Compares shared and frozen learners in the last generation."""

    def values(measure: Measure, preset: str, arm: str) -> NDArray[np.float64]:
        return _values(rows, measure, preset, arm, last)

    after = f"After {last} generations of shared runs"
    success = [
        not_worse(
            f"{after} intent success is less than {number(_SMALLEST[INTENT_SUCCESS])} points lower than with "
            f"the frozen learner (preset {preset})",
            values(INTENT_SUCCESS, preset, "shared"),
            values(INTENT_SUCCESS, preset, "frozen"),
            margin=_SMALLEST[INTENT_SUCCESS],
            unit="points",
            bounds=POINTS,
            units="repeats",
        )
        for preset in PRESETS
    ]
    disagreement = [
        larger(
            f"{after} disagreement is lower than with the frozen learner (preset {preset})",
            values(DISAGREEMENT, preset, "frozen"),
            values(DISAGREEMENT, preset, "shared"),
            smallest=_SMALLEST[DISAGREEMENT],
            unit="rad/s",
            units="repeats",
        )
        for preset in PRESETS
    ]
    calibration = [
        not_worse(
            f"{after} the calibration error is less than {number(_SMALLEST[_CALIBRATION_ERROR])} larger than "
            f"with the frozen learner (preset {preset})",
            -values(_CALIBRATION_ERROR, preset, "shared"),
            -values(_CALIBRATION_ERROR, preset, "frozen"),
            margin=_SMALLEST[_CALIBRATION_ERROR],
            unit="",
            bounds=(-1.0, 1.0),
            units="repeats",
        )
        for preset in PRESETS
    ]
    return judge("generations", success + disagreement + calibration)


def _difference(rows: Rows, measure: Measure, preset: str, one: str, other: str, last: int) -> str:
    pair = (_values(rows, measure, preset, arm, last) for arm in (one, other))
    return with_interval(interval(differences(*pair), bounds=measure.difference_bounds))


def _outcome(rows: Rows, preset: str, last: int) -> dict[str, Any]:
    where = {"preset": preset, "arm": "shared", "generation": last}
    return {
        "autonomy": estimate(rows, _AUTONOMY_SHARE, unit="repeat", **where).mean,
        **{one.name: _difference(rows, one, preset, "shared", "human", last) for one in _MEASURES},
    }


def _curves(rows: Rows, measures: Sequence[Measure], last: int) -> Any:
    figure, axes = new_figure(4.4, rows=len(PRESETS), columns=len(measures), sharex=True, sharey="col")
    at = range(last + 1)
    for line, preset in zip(axes, PRESETS, strict=True):
        for place, measure in zip(line, measures, strict=True):
            for arm, colour in ARMS.items():
                where = {"preset": preset, "arm": arm}
                found = [estimate(rows, measure, unit="repeat", **where, generation=one) for one in at]
                style = {"linestyle": "--", "marker": None} if arm == "frozen" else {}
                draw_curve(place, at, found, colour, arm, **style)
        line[0].set_ylabel(f"preset {preset}", fontsize=9)
    for measure, top, bottom in zip(measures, axes[0], axes[-1], strict=True):
        top.set_title(measure.label, fontsize=9)
        bottom.set_xlabel("generation", fontsize=9)
        bottom.set_xticks(at)
    legend_below(figure, *axes[0][0].get_legend_handles_labels(), columns=len(ARMS))
    return figure


def _means_table(rows: Rows, last: int) -> Table:
    return means_table(
        rows,
        _MEASURES,
        [
            ([preset, arm], {"preset": preset, "arm": arm, "generation": last})
            for preset in PRESETS
            for arm in ARMS
        ],
        head=["preset", "arm"],
        caption=f"After generation {last}: means and 95% intervals over repeats.",
        unit="repeat",
    )


def _differences_table(rows: Rows, last: int) -> Table:
    return Table(
        caption=f"Paired differences over repeats after generation {last}, with 95% intervals that "
        "are not adjusted for their number.",
        head=["preset", "difference", *(measure.label for measure in _MEASURES)],
        rows=[
            [
                preset,
                f"{one} − {other}",
                *(_difference(rows, measure, preset, one, other, last) for measure in _MEASURES),
            ]
            for preset in PRESETS
            for one, other in (("shared", "frozen"), ("human", "frozen"), ("shared", "human"))
        ],
    )


EXPERIMENT = Experiment(name="generations", plan=plan, report=report)
