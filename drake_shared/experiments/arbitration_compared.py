"""Compares arbitration methods on the same trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.statistics import (
    POINTS,
    Claim,
    Estimate,
    Question,
    at_least,
    interval,
    judge,
    larger,
    not_worse,
)
from drake_shared.arbitration.authority import Authority
from drake_shared.experiments.common import ALONE_COST, TRIAL_COST
from drake_shared.experiments.drawing import (
    BLACK,
    COLOURS,
    PURPLE,
    draw_interval,
    label_lines,
    marker_legend,
    new_figure,
    title_panel,
)
from drake_shared.experiments.measures import (
    COLLISIONS,
    HUMAN_EFFORT,
    INTENT_SUCCESS,
    Measure,
    by_learner,
    estimate,
)
from drake_shared.experiments.paired_trials import Condition, demonstrations_of, groups, run_conditions
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size, Table
from drake_shared.experiments.text import number, paragraphs, with_interval
from drake_shared.experiments.training import studied, train_all, training_cost
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.runner import Task

OPERATORS = ("primary", "unskilled", "switching")
ARMS: Mapping[str, SharedControlConfig] = {
    "human": SharedControlConfig(driver="human"),
    "agent": SharedControlConfig(driver="agent"),
    "halves": SharedControlConfig(arbitration="halves"),
    "traded": SharedControlConfig(arbitration="traded"),
    "blend": SharedControlConfig(authority=Authority(enabled=False)),
    "guarded": SharedControlConfig(),
}
_LABELS = {
    "human": "human alone",
    "agent": "agent alone",
    "halves": "constant weight 0.5",
    "traded": "traded control",
    "blend": "blend (paper)",
    "guarded": "blend with human authority",
}
ARMS_OF_LEARNERS: Mapping[str, Sequence[str]] = {
    "none": ("human",),
    "paper": ("agent", "halves", "traded", "blend"),
    "default": ("agent", "halves", "traded", "blend", "guarded"),
    "mixture": ("blend", "guarded"),
}
"""The arms of each kind of learner. The human alone needs no learner, and is the same for all."""
_NAMES = {"none": "no learner", "paper": "paper", "default": "default", "mixture": "mixture (default)"}
_STYLES = {
    "none": (BLACK, "o"),
    "paper": (COLOURS["paper"], "s"),
    "default": (COLOURS["default"], "o"),
    "mixture": (PURPLE, "D"),
}
MEASURES = (
    Measure("success", "success", "%", 100.0),
    INTENT_SUCCESS,
    COLLISIONS,
    HUMAN_EFFORT,
    Measure("disagreement_rate", "disagreement", "rad/s"),
    Measure("clearance", "least clearance", "m"),
    Measure("completion_time", "time", "s"),
    Measure("smoothness", "smoothness (SPARC)"),
)
_GROUP = 10
_MARGIN, _DISAGREEMENT, _GAIN = 2.0, 0.1, 10.0
_KEPT_SHARE = 0.9


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each kind of learner and ten learners."""
    return [
        PlannedTask(
            Task.of(run_arms, scenario=scenario, kind=kind, learners=learners, trials=size.trials),
            _seconds(kind, len(learners), size.trials * len(arms) * len(OPERATORS)),
        )
        for kind, arms in ARMS_OF_LEARNERS.items()
        for learners in groups(size.of(kind).learners, _GROUP)
    ]


def _seconds(kind: str, learners: int, trials: int) -> float:
    if kind == "none":
        return learners * ALONE_COST * trials
    if kind == "mixture":
        return learners * (2.0 + 1.5 * TRIAL_COST * trials)
    return training_cost(kind, learners) + learners * TRIAL_COST * trials


def run_arms(scenario: str | None, kind: str, learners: list[int], trials: int) -> list[dict[str, Any]]:
    """Runs trials of each operator in each arm of a kind of learner.

    Args:
        scenario: File or name.
        kind: "paper" or "default", CNMPs of that preset; "mixture", of preset "default"; or "none".
        learners: Indices, which determine demonstrations, trainings and trials.
        trials: Number of trials with each learner, operator and arm.
    """
    conditions = [
        Condition(
            columns={"arm": arm, "kind": kind, "operator": operator}, operator=operator, config=ARMS[arm]
        )
        for operator in OPERATORS
        for arm in ARMS_OF_LEARNERS[kind]
    ]
    trained = dict(zip(learners, _trained(scenario, kind, learners), strict=True))
    return run_conditions(scenario, trained, conditions, trials)


def _trained(scenario: str | None, kind: str, learners: Sequence[int]) -> list[Any]:
    if kind == "none":
        return [None] * len(learners)
    sets = demonstrations_of(scenario, learners)
    if kind != "mixture":
        return train_all(sets, learners, preset=kind)
    from drake_shared.learners.mixture.training import train_mixture

    return [
        train_mixture(one, seed=index, parameters=studied("default"))
        for one, index in zip(sets, learners, strict=True)
    ]


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """A figure and a table for each operator, and the claims."""
    rows = [row for result in results for row in result]
    alone = estimate(rows, INTENT_SUCCESS, arm="human", operator="unskilled")
    return Section(
        title="Arbitration compared",
        text=paragraphs("arbitration_compared", size=size, operators=OPERATORS, alone=alone),
        pictures=[_picture(rows, operator) for operator in OPERATORS],
        tables=[_table(rows, operator) for operator in OPERATORS],
        claims=claims(rows),
        data={"arbitration_compared": rows},
    )


def claims(rows: Rows) -> list[Claim]:
    """Compares mixture and CNMP in the same arm, and shared control with the unskilled operator alone."""
    return judge("arbitration", [*_mixture_questions(rows), *_gain_questions(rows)])


def _mixture_questions(rows: Rows) -> list[Question]:
    success = [
        not_worse(
            f"The mixture's intent success is at least the CNMP's minus {number(_MARGIN)} points (operator "
            f"{operator}, preset default)",
            100.0 * _main_arm(rows, "intent_success", "mixture", operator),
            100.0 * _main_arm(rows, "intent_success", "default", operator),
            margin=_MARGIN,
            unit="points",
            bounds=POINTS,
        )
        for operator in OPERATORS
    ]
    return success + [
        larger(
            f"The mixture disagrees less than the CNMP (operator {operator}, preset default)",
            _main_arm(rows, "disagreement_rate", "default", operator),
            _main_arm(rows, "disagreement_rate", "mixture", operator),
            smallest=_DISAGREEMENT,
            unit="rad/s",
        )
        for operator in OPERATORS
    ]


def _gain_questions(rows: Rows) -> list[Question]:
    alone = by_learner(rows, "intent_success", kind="none", operator="unskilled")
    found = []
    for kind in ("default", "paper"):
        shared = _main_arm(rows, "intent_success", kind, "unskilled")
        found.append(
            at_least(
                f"The unskilled operator's intent success is at least {number(_GAIN)} points higher in "
                f"shared control than alone (preset {kind})",
                100.0 * _gain(shared, alone),
                least=_GAIN,
                unit="points",
                bounds=POINTS,
                paired=True,
            )
        )
    gained, kept = (
        100.0 * (by_learner(rows, "intent_success", kind="default", operator="unskilled", arm=arm) - alone)
        for arm in ("blend", "guarded")
    )
    found.append(
        at_least(
            f"Human authority keeps at least {number(100.0 * _KEPT_SHARE)}% of the gain of the blend "
            f"({number(kept.mean())} of {number(gained.mean())} points of the unskilled operator's intent "
            "success, preset default; the estimate is the gain kept beyond that share)",
            kept - _KEPT_SHARE * gained,
            least=0.0,
            unit="points",
            bounds=(-190.0, 190.0),
        )
    )
    return found


def _main_arm(rows: Rows, measure: str, kind: str, operator: str) -> NDArray[np.float64]:
    """A measure by learner, in the arm for which learners of this kind are meant."""
    arm = "blend" if kind == "paper" else "guarded"
    return by_learner(rows, measure, kind=kind, operator=operator, arm=arm)


def _gain(shared: NDArray[np.float64], alone: NDArray[np.float64]) -> NDArray[np.float64]:
    """Differences over the learners that both arms have, which are the first ones."""
    count = min(len(shared), len(alone))
    return shared[:count] - alone[:count]


def _lines() -> list[tuple[str, str]]:
    return [(arm, kind) for arm in ARMS for kind, arms in ARMS_OF_LEARNERS.items() if arm in arms]


def _estimate(rows: Rows, measure: Measure, arm: str, kind: str, operator: str) -> Estimate:
    if measure is HUMAN_EFFORT and arm == "agent":
        return interval([])  # The commands of the operator have no effect there.
    return estimate(rows, measure, arm=arm, kind=kind, operator=operator)


def _picture(rows: Rows, operator: str) -> Picture:
    figure, axes = new_figure(4.6, rows=2, columns=4, sharey=True)
    label_lines(axes[0, 0], [_LABELS[arm].replace(" with ", "\nwith ") for arm in ARMS])
    for place, measure in zip(axes.flat, MEASURES, strict=True):
        for arm, kind in _lines():
            kinds = [one for one, arms in ARMS_OF_LEARNERS.items() if arm in arms]
            height = list(ARMS).index(arm) + 0.22 * (kinds.index(kind) - (len(kinds) - 1) / 2)
            colour, marker = _STYLES[kind]
            found = _estimate(rows, measure, arm, kind, operator)
            draw_interval(place, height, found, colour, marker=marker, markersize=3.5)
        title_panel(place, measure.title, measure.unit)
    marker_legend(figure, {_NAMES[kind]: style for kind, style in _STYLES.items()}, columns=4)
    return Picture.of(
        figure,
        f"Operator {operator}: means with 95% intervals over learners, by arbitration and learner. "
        "SPARC is closer to 0 for smoother motion.",
    )


def _table(rows: Rows, operator: str) -> Table:
    return Table(
        caption=f"Operator {operator}: means and 95% intervals over learners.",
        head=["arbitration", "learner", *(measure.label for measure in MEASURES)],
        rows=[
            [
                _LABELS[arm],
                _NAMES[kind],
                *(with_interval(_estimate(rows, measure, arm, kind, operator)) for measure in MEASURES),
            ]
            for arm, kind in _lines()
        ],
    )


EXPERIMENT = Experiment(name="arbitration_compared", plan=plan, report=report)
