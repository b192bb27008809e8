"""Fig. 6: do shared runs make a better second training set than runs of the human alone?"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from drake_shared.demonstrations import Demonstration
from drake_shared.engine import Task
from drake_shared.errors import RunError
from drake_shared.experiments.drawing import COLOURS, new_figure
from drake_shared.experiments.report import number
from drake_shared.experiments.section import Experiment, Picture, Section, Size, Table
from drake_shared.experiments.setting import (
    TRIAL_COST,
    as_demonstrations,
    drives,
    measured,
    run,
    scenario_of,
    train_all,
    training_cost,
)
from drake_shared.experiments.statistics import Claim, holm, holm_levels, paired, verdict
from drake_shared.operators import OPERATORS, changes_of_route

PRESETS = ("paper", "default")
PRIMARY_OPERATOR = "primary"
PRIMARY_ARM = "weighted, K kept"
"""Named before any of it was run: the paper weights by score, and tuned K by hand, once."""
ARMS = {
    "weighted, K kept": (True, True),
    "weighted, K anew": (True, False),
    "even, K kept": (False, True),
    "even, K anew": (False, False),
}
"""Name to whether scores weigh the demonstrations, and whether K of the first learner is kept."""
SETUPS = ("shared", "human", "more")
"""Setup 1, Setup 2, and the control: as many more demonstrations of the first kind."""
SMALLEST = {
    "disagreement": 20.0,
    "mean_human_weight": 0.02,
    "intent_success": 0.02,
    "human_effort": 2.0,
    "clearance": 0.01,
}
"""Smallest effects of interest: about 4% of what is usual in a trial, and two trials in a hundred."""
UNITS = {
    "disagreement": "rad/s",
    "mean_human_weight": "",
    "intent_success": "",
    "human_effort": "rad",
    "clearance": "m",
}
_GROUP = 10
"""Repeats in a task: their learners are trained side by side."""
_ADDED = 3
# Seeds of repeat k begin at k times this, in ranges of their own for each purpose.
_STRIDE = 100
_BASE, _RUNS, _MORE, _TRIALS = 0, 10, 30, 50


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """Groups of repeats, for each preset and operator."""
    made = []
    arms = list(ARMS) if size.all_arms else [PRIMARY_ARM]
    for preset in PRESETS:
        plan = {PRIMARY_OPERATOR: (size.repeats, arms, SETUPS if size.all_arms else SETUPS[:2])}
        for operator in OPERATORS:
            if operator != PRIMARY_OPERATOR and size.other_repeats:
                plan[operator] = (size.other_repeats, [PRIMARY_ARM], SETUPS[:2])
        for operator, (repeats, own_arms, setups) in plan.items():
            for first in range(0, repeats, _GROUP):
                arguments = {
                    "scenario": scenario,
                    "preset": preset,
                    "operator": operator,
                    "repeats": list(range(first, min(first + _GROUP, repeats))),
                    "arms": own_arms,
                    "setups": list(setups),
                    "trials": 10,
                }
                made.append(Task("drake_shared.experiments.second_learners:run_repeats", arguments))
    return made


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    given = task.arguments
    repeats = len(given["repeats"])
    weightings = len({ARMS[arm][0] for arm in given["arms"]})
    trials = 9 + given["trials"] * len(given["arms"]) * len(given["setups"])
    training = training_cost(given["preset"], repeats)
    training += training_cost(given["preset"], repeats * weightings * len(given["setups"]))
    return training + TRIAL_COST * trials * repeats


def run_repeats(
    scenario: str | None,
    preset: str,
    operator: str,
    repeats: Sequence[int],
    arms: Sequence[str],
    setups: Sequence[str],
    trials: int,
) -> list[dict[str, Any]]:
    """Repeats side by side; a row for each trial, and one that says so for each repeat that failed.

    A repeat is: three base demonstrations by the primary operator alone; a first learner; three more drives
    of the operator under study, in shared control with that learner (Setup 1) and alone (Setup 2), on the
    same routes and noise seeds, and three more of the first kind; second learners; trials with each, on the
    same routes and seeds.
    """
    world = scenario_of(scenario)
    behaviour = OPERATORS[operator].behaviour_in(world)
    switches = OPERATORS[operator].switches
    base = [drives(scenario, count=_ADDED, seed=_seed(repeat, _BASE)) for repeat in repeats]
    first = train_all([as_demonstrations(scenario, items) for items in base], list(repeats), preset=preset)
    rows: list[dict[str, Any]] = []
    lessons, places = [], []
    for place, repeat in enumerate(repeats):
        told = {"preset": preset, "operator": operator, "repeat": repeat}
        try:
            added = _added(scenario, first[place], repeat, behaviour, setups)
        except RunError as error:
            rows.append({**told, "failed": str(error)})
            continue
        for setup in setups:
            for weighted in sorted({ARMS[arm][0] for arm in arms}):
                lessons.append((as_demonstrations(scenario, base[place] + added[setup]), repeat, weighted))
                places.append((place, setup, weighted))
    trained = train_all(
        [one for one, _, _ in lessons],
        [seed for _, seed, _ in lessons],
        preset=preset,
        weighted=[weighted for _, _, weighted in lessons],
    )
    second = dict(zip(places, trained, strict=True))
    changes: list[tuple[Any, Any]] = [(route, None) for route in world.routes]
    if switches:
        changes = list(changes_of_route(world))
    for (place, setup, weighted), learner in second.items():
        for arm in arms:
            if ARMS[arm][0] != weighted:
                continue
            for index in range(trials):
                route, then = changes[index % len(changes)]
                trial = run(
                    scenario,
                    learner,
                    route=route.name,
                    then=None if then is None else then.name,
                    seed=_seed(repeats[place], _TRIALS) + index,
                    behaviour=behaviour,
                    confidence_gain=first[place].confidence_gain if ARMS[arm][1] else None,
                )
                told = {"preset": preset, "operator": operator, "repeat": repeats[place]}
                rows.append(measured(trial, **told, setup=setup, arm=arm))
    return rows


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """The paper's pair of bars, the paired differences, and what the paper did not look at."""
    rows = [row for result in results for row in result]
    failed = [row for row in rows if "failed" in row]
    rows = [row for row in rows if "failed" not in row]
    means = repeat_means(rows)
    cells = sorted({key[:3] for key in means}, key=_order)
    claims = _claims(means, cells)
    primary = [claim for claim in claims if claim[0][1:] == (PRIMARY_OPERATOR, PRIMARY_ARM)]
    counts = {cell: len(_pairs(means, cell)) for cell in cells}
    text = [
        "The paper adds three shared runs (Setup 1) or three runs of the human alone (Setup 2) to the "
        "demonstrations, trains a second learner on each, and finds less disagreement and slightly less "
        "human weight with Setup 1: one operator, one pair of learners, 10 trials each.",
        "Here the unit is a repeat: base demonstrations, first learner, both added sets on the same routes, "
        "noise seeds and scores, second learners, and 10 trials with each averaged. "
        f"{max(counts.values())} repeats of the primary operator for each preset; the arm of the primary "
        f"inference, “{PRIMARY_ARM}”, was named in the code beforehand. Intervals are 95% by bootstrap over "
        "repeats, made wider by Holm's method over operators, arms and both metrics of a preset.",
    ]
    if not size.all_arms:
        text.append("Of this quick run the other operators, arms and the control are left out.")
    else:
        text.append(
            "Base demonstrations are always the primary operator's. The control (three more of them) is part "
            "of the primary operator's repeats alone, where it differs from Setup 2 by its seeds only."
        )
    if failed:
        who = sorted({f"{row['operator']} ({row['preset']})" for row in failed})
        text.append(
            f"{len(failed)} repeats are missing, because the operator did not reach the goal in any of many "
            f"attempts to drive a route: {', '.join(who)}."
        )
    return Section(
        title="Fig. 6: the second learner",
        text=text,
        pictures=[
            _bars(rows),
            _forest(
                [(cell, claim) for cell, name, claim in claims if name == "disagreement"], "disagreement"
            ),
            _forest(
                [(cell, claim) for cell, name, claim in claims if name == "mean_human_weight"],
                "mean_human_weight",
            ),
        ],
        tables=[_means_table(means, cells)],
        claims=[claim for _, _, claim in primary],
        data={
            "second_learners_trials": rows,
            "second_learners_claims": [
                {
                    "preset": cell[0],
                    "operator": cell[1],
                    "arm": cell[2],
                    "metric": name,
                    **dataclasses.asdict(claim.estimate),
                    "p": claim.p,
                    "effect": claim.effect,
                    "verdict": claim.verdict,
                }
                for cell, name, claim in claims
            ],
        },
    )


def repeat_means(rows: Sequence[dict[str, Any]]) -> dict[tuple[str, str, str, int], dict[str, Any]]:
    """For each preset, operator, arm and repeat: setup to the means of its trials' measures."""
    grouped: dict[tuple[str, str, str, int], dict[str, list[dict[str, Any]]]] = {}
    for row in rows:
        key = (row["preset"], row["operator"], row["arm"], row["repeat"])
        grouped.setdefault(key, {}).setdefault(row["setup"], []).append(row)
    return {
        key: {
            setup: {name: float(np.mean([row[name] for row in trials])) for name in SMALLEST}
            for setup, trials in setups.items()
        }
        for key, setups in grouped.items()
    }


def _added(
    scenario: str | None, learner: Any, repeat: int, behaviour: Any, setups: Sequence[str]
) -> dict[str, list[Demonstration]]:
    """Three more demonstrations for each setup; those of one route have the same score in every setup."""
    seed = _seed(repeat, _RUNS)
    made = {
        "shared": drives(scenario, learner=learner, count=_ADDED, seed=seed, behaviour=behaviour),
        "human": drives(scenario, count=_ADDED, seed=seed, behaviour=behaviour),
    }
    if "more" in setups:
        made["more"] = drives(scenario, count=_ADDED, seed=_seed(repeat, _MORE))
    for index in range(_ADDED):
        score = float(np.mean([made[setup][index].score for setup in ("shared", "human")]))
        for items in made.values():
            items[index] = dataclasses.replace(items[index], score=score)
    return made


def _seed(repeat: int, purpose: int) -> int:
    return 2_000_000 + repeat * _STRIDE + purpose


def _order(cell: tuple[str, str, str]) -> tuple[int, int, int]:
    return PRESETS.index(cell[0]), list(OPERATORS).index(cell[1]), list(ARMS).index(cell[2])


def _pairs(means: dict, cell: tuple[str, str, str]) -> list[dict[str, Any]]:
    """The repeats of a cell that have both setups."""
    found = [setups for key, setups in sorted(means.items()) if key[:3] == cell]
    return [setups for setups in found if {"shared", "human"} <= set(setups)]


def _claims(means: dict, cells: Sequence[tuple[str, str, str]]) -> list[tuple[Any, str, Claim]]:
    """Of each cell and metric: Setup 2 minus Setup 1, adjusted over all of a preset and kind of metric."""
    claims = []
    for preset in PRESETS:
        own = [cell for cell in cells if cell[0] == preset]
        for names in (("disagreement", "mean_human_weight"), ("intent_success", "human_effort", "clearance")):
            questions = [(cell, name) for cell in own for name in names]
            samples = [
                [
                    np.array([setups[setup][name] for setup in ("human", "shared")])
                    for setups in _pairs(means, cell)
                ]
                for cell, name in questions
            ]
            found = [paired(*np.transpose(sample)) for sample in samples]
            p = [one.p for one in found]
            for question, sample, adjusted, level in zip(
                questions, samples, holm(p), holm_levels(p), strict=True
            ):
                cell, name = question
                widened = paired(*np.transpose(sample), level=level)
                claims.append(
                    (
                        cell,
                        name,
                        Claim(
                            text=f"{name.replace('_', ' ')} is lower with Setup 1 than with Setup 2 "
                            f"({cell[0]}, {cell[1]} operator, {cell[2]})",
                            estimate=widened.estimate,
                            smallest=SMALLEST[name],
                            unit=UNITS[name],
                            verdict=verdict(widened.estimate, SMALLEST[name]),
                            p=adjusted,
                            effect=widened.effect,
                        ),
                    )
                )
    return claims


def _bars(rows: Sequence[dict[str, Any]]) -> Picture:
    """As the paper did it: one pair of learners, ten trials each."""
    figure, axes = new_figure(3.0, columns=2)
    names = {"disagreement": "disagreement, rad/s", "mean_human_weight": "mean human weight"}
    for place, (name, label) in zip(axes, names.items(), strict=True):
        for offset, preset in enumerate(PRESETS):
            for position, setup in enumerate(("shared", "human")):
                values = [
                    row[name]
                    for row in rows
                    if (row["preset"], row["operator"], row["arm"], row["repeat"], row["setup"])
                    == (preset, PRIMARY_OPERATOR, PRIMARY_ARM, 0, setup)
                ]
                if values:
                    place.bar(
                        position + 0.36 * (offset - 0.5),
                        np.mean(values),
                        0.34,
                        yerr=np.std(values),
                        capsize=3,
                        color=COLOURS[preset],
                        label=f"preset {preset}" if position == 0 else None,
                    )
        place.set_xticks([0, 1], ["Setup 1: shared runs", "Setup 2: human runs"])
        place.set_ylabel(label)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False, fontsize=9)
    return Picture.of(
        figure,
        "As the paper did it: the first repeat alone, one pair of learners for each preset, 10 trials each. "
        "Bars are means, whiskers standard deviations. One pair says nothing about another.",
    )


def _forest(found: Sequence[tuple[tuple[str, str, str], Claim]], name: str) -> Picture:
    """Paired differences with their intervals, and the zone in which they would not matter."""
    figure, place = new_figure(1.0 + 0.24 * len(found))
    smallest = SMALLEST[name]
    place.axvspan(-smallest, smallest, color="0.92", zorder=0)
    place.axvline(0.0, color="0.5", linewidth=0.8)
    for line, (cell, claim) in enumerate(reversed(found)):
        one = claim.estimate
        place.plot([one.low, one.high], [line, line], color=COLOURS[cell[0]], linewidth=1.5)
        place.plot(one.mean, line, marker="o", markersize=4, color=COLOURS[cell[0]])
    labels = [f"{cell[0]}, {cell[1]}: {cell[2]}" for cell, _ in reversed(found)]
    place.set_yticks(range(len(found)), labels, fontsize=8)
    unit = f", {UNITS[name]}" if UNITS[name] else ""
    place.set_xlabel(f"{name.replace('_', ' ')}{unit}: Setup 2 minus Setup 1 (right: the paper's direction)")
    return Picture.of(
        figure,
        f"Paired differences in {name.replace('_', ' ')} over repeats, with adjusted 95% intervals. Shaded: "
        "smaller than the smallest effect of interest. Blue: preset default; orange: preset paper.",
    )


def _means_table(means: dict, cells: Sequence[tuple[str, str, str]]) -> Table:
    head = ["preset", "operator", "arm", "repeats", "setup"]
    head += [f"{name.replace('_', ' ')}{f', {UNITS[name]}' if UNITS[name] else ''}" for name in SMALLEST]
    rows = []
    for cell in cells:
        found = _pairs(means, cell)
        for setup in SETUPS:
            values = [setups[setup] for setups in found if setup in setups]
            if values:
                averages = [np.mean([value[name] for value in values]) for name in SMALLEST]
                rows.append([*cell, str(len(values)), setup, *map(_shown, averages)])
    return Table(
        caption="Means over repeats. Setup 1 is “shared”, Setup 2 “human”, the control “more”.",
        head=head,
        rows=rows,
    )


def _shown(value: float) -> str:
    return "–" if math.isnan(value) else number(value)


EXPERIMENT = Experiment(name="second_learners", tasks=tasks, cost=cost, report=report)
