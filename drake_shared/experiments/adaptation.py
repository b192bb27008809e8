"""Estimates a driver's noise with the prior of nobody, of other operators, or of the driver's own drives."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.driver_noise import DriveNoise, noise_of, prior_of
from drake_shared.analysis.statistics import (
    PERCENT,
    POINTS,
    Claim,
    at_least,
    judge,
    larger,
    not_worse,
)
from drake_shared.arbitration.fusion_model import FusionModel
from drake_shared.experiments.common import run_all, scenario_of
from drake_shared.experiments.drawing import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    draw_interval,
    label_lines,
    marker_legend,
    new_figure,
    rule_lines,
)
from drake_shared.experiments.measures import COLLISIONS, INTENT_SUCCESS, Measure, by_learner, estimate
from drake_shared.experiments.paired_trials import (
    Condition,
    demonstrations_of,
    route_settings,
    run_conditions,
)
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size, Table
from drake_shared.experiments.text import number, paragraphs, with_interval
from drake_shared.experiments.training import train_all, training_cost
from drake_shared.operators.named import OPERATORS
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.runner import Task
from drake_shared.simulation.trial import Trial

ARMS = {
    "none": "nobody",
    "others": "all other operators",
    "pooled": "all operators",
    "own_first": "the operator, 1 drive",
    "own": "the operator, 6 drives",
    "mistaken": "somebody else",
}
"""Where the prior comes from."""
_DRAWN = {"none": (BLACK, "o"), "others": (ORANGE, "s"), "pooled": (BLUE, "^"), "own": (GREEN, "D")}
_QUICK = ("primary", "noisy", "stubborn", "unskilled")
"""The operators of a quick run."""
_MISTAKEN = {"unskilled": "primary"}
"""Whose file starts the estimate of whom in the arm "mistaken"; of all others, that of unskilled."""
# Their commands are noisy in other ways than the model's, so that no noise is set.
_OTHER_NOISE = ("noisy", "laggy", "signal-noise")
_EARLIER, _TRIALS = 6, 3
_SEED = 950_000
_FIRST = 1.0
"""Time from the start of a drive, in [s], in which the estimate shows where it started."""
_CLEARANCE = 0.03
_FUSION_COST = 0.06
"""Approximate time of a trial among some on one core, in [s]."""
_MARGIN, _ERROR, _FALSE, _NOTICED = 5.0, 0.02, 2.0, 90.0
"""In points, in rad/s, and in % of the drives."""

NOISE_ERROR = Measure("noise_error", "error of the noise", "rad/s")
FIRST_ERROR = Measure("first_error", "in the first second", "rad/s")
NOTICED = Measure("noticed", "another driver noticed", "%", 100.0)
NOTICE_TIME = Measure("notice_time", "noticed after", "s")
_MEASURES = (INTENT_SUCCESS, COLLISIONS, NOISE_ERROR, FIRST_ERROR, NOTICED, NOTICE_TIME)


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each operator. Learners and earlier drives are made once in each process."""
    operators = tuple(OPERATORS) if size.all_arms else _QUICK
    learners = size.learners
    trials = len(ARMS) * learners * _TRIALS
    once = training_cost("default", learners) / len(operators) + _FUSION_COST * _EARLIER
    return [
        PlannedTask(
            Task.of(run_operator, scenario=scenario, name=name, learners=learners, operators=operators),
            _FUSION_COST * trials + once,
        )
        for name in operators
    ]


def run_operator(
    scenario: str | None, name: str, learners: int, operators: list[str]
) -> list[dict[str, Any]]:
    """Runs the same trials of an operator with each prior.

    Args:
        scenario: File or name.
        name: Of the operator.
        learners: Number of learners, each with three trials.
        operators: Of whom there are earlier drives.
    """
    taking_part = dict(enumerate(_learners(scenario, learners)))
    behaviour = OPERATORS[name].behaviour_in(scenario_of(scenario))
    noise = np.nan if name in _OTHER_NOISE else behaviour.noise
    return run_conditions(
        scenario,
        taking_part,
        [
            Condition(columns={"arm": arm, "operator": name}, operator=name, config=_config(prior))
            for arm, prior in _priors(scenario, name, learners, operators).items()
        ],
        _TRIALS,
        measure=functools.partial(_measure, noise),
    )


def _priors(
    scenario: str | None, name: str, learners: int, operators: Sequence[str]
) -> dict[str, list[float]]:
    """The prior of each arm for an operator; empty: none."""
    earlier = _earlier(scenario, learners, tuple(operators))
    others = [drive for operator, drives in earlier.items() if operator != name for drive in drives]
    drives = {
        "others": others,
        "pooled": [*others, *earlier[name]],
        "own_first": earlier[name][:1],
        "own": earlier[name],
        "mistaken": earlier[_MISTAKEN.get(name, "unskilled")],
    }
    return {"none": []} | {arm: prior_of(found).tolist() for arm, found in drives.items()}


def _config(prior: Sequence[float]) -> SharedControlConfig:
    options = {"noise_prior": " ".join(f"{value:g}" for value in prior)} if len(prior) else {}
    return SharedControlConfig(arbitration="fusion", arbitration_options=options, safety_clearance=_CLEARANCE)


def _measure(noise: float, trial: Trial) -> dict[str, float]:
    """The error of the estimated noise, and whether and when another driver was noticed."""
    error, another = np.abs(trial["driver_noise"] - noise), trial["another_driver"]
    return {
        "noise_error": float(error.mean()),
        "first_error": float(error[trial["t"] < _FIRST].mean()),
        "noticed": float(another.any()),
        "notice_time": float(trial["t"][another.argmax()]) if another.any() else np.nan,
    }


@functools.cache
def _learners(scenario: str | None, count: int) -> list[Any]:
    indices = range(count)
    return train_all(demonstrations_of(scenario, indices), list(indices), preset="default")


@functools.cache
def _earlier(scenario: str | None, learners: int, operators: tuple[str, ...]) -> dict[str, list[DriveNoise]]:
    """The noise found in earlier drives of each operator, with the first of the learners."""
    learner = _learners(scenario, learners)[0]
    drives = [(name, index) for name in operators for index in range(_EARLIER)]
    settings = [route_settings(scenario, name, index, seed=_SEED + 1_000 + index) for name, index in drives]
    trials = list(run_all(scenario, [learner] * len(drives), settings, config=_config(())))
    noises = noise_of(trials, [str(drive) for drive in drives], FusionModel())
    return {name: [noises[str((name, index))] for index in range(_EARLIER)] for name in operators}


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Estimates by operator and over operators, and the claims."""
    rows = [row for result in results for row in result]
    return Section(
        title="Adapting to who drives",
        text=paragraphs(
            "adaptation",
            learners=len({row["learner"] for row in rows}),
            trials=_TRIALS,
            earlier=_EARLIER,
            operators=len(_operators(rows)),
            others=_OTHER_NOISE,
            arms=ARMS,
            false_notices=FusionModel().false_notices,
            first_errors={arm: estimate(rows, FIRST_ERROR, arm=arm) for arm in ARMS},
            mistakes=estimate(rows, NOTICED, arm="own"),
            noticed=estimate(rows, NOTICED, arm="mistaken"),
            after=estimate(rows, NOTICE_TIME, arm="mistaken"),
        ),
        pictures=[
            Picture.of(
                _figure(rows),
                "By operator and prior: means with 95% intervals over learners. The error of the noise is "
                "the mean over the drive of the absolute difference of estimate and set noise.",
            )
        ],
        tables=[_over_operators(rows), _means(rows)],
        claims=claims(rows),
        data={"adaptation": rows},
    )


def claims(rows: Rows) -> list[Claim]:
    """Compares the priors, each in the mean over operators."""
    return judge(
        "adaptation",
        [
            not_worse(
                f"Intent success with the prior of {ARMS[arm]} is at least that without a prior minus "
                f"{number(_MARGIN)} points (mean over operators)",
                100.0 * by_learner(rows, "intent_success", arm=arm),
                100.0 * by_learner(rows, "intent_success", arm="none"),
                margin=_MARGIN,
                unit="points",
                bounds=POINTS,
            )
            for arm in ("others", "pooled", "own")
        ]
        + [
            larger(
                f"The error of the estimated noise is larger {without} than with the operator's own prior "
                f"from {_EARLIER} drives",
                by_learner(rows, "noise_error", arm=arm),
                by_learner(rows, "noise_error", arm="own"),
                smallest=_ERROR,
                unit="rad/s",
            )
            for arm, without in {
                "none": "without a prior",
                "others": "with the prior of all other operators",
                "own_first": "with the operator's own prior from one drive",
            }.items()
        ]
        + [
            at_least(
                f"At most {number(_FALSE)}% of the drives with the operator's own prior are taken for those "
                "of another driver (the estimate is the share with a negative sign)",
                -100.0 * by_learner(rows, "noticed", arm="own"),
                least=-_FALSE,
                unit="%",
                bounds=(-100.0, 0.0),
            ),
            at_least(
                f"At least {number(_NOTICED)}% of the drives with somebody else's prior are noticed",
                100.0 * by_learner(rows, "noticed", arm="mistaken"),
                least=_NOTICED,
                unit="%",
                bounds=PERCENT,
            ),
        ],
    )


def _operators(rows: Rows) -> list[str]:
    return list(dict.fromkeys(row["operator"] for row in rows))


def _by_operator(rows: Rows, measure: Measure, arm: str) -> dict[str, float]:
    """The mean of a measure for each operator, where it is known."""
    found = {name: estimate(rows, measure, arm=arm, operator=name).mean for name in _operators(rows)}
    return {name: value for name, value in found.items() if np.isfinite(value)}


def _over_operators(rows: Rows) -> Table:
    lines = []
    for arm, label in ARMS.items():
        cells = [label]
        for measure, worst in ((INTENT_SUCCESS, min), (COLLISIONS, max), (NOISE_ERROR, max)):
            means = _by_operator(rows, measure, arm)
            name = worst(means, key=lambda one: means[one])
            cells += [
                with_interval(estimate(rows, measure, arm=arm)),
                f"{number(means[name])} ({name})",
                number(float(np.std(list(means.values())))),
            ]
        lines.append(cells)
    head = ["prior"]
    for measure in (INTENT_SUCCESS, COLLISIONS, NOISE_ERROR):
        head += [measure.label, "worst operator", "spread"]
    return Table(
        caption="Means over operators with 95% intervals over learners; the worst operator; and the spread, "
        "which is the standard deviation of the operators' means.",
        head=head,
        rows=lines,
    )


def _means(rows: Rows) -> Table:
    return Table(
        caption="By operator: means and 95% intervals over learners.",
        head=["operator", "prior", *(measure.label for measure in _MEASURES)],
        rows=[
            [
                name,
                label,
                *(with_interval(estimate(rows, item, arm=arm, operator=name)) for item in _MEASURES),
            ]
            for name in _operators(rows)
            for arm, label in ARMS.items()
        ],
    )


def _figure(rows: Rows) -> Any:
    figure, axes = new_figure(5.2, columns=2, sharey=True)
    operators = _operators(rows)
    label_lines(axes[0], operators)
    for place, measure in zip(axes, (INTENT_SUCCESS, NOISE_ERROR), strict=True):
        for order, (arm, (colour, marker)) in enumerate(_DRAWN.items()):
            for height, name in enumerate(operators):
                found = estimate(rows, measure, arm=arm, operator=name)
                draw_interval(
                    place,
                    height + 0.2 * (order - 1.5),
                    found,
                    colour,
                    marker=marker,
                    markersize=3.5,
                )
        place.set_xlabel(measure.label, fontsize=9)
        rule_lines(place)
    axes[0].set_xlim(None, 105)
    marker_legend(figure, {ARMS[arm]: style for arm, style in _DRAWN.items()}, columns=4)
    return figure


EXPERIMENT = Experiment(name="adaptation", plan=plan, report=report)
