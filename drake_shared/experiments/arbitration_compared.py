"""Ways to divide the control, compared on the same trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from drake_shared.analysis.statistics import Claim, at_least, claim, interval, not_worse, paired_claims
from drake_shared.arbitration.authority import Authority
from drake_shared.experiments.common import (
    ALONE_COST,
    TRIAL_COST,
    measured,
    run,
    studied,
    train_all,
    training_cost,
)
from drake_shared.experiments.drawing import BLACK, COLOURS, PURPLE, legend_below, new_figure
from drake_shared.experiments.paired_trials import by_learner, groups, settings, taught
from drake_shared.experiments.report import number, with_interval
from drake_shared.experiments.section import Experiment, Picture, Section, Size, Table
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
LABELS = {
    "human": "human alone",
    "agent": "agent alone",
    "halves": "fixed halves",
    "traded": "traded control",
    "blend": "blend (paper)",
    "guarded": "blend, human kept in charge",
}
# Who takes part in which arms: the human alone needs no learner, and is the same for all.
_LEARNERS: Mapping[str, Sequence[str]] = {
    "none": ("human",),
    "paper": ("agent", "halves", "traded", "blend"),
    "default": ("agent", "halves", "traded", "blend", "guarded"),
    "mixture": ("blend", "guarded"),
}
_NAMES = {"none": "no learner", "paper": "paper", "default": "default", "mixture": "mixture (default)"}
_STYLES = {
    "none": (BLACK, "o"),
    "paper": (COLOURS["paper"], "s"),
    "default": (COLOURS["default"], "o"),
    "mixture": (PURPLE, "D"),
}
_MEASURES = {
    "success": ("success", "%", 100.0),
    "intent_success": ("intent success", "%", 100.0),
    "collision": ("collisions", "%", 100.0),
    "human_effort": ("human effort", "rad", 1.0),
    "disagreement_rate": ("disagreement", "rad/s", 1.0),
    "clearance": ("least clearance", "m", 1.0),
    "completion_time": ("time", "s", 1.0),
    "smoothness": ("smoothness (SPARC)", "1", 1.0),
}
_GROUP = 10
_POINTS, _DISAGREEMENT, _HELP = 2.0, 0.1, 10.0
_KEPT = 0.9
"""Share of the gain."""


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """One for each kind of learner and ten learners of it."""
    return [
        Task(
            "drake_shared.experiments.arbitration_compared:run_arms",
            {"scenario": scenario, "kind": kind, "learners": learners, "trials": size.trials},
        )
        for kind in _LEARNERS
        for learners in groups(size.learners, _GROUP)
    ]


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    kind, learners = task.arguments["kind"], len(task.arguments["learners"])
    trials = task.arguments["trials"] * len(_LEARNERS[kind]) * len(OPERATORS)
    if kind == "none":
        return learners * ALONE_COST * trials
    if kind == "mixture":
        return learners * (2.0 + 1.5 * TRIAL_COST * trials)
    return training_cost(kind, learners) + learners * TRIAL_COST * trials


def run_arms(scenario: str | None, kind: str, learners: list[int], trials: int) -> list[dict[str, Any]]:
    """Trials of each operator in each arm that learners of this kind take part in.

    Args:
        scenario: File or name.
        kind: "paper" or "default", CNMPs of that preset; "mixture", of preset "default"; or "none".
        learners: Their indices; they fix demonstrations, trainings and trials.
        trials: With each learner, operator and arm.
    """
    return [
        measured(
            run(scenario, learner, config=ARMS[arm], **settings(scenario, operator, index, trial)),
            arm=arm,
            kind=kind,
            operator=operator,
            learner=index,
        )
        for index, learner in zip(learners, _trained(scenario, kind, learners), strict=True)
        for operator in OPERATORS
        for arm in _LEARNERS[kind]
        for trial in range(trials)
    ]


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """A figure and a table for each operator, and the claims."""
    rows = [row for result in results for row in result]
    alone = interval(100.0 * by_learner(rows, "intent_success", arm="human", operator="unskilled"))
    return Section(
        title="Arbitration compared",
        text=[
            "Who divides the control, and what comes of it, on the same trials: the human alone, the agent "
            "alone, half of each command always, traded control (the agent drives while its confidence is "
            "above a threshold, the human below), the blend of the paper by eq. (2), and that blend with "
            "what this package adds so that the human stays in charge. CNMPs of both presets take part, and "
            "the mixture learner, an expert for each way that was shown.",
            f"{size.learners} learners of each kind, each taught by demonstrations of its own, and "
            f"{size.trials} trials with each of the simulated operators {', '.join(OPERATORS)}, in every arm "
            "with the same routes and seeds. Intervals are 95% bootstrap over learners; those of claims are "
            "adjusted for the number of operators or presets asked about. The agent alone does not know "
            "which route is meant, so that its intent success is what chance makes it; no command of the "
            "operator counts there, and its effort is left out.",
            f"The unskilled operator alone succeeds in {number(alone.mean)}% of trials "
            f"[{number(alone.low)}, {number(alone.high)}], {_within(alone.mean)} the 70 to 85% for which its "
            "noise was set.",
        ],
        pictures=[_picture(rows, operator) for operator in OPERATORS],
        tables=[_table(rows, operator) for operator in OPERATORS],
        claims=claims(rows),
        data={"arbitration_compared": rows},
    )


def claims(rows: Sequence[Mapping[str, Any]]) -> list[Claim]:
    """The mixture against the CNMP in the same arm, and the unskilled operator's gain from sharing.

    Of that gain also what is kept where the human is kept in charge.
    """
    # Bonferroni's, for the questions that are asked together.
    level = 1.0 - 0.05 / len(OPERATORS)
    found = [
        not_worse(
            f"The mixture's intent success is at least the CNMP's less {number(_POINTS)} points (operator "
            f"{operator}, preset default)",
            100.0
            * (
                _of(rows, "intent_success", "mixture", operator)
                - _of(rows, "intent_success", "default", operator)
            ),
            margin=_POINTS,
            unit="points",
            level=level,
        )
        for operator in OPERATORS
    ]
    found += paired_claims(
        [
            {
                "text": f"The mixture disagrees less than the CNMP (operator {operator}, preset default)",
                "one": _of(rows, "disagreement_rate", "default", operator),
                "other": _of(rows, "disagreement_rate", "mixture", operator),
                "smallest": _DISAGREEMENT,
                "unit": "rad/s",
            }
            for operator in OPERATORS
        ]
    )
    alone = by_learner(rows, "intent_success", kind="none", operator="unskilled")
    found += [
        at_least(
            f"The unskilled operator's intent success is at least {number(_HELP)} points higher in shared "
            f"control than alone, with the whole interval above 0 (preset {kind})",
            100.0 * (_of(rows, "intent_success", kind, "unskilled") - alone),
            least=_HELP,
            unit="points",
            level=0.975,
        )
        for kind in ("default", "paper")
    ]
    gained, kept = (
        100.0 * (by_learner(rows, "intent_success", kind="default", operator="unskilled", arm=arm) - alone)
        for arm in ("blend", "guarded")
    )
    found.append(
        claim(
            f"Keeping the human in charge keeps at least {number(100.0 * _KEPT)}% of what the blend gains "
            f"({number(kept.mean())} of {number(gained.mean())} points of the unskilled operator's intent "
            "success, preset default; the number is what is kept beyond that share)",
            kept - _KEPT * gained,
            smallest=0.0,
            unit="points",
        )
    )
    return found


def _of(rows: Sequence[Mapping[str, Any]], measure: str, kind: str, operator: str) -> Any:
    """By learner, in the arm that learners of this kind are meant for."""
    arm = "blend" if kind == "paper" else "guarded"
    return by_learner(rows, measure, kind=kind, operator=operator, arm=arm)


def _trained(scenario: str | None, kind: str, learners: Sequence[int]) -> list[Any]:
    if kind == "none":
        return [None] * len(learners)
    sets = [taught(scenario, index) for index in learners]
    if kind != "mixture":
        return train_all(sets, learners, preset=kind)
    from drake_shared.learners.mixture.training import train_mixture

    return [
        train_mixture(one, seed=index, parameters=studied("default"))
        for one, index in zip(sets, learners, strict=True)
    ]


def _arms() -> list[tuple[str, str]]:
    return [(arm, kind) for arm in ARMS for kind, arms in _LEARNERS.items() if arm in arms]


def _estimate(rows: Sequence[Mapping[str, Any]], measure: str, arm: str, kind: str, operator: str) -> Any:
    # Nobody feels the effort of commands that go nowhere.
    silent = measure == "human_effort" and arm == "agent"
    values = by_learner(rows, measure, arm=arm, kind=kind, operator=operator)
    return interval([] if silent else _MEASURES[measure][2] * values)


def _picture(rows: Sequence[Mapping[str, Any]], operator: str) -> Picture:
    figure, axes = new_figure(4.6, rows=2, columns=4, sharey=True)
    names = list(ARMS)
    for place, (measure, (title, unit, _)) in zip(axes.flat, _MEASURES.items(), strict=True):
        for arm, kind in _arms():
            sharing = [one for one, arms in _LEARNERS.items() if arm in arms]
            offset = 0.22 * (sharing.index(kind) - (len(sharing) - 1) / 2)
            found = _estimate(rows, measure, arm, kind, operator)
            colour, marker = _STYLES[kind]
            place.errorbar(
                [found.mean],
                [names.index(arm) + offset],
                xerr=[[found.mean - found.low], [found.high - found.mean]],
                color=colour,
                marker=marker,
                markersize=3.5,
                capsize=2,
                linewidth=1.2,
            )
        place.set_title(title, fontsize=9)
        place.set_xlabel("" if unit == "1" else unit, fontsize=8)
        place.grid(axis="y", color="0.93")
        place.set_axisbelow(True)
        if unit == "%":
            place.set_xlim(-5, 105)
    axes[0, 0].set_yticks(range(len(names)), [LABELS[arm].replace(", ", ",\n") for arm in names], fontsize=8)
    axes[0, 0].invert_yaxis()
    handles = [
        axes[0, 0].plot([], [], color=colour, marker=marker, linestyle="", markersize=4, label=_NAMES[kind])[
            0
        ]
        for kind, (colour, marker) in _STYLES.items()
    ]
    legend_below(figure, handles, columns=4)
    return Picture.of(
        figure,
        f"Operator {operator}: means with 95% bootstrap intervals over learners, by who divides the control "
        "and by learner. SPARC is nearer 0 where the speed is smoother.",
    )


def _table(rows: Sequence[Mapping[str, Any]], operator: str) -> Table:
    cells = []
    for arm, kind in _arms():
        estimates = [_estimate(rows, measure, arm, kind, operator) for measure in _MEASURES]
        cells.append(
            [
                LABELS[arm],
                _NAMES[kind],
                *(with_interval(one) if one.count else "–" for one in estimates),
            ]
        )
    head = [title if unit == "1" else f"{title}, {unit}" for title, unit, _ in _MEASURES.values()]
    return Table(
        caption=f"Operator {operator}: means and 95% bootstrap intervals over learners.",
        head=["control", "learner", *head],
        rows=cells,
    )


def _within(share: float) -> str:
    return "within" if 70.0 <= share <= 85.0 else "outside"


EXPERIMENT = Experiment(name="arbitration_compared", tasks=tasks, cost=cost, report=report)
