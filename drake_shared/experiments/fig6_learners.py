"""Fig. 6: do shared runs make a better second training set than runs of the human alone?

Seeds: those of repeat k begin at 2 000 000 + 100 k, the base demonstrations' at 0, the added drives' at 10,
the control's at 30 and the trials' at 50 after that; all learners of repeat k are trained from seed k. Drives
that are repeated take seeds beyond a million more.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import Claim
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration
from drake_shared.experiments.common import (
    TRIAL_COST,
    as_demonstrations,
    drives,
    measured,
    run,
    scenario_of,
    train_all,
    training_cost,
)
from drake_shared.experiments.fig6_comparison import (
    ARMS,
    MEASURES,
    PRESETS,
    PRIMARY_ARM,
    PRIMARY_OPERATOR,
    SETUPS,
    Compared,
    Means,
    compare,
    repeat_means,
)
from drake_shared.experiments.fig6_figures import (
    amount,
    bars,
    difference_table,
    forest,
    means_table,
    named,
    spread,
)
from drake_shared.experiments.paired_trials import groups
from drake_shared.experiments.report import number
from drake_shared.experiments.section import Experiment, Section, Size
from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.named import OPERATORS, changes_of_route
from drake_shared.simulation.runner import Task

TRIALS = 10
"""With each second learner, as in the paper."""
_ADDED = 3
_SEED, _STRIDE = 2_000_000, 100
_BASE, _RUNS, _MORE, _TRIED = 0, 10, 30, 50
# With fewer repeats a bootstrap interval of 95% covers less than some 93%.
_FEW = 20
# Repeats in a task, and operators that share its first learners: what is trained side by side.
_PRIMARY_GROUP, _OTHER_GROUP, _OPERATORS = 10, 5, 5


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """Groups of repeats, of each preset: of the primary operator, and of some of the others together."""
    others = [name for name in OPERATORS if name != PRIMARY_OPERATOR]
    setups = SETUPS if size.all_arms else SETUPS[:2]
    plans = [
        (
            [PRIMARY_OPERATOR],
            list(ARMS) if size.all_arms else [PRIMARY_ARM],
            setups,
            groups(size.repeats, _PRIMARY_GROUP),
        )
    ]
    plans += [
        (
            others[begin : begin + _OPERATORS],
            [PRIMARY_ARM],
            SETUPS[:2],
            groups(size.other_repeats, _OTHER_GROUP),
        )
        for begin in range(0, len(others), _OPERATORS)
    ]
    return [
        Task(
            "drake_shared.experiments.fig6_learners:run_repeats",
            {
                "scenario": scenario,
                "preset": preset,
                "operators": operators,
                "repeats": repeats,
                "arms": own_arms,
                "setups": own_setups,
                "trials": TRIALS,
            },
        )
        for preset in PRESETS
        for operators, own_arms, own_setups, grouped in plans
        for repeats in grouped
    ]


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    given = task.arguments
    preset, repeats, operators = given["preset"], len(given["repeats"]), len(given["operators"])
    taught = {(setup, ARMS[arm][0]) for setup, arm in _conditions(given["setups"], given["arms"])}
    trials = given["trials"] * len(_conditions(given["setups"], given["arms"])) + _ADDED * len(
        given["setups"]
    )
    training = training_cost(preset, repeats) + training_cost(preset, repeats * operators * len(taught))
    return training + TRIAL_COST * repeats * (_ADDED + operators * trials)


def run_repeats(
    scenario: str | None,
    preset: str,
    operators: Sequence[str],
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
    rows: list[dict[str, Any]] = []

    def miss(operator: str, repeat: int, error: RunError) -> None:
        rows.append({"preset": preset, "operator": operator, "repeat": repeat, "failed": str(error)})

    base = {}
    for repeat in repeats:
        try:
            base[repeat] = drives(scenario, count=_ADDED, seed=_seed(repeat, _BASE))
        except RunError as error:
            for operator in operators:
                miss(operator, repeat, error)
    taught = [as_demonstrations(scenario, items) for items in base.values()]
    first = dict(zip(base, train_all(taught, list(base), preset=preset), strict=True))

    conditions = _conditions(setups, arms)
    lessons, unmatched = {}, {}
    for operator in operators:
        behaviour = OPERATORS[operator].behaviour_in(scenario_of(scenario))
        for repeat, learner in first.items():
            try:
                added = _added(scenario, learner, repeat, behaviour, setups)
            except RunError as error:
                miss(operator, repeat, error)
                continue
            unmatched[operator, repeat] = _unmatched(added)
            for setup, weighted in sorted({(setup, ARMS[arm][0]) for setup, arm in conditions}):
                items = base[repeat] + added[setup]
                lessons[operator, repeat, setup, weighted] = as_demonstrations(scenario, items)
    trained = train_all(
        list(lessons.values()),
        [repeat for _, repeat, _, _ in lessons],
        preset=preset,
        weighted=[weighted for *_, weighted in lessons],
    )
    second = dict(zip(lessons, trained, strict=True))

    for (operator, repeat), again in unmatched.items():
        for setup, arm in conditions:
            weighted, kept = ARMS[arm]
            told = {"preset": preset, "operator": operator, "repeat": repeat, "setup": setup, "arm": arm}
            for settings in _trials(scenario, operator, repeat, trials):
                trial = run(
                    scenario,
                    second[operator, repeat, setup, weighted],
                    confidence_gain=first[repeat].confidence_gain if kept else None,
                    **settings,
                )
                rows.append(measured(trial, **told, unmatched_drives=again))
    return rows


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """The paper's pair of bars, the paired differences, and what the paper did not look at."""
    told = [row for result in results for row in result]
    missing = [row for row in told if "failed" in row]
    rows = [row for row in told if "failed" not in row]
    means = repeat_means(rows)
    answers = compare(means)
    asked = [one for one in answers if one.against == "human"]
    pictures = [bars(rows)] if rows else []
    pictures += [spread([one for one in asked if one.cell.is_primary])] if rows else []
    for name, measure in MEASURES.items():
        found = [one for one in asked if one.measure == name]
        # With the primary arm alone there is nothing in it that the figure before does not show.
        if measure.paper and any(not one.cell.is_primary for one in found):
            pictures.append(forest(found))
    rest = [one for one in answers if MEASURES[one.measure].paper and not one.cell.is_primary]
    tables = [
        means_table(means),
        difference_table(
            [one for one in answers if one.cell.is_primary],
            f"The primary operator in the primary arm ({PRIMARY_ARM}): by how much Setup 1 is better.",
        ),
        difference_table(rest, "The paper's measures with other operators, and in the other arms."),
    ]
    return Section(
        title="Fig. 6: the second learner",
        text=_text(size, means, answers, rows, missing),
        pictures=pictures,
        tables=[table for table in tables if table.rows],
        claims=[_claim(one) for one in asked if one.cell.is_primary],
        data={
            "second_learners_trials": rows,
            "second_learners_missing": missing,
            "second_learners_differences": [one.row for one in answers],
        },
    )


def _text(
    size: Size,
    means: Means,
    answers: Sequence[Compared],
    rows: Sequence[Mapping[str, Any]],
    missing: Sequence[Mapping[str, Any]],
) -> list[str]:
    counts = ", ".join(
        f"{len(repeats)} with preset {cell.preset}" for cell, repeats in means.items() if cell.is_primary
    )
    smallest = ", ".join(f"{named(name)} {amount(name, one.smallest)}" for name, one in MEASURES.items())
    text = [
        "The paper adds three shared runs (Setup 1) or three runs of the human alone (Setup 2) to the "
        "demonstrations, trains a second learner on each, and finds less disagreement and slightly less "
        "human weight with Setup 1: one operator, one pair of learners, 10 trials each.",
        "Here the unit is a repeat: base demonstrations by the primary simulated operator alone, a first "
        "learner, both added sets by the operator under study on the same routes and noise seeds and with "
        "the same scores (of each pair the mean of both), a second learner of each, and "
        f"{TRIALS} trials with either on the same routes and seeds, averaged. Repeats of the primary "
        f"operator: {counts or 'none'}. The arm of the primary inference, “{PRIMARY_ARM}”, was named in the "
        "code beforehand: the paper weights by score, and tuned K once, by hand.",
        "Differences are paired; intervals are 95% by bootstrap over repeats, p is of Wilcoxon's signed-rank "
        "test, and both are adjusted by Holm's method over operators and both measures of a preset. Other "
        "arms, the control, and what the paper did not look at (intent success, the human's effort, "
        "clearance, disagreement per second) are families of their own. The paper's disagreement is a sum "
        "over a trial, so a robot that is stuck until time is over adds much to it and one that arrives soon "
        f"little; its rate is free of that. Smallest effects of interest: {smallest}.",
    ]
    text += [
        _said(preset, answers) for preset in PRESETS if any(one.cell.preset == preset for one in answers)
    ]
    asked = [one for one in answers if one.cell.is_primary and one.against == "human"]
    asked = [one for one in asked if one.estimate.count > 1]
    fewest = min((one.estimate.count for one in asked), default=_FEW)
    if fewest < _FEW:
        text.append(
            f"With {fewest} repeats intervals by bootstrap are too narrow: this run gives a hint, and "
            "a verdict counts only where the adjusted p agrees."
        )
    same = sorted({named(one.measure) for one in asked if not one.differences.any()})
    if same:
        text.append(
            f"No repeat differed in {', '.join(same)} with one preset or both. An interval without width "
            "says that differences are rare, not that there are none: by the rule of three up to "
            f"{min(1.0, 3.0 / fewest):.0%} of repeats may have one."
        )
    if size.all_arms:
        text.append(
            "The control adds three more of the base demonstrations, with other seeds, to the primary "
            "operator's repeats in the primary arm. That operator made the base demonstrations, so the "
            "control differs from Setup 2 by its seeds alone: what separates the two is chance."
        )
    else:
        text.append("Of this quick run the other arms and the control are left out.")
    if size.other_repeats:
        text.append(
            f"The other operators have {size.other_repeats} repeats each, in the primary arm and without the "
            "control. The one that changes routes half-way does so in the trials, not in what it teaches."
        )
    else:
        text.append("The other operators are left out.")
    again = {(row["preset"], row["operator"], row["repeat"]) for row in rows if row["unmatched_drives"]}
    if again:
        text.append(
            f"A drive that fails is repeated with another seed. In {len(again)} repeats that happened to one "
            "setup and not to the other, whose added drives then differ in their noise as well: "
            f"{_tally(key[1] for key in again)}."
        )
    if missing:
        text.append(
            f"{len(missing)} repeats are missing, because an operator did not reach the goal in any of many "
            f"attempts to drive a route: {_tally(row['operator'] for row in missing)}."
        )
    return text


def _said(preset: str, answers: Sequence[Compared]) -> str:
    """What came of the paper's two claims with a preset, in words."""
    parts = []
    for name in (name for name, measure in MEASURES.items() if measure.paper):
        own = [
            one
            for one in answers
            if (one.cell.preset, one.measure, one.against, one.cell.arm)
            == (preset, name, "human", PRIMARY_ARM)
        ]
        for one in own:
            if one.cell.is_primary:
                low, high = number(one.estimate.low), number(one.estimate.high)
                parts.append(
                    f"{named(name)}, Setup 2 minus Setup 1: {amount(name, one.estimate.mean)} "
                    f"[{low}, {high}]: {one.verdict}"
                )
        others = Counter(one.verdict for one in own if not one.cell.is_primary)
        if others:
            parts.append(f"with the other operators {_counted(others)}")
    return f"“Lower with Setup 1”, preset {preset}: {'; '.join(parts)}."


def _counted(verdicts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {word}" for word, count in sorted(verdicts.items()))


def _tally(operators: Iterable[str]) -> str:
    return ", ".join(f"{operator} {count}" for operator, count in Counter(operators).most_common())


def _claim(one: Compared) -> Claim:
    measure = MEASURES[one.measure]
    return Claim(
        text=f"{named(one.measure)} is {measure.better} with Setup 1 than with Setup 2 (preset "
        f"{one.cell.preset}{'' if measure.paper else '; not looked at in the paper'})",
        estimate=one.estimate,
        smallest=measure.smallest,
        unit=measure.unit,
        verdict=one.verdict,
        p=one.p,
        effect=one.effect,
    )


def _conditions(setups: Sequence[str], arms: Sequence[str]) -> list[tuple[str, str]]:
    """Setups with arms; the control is part of the primary arm alone."""
    return [(setup, arm) for arm in arms for setup in setups if setup != "more" or arm == PRIMARY_ARM]


def _added(
    scenario: str | None, learner: Any, repeat: int, behaviour: Behaviour, setups: Sequence[str]
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


def _unmatched(added: Mapping[str, Sequence[Demonstration]]) -> int:
    """How many drives of both setups do not have the same seed, because one of them failed at first."""
    pairs = zip(added["shared"], added["human"], strict=True)
    return sum(one.provenance["seed"] != other.provenance["seed"] for one, other in pairs)


def _trials(scenario: str | None, operator: str, repeat: int, count: int) -> list[dict[str, Any]]:
    """Settings of the trials of a repeat: the same in every arm and setup."""
    world, named_one = scenario_of(scenario), OPERATORS[operator]
    changes: list[tuple[Any, Any]] = [(route, None) for route in world.routes]
    if named_one.switches:
        changes = list(changes_of_route(world))
    told = []
    for index in range(count):
        route, then = changes[index % len(changes)]
        told.append(
            {
                "route": route.name,
                "then": None if then is None else then.name,
                "seed": _seed(repeat, _TRIED) + index,
                "behaviour": named_one.behaviour_in(world),
            }
        )
    return told


def _seed(repeat: int, purpose: int) -> int:
    return _SEED + repeat * _STRIDE + purpose


EXPERIMENT = Experiment(name="second_learners", tasks=tasks, cost=cost, report=report)
