"""The cost of each injected fault by its severity, in shared control and for the human alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import POINTS, Claim, judge, not_worse, seldom
from drake_shared.experiments.common import ALONE_COST, TRIAL_COST
from drake_shared.experiments.drawing import COLOURS, draw_curve, legend_below, new_figure
from drake_shared.experiments.measures import (
    COLLISIONS,
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
from drake_shared.experiments.training import train_all, training_cost
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.faults import Faults
from drake_shared.simulation.runner import Task
from drake_shared.simulation.trial import Trial

PRESET, OPERATOR = "default", "primary"
ARMS = {"alone": "human alone", "assisted": "shared control"}
_STYLES = {"alone": (COLOURS["human"], "--"), "assisted": (COLOURS["shared"], "-")}
_FREEZE_TIME = 3.0
FAULTS: Mapping[str, tuple[float, ...]] = {
    "delay": (0.1, 0.2, 0.3, 0.5),
    "jitter": (0.1, 0.25, 0.5),
    "loss": (0.1, 0.25, 0.5),
    "freeze": (0.5, 1.0, 2.0),
    "human_nan": (0.1, 0.25, 0.5),
    "pose_noise": (0.02, 0.05, 0.1),
    "pose_drift": (0.02, 0.05, 0.1),
    "pose_nan": (0.1, 0.25, 0.5),
    "slip": (0.1, 0.2, 0.4),
    "late_learner": (0.2, 0.5, 1.0),
    "learner_nan": (0.1, 0.25, 0.5),
}
"""The severities of each fault; severity 0, without a fault, comes before them."""
_NAMES = {
    "delay": "delay of the human command, s",
    "jitter": "largest jitter of its samples, s",
    "loss": "share of its samples lost",
    "freeze": f"freeze of it at {_FREEZE_TIME:g} s, s",
    "human_nan": "share of its samples NaN",
    "pose_noise": "noise of the measured pose, m and rad",
    "pose_drift": "drift of the measured pose after 1 s, m",
    "pose_nan": "share of measured poses NaN",
    "slip": "largest share lost to wheel slip",
    "late_learner": "delay of the learner's output, s",
    "learner_nan": "share of predictions NaN",
}
_MEASURES = (INTENT_SUCCESS, COLLISIONS, HUMAN_EFFORT, MEAN_HUMAN_WEIGHT)
# The inputs of the plant, before and after wheel slip, and its state.
_PLANT = (
    *("shared_left", "shared_right", "slipped_left", "slipped_right"),
    *("x", "y", "yaw", "wheel_left", "wheel_right"),
)
_MARGIN = 5.0
_MOST = 20.0
"""In %; with 20 learners, none with the event bounds their share to 17%."""
# Three trials take each route of the shipped scenarios once.
_GROUP, _TRIALS = 5, 3


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for five learners; a quick run uses the largest severity of each fault only."""
    trials, severities = min(size.trials, _TRIALS), _severities(size)
    seconds = sum(_seconds(fault, arm) for fault, _ in _cases(severities) for arm in arms_of(fault))
    return [
        PlannedTask(
            Task.of(run_faults, scenario=scenario, learners=learners, trials=trials, severities=severities),
            training_cost(PRESET, len(learners)) + len(learners) * trials * seconds,
        )
        for learners in groups(size.learners, _GROUP)
    ]


def _seconds(fault: str, arm: str) -> float:
    alone = arm == "alone"
    if fault and not faults_of(fault, FAULTS[fault][0]).on_channel:
        return 0.04 if alone else 0.12  # Trials in the diagram.
    return ALONE_COST if alone else TRIAL_COST


def _severities(size: Size) -> dict[str, list[float]]:
    return {name: list(values if size.all_arms else values[-1:]) for name, values in FAULTS.items()}


def run_faults(
    scenario: str | None, learners: list[int], trials: int, severities: dict[str, list[float]]
) -> list[dict[str, Any]]:
    """Runs trials with each fault and severity, and without faults, on the same routes and seeds.

    Args:
        scenario: File or name.
        learners: Indices, which determine demonstrations, trainings and trials.
        trials: Number of trials with each learner, severity and arm.
        severities: Of each fault, without 0.
    """
    trained = train_all(demonstrations_of(scenario, learners), learners, preset=PRESET)
    conditions = [
        Condition(
            columns={"fault": fault, "severity": severity, "arm": arm},
            operator=OPERATOR,
            config=SharedControlConfig(faults=faults_of(fault, severity)),
            alone=arm == "alone",
        )
        for fault, severity in _cases(severities)
        for arm in arms_of(fault)
    ]
    return run_conditions(
        scenario,
        dict(zip(learners, trained, strict=True)),
        conditions,
        trials,
        measure=lambda trial: {"not_finite": count_not_finite(trial)},
    )


def _cases(severities: Mapping[str, Sequence[float]]) -> Iterator[tuple[str, float]]:
    yield "", 0.0
    for fault, values in severities.items():
        for severity in values:
            yield fault, severity


def faults_of(fault: str, severity: float) -> Faults:
    """The faults to inject; none if the name is empty."""
    if not fault:
        return Faults()
    more = {"freeze": {"freeze_time": _FREEZE_TIME}, "pose_noise": {"yaw_noise": severity}}.get(fault, {})
    return Faults(**{fault: severity, **more})


def arms_of(fault: str) -> tuple[str, ...]:
    """The arms that a fault can affect: faults of the learner do not affect the human alone."""
    return ("assisted",) if "learner" in fault else tuple(ARMS)


def count_not_finite(trial: Trial) -> int:
    """Number of rows of a log in which an input or the state of the plant is NaN or infinite."""
    logged = [trial[name] for name in _PLANT if name in trial.columns]
    return int((~np.isfinite(logged)).any(axis=0).sum())


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Curves over severity, a table for each fault, and the claims."""
    rows = [row for result in results for row in result]
    severities = {name: (0.0, *values) for name, values in _severities(size).items()}
    return Section(
        title="Injected faults",
        text=paragraphs(
            "faults_injected",
            learners=size.learners,
            trials=min(size.trials, _TRIALS),
            preset=PRESET,
            operator=OPERATOR,
        ),
        pictures=[
            Picture.of(
                _curves(rows, severities),
                "Intent success over the severity of each fault: means over learners with 95% intervals.",
            )
        ],
        tables=[_table(rows, fault, values) for fault, values in severities.items()],
        claims=claims(rows),
        data={"faults": rows},
    )


def claims(rows: Rows) -> list[Claim]:
    """Assistance does not lower success at the largest severity, and NaN does not reach the plant."""
    largest = {row["fault"]: row["severity"] for row in sorted(rows, key=lambda row: row["severity"])}
    questions = []
    for fault in FAULTS:
        assisted, alone = (
            100.0 * by_learner(rows, "intent_success", **_where(fault, largest[fault], arm))
            for arm in ("assisted", "alone")
        )
        questions.append(
            not_worse(
                f"Assistance lowers intent success by less than {number(_MARGIN)} points: {_NAMES[fault]}: "
                f"{number(largest[fault])}",
                assisted,
                alone,
                margin=_MARGIN,
                unit="points",
                bounds=POINTS,
            )
        )
    with_nan = [
        {"learner": row["learner"], "reached": row["not_finite"] > 0}
        for row in rows
        if row["fault"].endswith("_nan")
    ]
    reached = seldom(
        f"With less than {number(_MOST)}% of learners NaN from human, pose or learner reaches an input or "
        f"the state of the plant (preset {PRESET}; the estimate is the share of learners, negative): it "
        f"did in {sum(row['reached'] for row in with_nan)} of {len(with_nan)} trials",
        by_learner(with_nan, "reached"),
        most=_MOST,
    )
    return [*judge("faults: success", questions), *judge("faults: NaN", [reached])]


def _where(fault: str, severity: float, arm: str) -> dict[str, Any]:
    """The values of the rows of a fault; of those without a fault where it does not affect the arm."""
    if severity == 0.0 or arm not in arms_of(fault):
        fault, severity = "", 0.0
    return {"fault": fault, "severity": severity, "arm": arm}


def _curves(rows: Rows, severities: Mapping[str, Sequence[float]]) -> Any:
    columns = 3
    figure, axes = new_figure(7.6, rows=-(-len(severities) // columns), columns=columns, sharey=True)
    for place, (fault, values) in zip(axes.flat, severities.items(), strict=False):
        for arm, (colour, style) in _STYLES.items():
            found = [estimate(rows, INTENT_SUCCESS, **_where(fault, value, arm)) for value in values]
            draw_curve(place, values, found, colour, ARMS[arm], linestyle=style)
        place.set_xlabel(_NAMES[fault], fontsize=8)
        place.set_xticks(values)
        place.set_ylim(-3, 103)
    for place in axes.flat[len(severities) :]:
        place.set_visible(False)
    for place in axes[:, 0]:
        place.set_ylabel(INTENT_SUCCESS.label, fontsize=8)
    legend_below(figure, *axes.flat[0].get_legend_handles_labels(), columns=2)
    return figure


def _table(rows: Rows, fault: str, severities: Sequence[float]) -> Table:
    return means_table(
        rows,
        _MEASURES,
        [
            ([number(severity), ARMS[arm]], _where(fault, severity, arm))
            for severity in severities
            for arm in (ARMS if severity == 0.0 else arms_of(fault))
        ],
        head=["severity", "control"],
        caption=f"By severity: {_NAMES[fault]}. Means and 95% intervals over learners.",
    )


EXPERIMENT = Experiment(name="faults_injected", plan=plan, report=report)
