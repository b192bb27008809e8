"""Faults on purpose: what each of them costs, by how bad it is, assisted and not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import Claim, Estimate, interval, never, not_worse
from drake_shared.experiments.common import (
    ALONE_COST,
    TRIAL_COST,
    measured,
    simulation_of,
    train_all,
    training_cost,
)
from drake_shared.experiments.drawing import COLOURS, draw_curve, legend_below, new_figure
from drake_shared.experiments.paired_trials import by_learner, groups, settings, taught
from drake_shared.experiments.report import number, with_interval
from drake_shared.experiments.section import Experiment, Picture, Section, Size, Table
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.faults import Faults
from drake_shared.simulation.runner import Task
from drake_shared.simulation.trial import Trial, TrialSettings

PRESET, OPERATOR = "default", "primary"
ARMS = {"alone": "human alone", "assisted": "shared control"}
_COLOURS = {"alone": COLOURS["human"], "assisted": COLOURS["shared"]}
_FREEZE_TIME = 3.0
# Each with its severities; that of no fault, 0, comes before them.
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
_NAMES = {
    "delay": "the human's command is late by, s",
    "jitter": "each sample of it is late by up to, s",
    "loss": "share of its samples lost",
    "freeze": f"it freezes at {_FREEZE_TIME:g} s, for s",
    "human_nan": "share of its samples NaN",
    "pose_noise": "noise of the pose seen, m and rad",
    "pose_drift": "drift of the pose seen after 1 s, m",
    "pose_nan": "share of poses seen NaN",
    "slip": "largest share lost to slip",
    "late_learner": "the learner is late by, s",
    "learner_nan": "share of predictions NaN",
}
_MEASURES = {
    "intent_success": ("intent success, %", 100.0),
    "collision": ("collisions, %", 100.0),
    "human_effort": ("human effort, rad", 1.0),
    "mean_human_weight": ("mean human weight", 1.0),
}
# What the plant is told, through slipping wheels or not, and what it holds.
_PLANT = (
    *("shared_left", "shared_right", "slipped_left", "slipped_right"),
    *("x", "y", "yaw", "wheel_left", "wheel_right"),
)
_MARGIN = 5.0
# Three trials take each route of the shipped scenarios once.
_GROUP, _TRIALS = 5, 3


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """One for five learners each; a quick run takes the worst severities alone."""
    return [
        Task(
            "drake_shared.experiments.faults_injected:run_faults",
            {
                "scenario": scenario,
                "learners": learners,
                "trials": min(size.trials, _TRIALS),
                "severities": _severities(size),
            },
        )
        for learners in groups(size.learners, _GROUP)
    ]


def _severities(size: Size) -> dict[str, list[float]]:
    return {name: list(values if size.all_arms else values[-1:]) for name, values in FAULTS.items()}


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    told = task.arguments
    learners, cases = len(told["learners"]), 1 + sum(map(len, told["severities"].values()))
    return training_cost(PRESET, learners) + learners * told["trials"] * cases * (ALONE_COST + TRIAL_COST)


def run_faults(
    scenario: str | None, learners: list[int], trials: int, severities: dict[str, list[float]]
) -> list[dict[str, Any]]:
    """Trials with each fault and severity, and with none, assisted and alone, on the same routes and seeds.

    Args:
        scenario: File or name.
        learners: Their indices; they fix demonstrations, trainings and trials.
        trials: With each learner, severity and arm.
        severities: Of each fault, without 0.
    """
    sets = [taught(scenario, index) for index in learners]
    trained = train_all(sets, learners, preset=PRESET)
    rows = []
    for fault, severity in [
        ("", 0.0),
        *((name, one) for name, values in severities.items() for one in values),
    ]:
        config = SharedControlConfig(faults=faults_of(fault, severity))
        simulation = simulation_of(scenario, config)
        for arm in arms_of(fault):
            for index, learner in zip(learners, trained, strict=True):
                for trial in range(trials):
                    given = TrialSettings(**settings(scenario, OPERATOR, index, trial))
                    driven = simulation.run(given, learner=None if arm == "alone" else learner)
                    rows.append(
                        measured(
                            driven,
                            fault=fault,
                            severity=severity,
                            arm=arm,
                            learner=index,
                            not_finite=not_finite(driven),
                        )
                    )
    return rows


def faults_of(fault: str, severity: float) -> Faults:
    """The faults to inject; none if ``fault`` is empty."""
    if not fault:
        return Faults()
    more = {"freeze": {"freeze_time": _FREEZE_TIME}, "pose_noise": {"yaw_noise": severity}}.get(fault, {})
    return Faults(**{fault: severity, **more})


def arms_of(fault: str) -> tuple[str, ...]:
    """A learner that fails is nothing to a human who is alone."""
    return ("assisted",) if "learner" in fault else tuple(ARMS)


def not_finite(trial: Trial) -> int:
    """Rows of the log in which something that the plant is told or holds is no finite number."""
    logged = [trial[name] for name in _PLANT if name in trial.columns]
    return int((~np.isfinite(logged)).any(axis=0).sum())


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Curves over severity, a table for each fault, and the claims."""
    rows = [row for result in results for row in result]
    severities = {name: (0.0, *values) for name, values in _severities(size).items()}
    return Section(
        title="Faults on purpose",
        text=[
            "What goes wrong between human, learner, robot and ground, one thing at a time: the human's "
            "command is late, jitters, is lost, freezes or is NaN; the pose that agent and operator see is "
            "noisy, drifts or is NaN; wheels slip; what the learner says is late or NaN. Each can be had in "
            "any trial by drake-shared simulate --fault.",
            f"{size.learners} learners of preset {PRESET} with its usual authority, and "
            f"{min(size.trials, _TRIALS)} trials with each of the simulated operator {OPERATOR}, assisted "
            "and alone on the same routes, with the same noise and the same faults. A learner that fails is "
            "nothing to a human who is alone: there the comparison is the human alone without a fault. "
            "Intervals are 95% bootstrap over learners; those of claims are adjusted for their number.",
        ],
        pictures=[
            Picture.of(
                _curves(rows, severities),
                "Intent success over how bad each fault is: means over learners with 95% intervals.",
            )
        ],
        tables=[_table(rows, fault, values) for fault, values in severities.items()],
        claims=claims(rows),
        data={"faults": rows},
    )


def claims(rows: Sequence[Mapping[str, Any]]) -> list[Claim]:
    """At its worst no fault makes assistance cost success, and what is no number never reaches the plant."""
    worst = {row["fault"]: row["severity"] for row in sorted(rows, key=lambda row: row["severity"])}
    found = [
        not_worse(
            f"Assistance does not lower intent success by {number(_MARGIN)} points: "
            f"{_NAMES[fault]}: {number(worst[fault])}",
            100.0
            * (
                _values(rows, "intent_success", fault, worst[fault], "assisted")
                - _values(rows, "intent_success", fault, worst[fault], "alone")
            ),
            margin=_MARGIN,
            unit="points",
            level=1.0 - 0.05 / len(FAULTS),
        )
        for fault in FAULTS
    ]
    sent = [
        {"learner": row["learner"], "reached": row["not_finite"] > 0}
        for row in rows
        if row["fault"].endswith("_nan")
    ]
    found.append(
        never(
            f"What is no number never reaches the plant, as a command or as its state (preset {PRESET}; the "
            "number is the share of trials with NaN from human, pose or learner, negative): it did in "
            f"{sum(row['reached'] for row in sent)} of {len(sent)} trials",
            by_learner(sent, "reached"),
        )
    )
    return found


def _values(
    rows: Sequence[Mapping[str, Any]], measure: str, fault: str, severity: float, arm: str
) -> np.ndarray:
    if severity == 0.0 or arm not in arms_of(fault):
        fault, severity = "", 0.0
    return by_learner(rows, measure, fault=fault, severity=severity, arm=arm)


def _estimate(rows: Sequence[Mapping[str, Any]], measure: str, *which: Any) -> Estimate:
    return interval(_MEASURES[measure][1] * _values(rows, measure, *which))


def _curves(rows: Sequence[Mapping[str, Any]], severities: Mapping[str, Sequence[float]]) -> Any:
    columns = 3
    figure, axes = new_figure(7.6, rows=-(-len(severities) // columns), columns=columns, sharey=True)
    for place, (fault, values) in zip(axes.flat, severities.items(), strict=False):
        for arm, words in ARMS.items():
            found = [_estimate(rows, "intent_success", fault, value, arm) for value in values]
            draw_curve(place, values, found, _COLOURS[arm], words, linestyle="--" if arm == "alone" else "-")
        place.set_xlabel(_NAMES[fault], fontsize=8)
        place.set_xticks(values)
        place.set_ylim(-3, 103)
    for place in axes.flat[len(severities) :]:
        place.set_visible(False)
    for place in axes[:, 0]:
        place.set_ylabel("intent success, %", fontsize=8)
    handles = axes.flat[0].get_legend_handles_labels()
    legend_below(figure, *handles, columns=2)
    return figure


def _table(rows: Sequence[Mapping[str, Any]], fault: str, severities: Sequence[float]) -> Table:
    return Table(
        caption=f"By how bad it is: {_NAMES[fault]}. Means and 95% bootstrap intervals over learners.",
        head=["severity", "control", *(title for title, _ in _MEASURES.values())],
        rows=[
            [
                number(severity),
                ARMS[arm],
                *(with_interval(_estimate(rows, measure, fault, severity, arm)) for measure in _MEASURES),
            ]
            for severity in severities
            for arm in (ARMS if severity == 0.0 else arms_of(fault))
        ],
    )


EXPERIMENT = Experiment(name="faults_injected", tasks=tasks, cost=cost, report=report)
