"""Fig. 6 of Amirshirzad et al. 2022: are shared runs a better second training set than human runs?

Seeds of repeat k start at 2 000 000 + 100 k: those of the base demonstrations at 0 after that, of the added
runs at 10, of the control at 30 and of the trials at 50. All learners of repeat k are trained from seed k.
Drives that are repeated have seeds beyond a million more.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration
from drake_shared.experiments.common import (
    TRIAL_COST,
    Teaching,
    as_demonstrations,
    demonstrate,
    row_of,
    run_all,
    scenario_of,
)
from drake_shared.experiments.fig6_comparison import (
    ARMS,
    CRITERIA,
    OF_PAPER,
    PRIMARY_ARM,
    PRIMARY_OPERATOR,
    SETUPS,
    Comparison,
    Means,
    compare,
    repeat_means,
)
from drake_shared.experiments.fig6_figures import (
    bars,
    difference_table,
    forest,
    means_table,
    spread,
    title_of,
    with_unit,
)
from drake_shared.experiments.paired_trials import groups, route_settings
from drake_shared.experiments.section import Experiment, PlannedTask, Rows, Section, Size
from drake_shared.experiments.text import number, paragraphs
from drake_shared.experiments.training import PRESETS, stopped_early, train_all, training_cost
from drake_shared.operators.named import OPERATORS
from drake_shared.simulation.runner import Task

TRIALS = 10
"""With each second learner, as in the paper."""
_ADDED = 3
_SEED, _STRIDE = 2_000_000, 100
_BASE, _RUNS, _MORE, _TRIALS = 0, 10, 30, 50
# With fewer repeats most effects stay open.
_FEW = 20
# Repeats in a task, and operators that share its first learners: what is trained together.
_PRIMARY_GROUP, _OTHER_GROUP, _OPERATORS = 5, 5, 5


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """Tasks for groups of repeats, of the primary operator and of some of the others together."""
    return [
        PlannedTask(
            Task.of(
                run_repeats,
                scenario=scenario,
                preset=preset,
                operators=operators,
                repeats=repeats,
                arms=arms,
                setups=setups,
                trials=TRIALS,
            ),
            _seconds(preset, len(operators), len(repeats), conditions_of(setups, arms), len(setups)),
        )
        for preset in PRESETS
        for operators, arms, setups, grouped in _plans(size.of(preset))
        for repeats in grouped
    ]


def _plans(size: Size) -> Iterator[tuple[list[str], list[str], Sequence[str], list[list[int]]]]:
    """Operators, arms, setups and groups of repeats."""
    arms, setups = (list(ARMS), SETUPS) if size.all_arms else ([PRIMARY_ARM], SETUPS[:2])
    yield [PRIMARY_OPERATOR], arms, setups, groups(size.repeats, _PRIMARY_GROUP)
    others = [name for name in OPERATORS if name != PRIMARY_OPERATOR]
    for begin in range(0, len(others), _OPERATORS):
        part = others[begin : begin + _OPERATORS]
        yield part, [PRIMARY_ARM], SETUPS[:2], groups(size.other_repeats, _OTHER_GROUP)


def _seconds(
    preset: str, operators: int, repeats: int, conditions: Sequence[tuple[str, str]], setups: int
) -> float:
    learners = {(setup, ARMS[arm][0]) for setup, arm in conditions}
    training = training_cost(preset, repeats)
    training += training_cost(preset, repeats * operators * len(learners))
    trials = TRIALS * len(conditions) + _ADDED * setups
    return training + TRIAL_COST * repeats * (_ADDED + operators * trials)


def conditions_of(setups: Sequence[str], arms: Sequence[str]) -> list[tuple[str, str]]:
    """Pairs of setup and arm; the control has only the primary arm."""
    return [(setup, arm) for arm in arms for setup in setups if setup != "more" or arm == PRIMARY_ARM]


def run_repeats(
    scenario: str | None,
    preset: str,
    operators: Sequence[str],
    repeats: Sequence[int],
    arms: Sequence[str],
    setups: Sequence[str],
    trials: int,
) -> list[dict[str, Any]]:
    """Runs repeats together; returns a row for each trial, and one for each repeat that failed.

    A repeat has three base demonstrations by the primary operator alone; a first learner; three added runs of
    the operator under study in shared control with that learner (Setup 1) and alone (Setup 2), on the same
    routes and with the same noise seeds, and three further base demonstrations (the control); second
    learners; and trials with each of them, on the same routes and seeds.
    """
    rows: list[dict[str, Any]] = []

    def fail(operator: str, repeat: int, error: RunError) -> None:
        rows.append({"preset": preset, "operator": operator, "repeat": repeat, "failed": str(error)})

    base = {}
    driven = demonstrate(
        scenario, [Teaching(count=_ADDED, seed=seed_of(repeat, _BASE)) for repeat in repeats]
    )
    for repeat, made in zip(repeats, driven, strict=True):
        if not isinstance(made, RunError):
            base[repeat] = made
            continue
        for operator in operators:
            fail(operator, repeat, made)
    sets = [as_demonstrations(scenario, items) for items in base.values()]
    first = dict(zip(base, train_all(sets, list(base), preset=preset), strict=True))

    conditions = conditions_of(setups, arms)
    second_sets, unmatched = {}, {}
    for (operator, repeat), added in _added_runs(scenario, operators, first, setups).items():
        if isinstance(added, RunError):
            fail(operator, repeat, added)
            continue
        unmatched[operator, repeat] = _count_unmatched(added)
        for setup, weighted in sorted({(setup, ARMS[arm][0]) for setup, arm in conditions}):
            items = base[repeat] + added[setup]
            second_sets[operator, repeat, setup, weighted] = as_demonstrations(scenario, items)
    trained = train_all(
        list(second_sets.values()),
        [repeat for _, repeat, _, _ in second_sets],
        preset=preset,
        weighted=[weighted for *_, weighted in second_sets],
    )
    second = dict(zip(second_sets, trained, strict=True))

    runs = [
        (operator, repeat, setup, arm, index)
        for operator, repeat in unmatched
        for setup, arm in conditions
        for index in range(trials)
    ]
    taking_part = [second[operator, repeat, setup, ARMS[arm][0]] for operator, repeat, setup, arm, _ in runs]
    settings = [
        route_settings(
            scenario,
            operator,
            index,
            seed=seed_of(repeat, _TRIALS) + index,
            confidence_gain=first[repeat].confidence_gain if ARMS[arm][1] else None,
        )
        for operator, repeat, _, arm, index in runs
    ]
    tried = run_all(scenario, taking_part, settings)
    for (operator, repeat, setup, arm, _), learner, trial in zip(runs, taking_part, tried, strict=True):
        cell = {"preset": preset, "operator": operator, "repeat": repeat, "setup": setup, "arm": arm}
        cell |= {"unmatched_drives": unmatched[operator, repeat], "stopped_early": stopped_early(learner)}
        rows.append(row_of(trial, **cell))
    return rows


def seed_of(repeat: int, purpose: int) -> int:
    """The first seed of a repeat for a purpose; see the head of this module."""
    return _SEED + repeat * _STRIDE + purpose


def _added_runs(
    scenario: str | None, operators: Sequence[str], first: Mapping[int, Any], setups: Sequence[str]
) -> dict[tuple[str, int], dict[str, list[Demonstration]] | RunError]:
    """Three further demonstrations for each operator, repeat and setup, or why there are none.

    Those of a route have the same score in all setups.
    """
    world = scenario_of(scenario)
    kinds = {}
    for operator in operators:
        behaviour = OPERATORS[operator].behaviour_in(world)
        for repeat, learner in first.items():
            alone = Teaching(count=_ADDED, seed=seed_of(repeat, _RUNS), behaviour=behaviour)
            kinds[operator, repeat, "shared"] = dataclasses.replace(alone, learner=learner)
            kinds[operator, repeat, "human"] = alone
            if "more" in setups:
                kinds[operator, repeat, "more"] = Teaching(count=_ADDED, seed=seed_of(repeat, _MORE))
    found: dict[tuple[str, int], dict[str, list[Demonstration]] | RunError] = {}
    for (operator, repeat, setup), made in zip(
        kinds, demonstrate(scenario, list(kinds.values())), strict=True
    ):
        own_sets = found.setdefault((operator, repeat), {})
        if isinstance(made, RunError):
            found[operator, repeat] = made if isinstance(own_sets, dict) else own_sets
        elif isinstance(own_sets, dict):
            own_sets[setup] = made
    for sets in found.values():
        if isinstance(sets, dict):
            for index in range(_ADDED):
                score = float(np.mean([sets[setup][index].score for setup in ("shared", "human")]))
                for items in sets.values():
                    items[index] = dataclasses.replace(items[index], score=score)
    return found


def _count_unmatched(added: Mapping[str, Sequence[Demonstration]]) -> int:
    """Number of runs whose seeds differ between the setups, because one of them was repeated."""
    pairs = zip(added["shared"], added["human"], strict=True)
    return sum(one.provenance["seed"] != other.provenance["seed"] for one, other in pairs)


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """The bars of the paper, paired differences, and measures that the paper does not report."""
    found = [row for result in results for row in result]
    missing = [row for row in found if "failed" in row]
    rows = [row for row in found if "failed" not in row]
    means = repeat_means(rows)
    comparisons = compare(means, missing)
    with_setup_2 = [one for one in comparisons if one.against == "human"]
    primary = [one for one in with_setup_2 if one.cell.is_primary]
    pictures = [bars(rows), spread(primary)] if rows else []
    for name in OF_PAPER:
        own = [one for one in with_setup_2 if one.measure == name]
        # With the primary arm only, the previous figure shows the same.
        if any(not one.cell.is_primary for one in own):
            pictures.append(forest(own))
    tables = [
        means_table(means),
        difference_table(
            [one for one in comparisons if one.cell.is_primary],
            f"The primary operator in the primary arm ({PRIMARY_ARM}): by how much Setup 1 is better.",
        ),
        difference_table(
            [one for one in comparisons if one.measure in OF_PAPER and not one.cell.is_primary],
            "The measures of the paper with other operators, and in the other arms.",
        ),
    ]
    return Section(
        title="Fig. 6: the second learner",
        text=_text(size, means, comparisons, rows, missing),
        pictures=pictures,
        tables=[table for table in tables if table.rows],
        claims=[one.claim for one in primary],
        data={
            "second_learners_trials": rows,
            "second_learners_missing": missing,
            "second_learners_differences": [one.row for one in comparisons],
        },
    )


def _text(
    size: Size, means: Means, comparisons: Sequence[Comparison], rows: Rows, missing: Rows
) -> list[str]:
    primary = [
        one
        for one in comparisons
        if one.cell.is_primary and one.against == "human" and one.estimate.count > 1
    ]
    fewest = min((one.estimate.count for one in primary), default=_FEW)
    unmatched = {(row["preset"], row["operator"], row["repeat"]) for row in rows if row["unmatched_drives"]}
    return paragraphs(
        "second_learners",
        size=size,
        trials=TRIALS,
        primary_arm=PRIMARY_ARM,
        repeats={cell.preset: len(repeats) for cell, repeats in means.items() if cell.is_primary},
        others={preset: size.of(preset).other_repeats for preset in PRESETS if size.of(preset).other_repeats},
        all_arms=[preset for preset in PRESETS if size.of(preset).all_arms],
        smallest=[f"{title_of(name)} {with_unit(name, one.smallest)}" for name, one in CRITERIA.items()],
        outcomes={
            preset: _outcome([one for one in comparisons if one.cell.preset == preset])
            for preset in PRESETS
            if any(one.cell.preset == preset for one in comparisons)
        },
        fewest=fewest,
        few=_FEW,
        identical=sorted({title_of(one.measure) for one in primary if not one.differences.any()}),
        share_left=f"{1.0 - 0.05 ** (1.0 / max(fewest, 1)):.0%}",
        unmatched=Counter(operator for _, operator, _ in unmatched),
        missing=Counter(row["operator"] for row in missing),
    )


def _outcome(comparisons: Sequence[Comparison]) -> list[str]:
    """The results of the two claims of the paper, in words."""
    parts = []
    for name in OF_PAPER:
        own = [
            one
            for one in comparisons
            if (one.measure, one.against, one.cell.arm) == (name, "human", PRIMARY_ARM)
        ]
        for one in own:
            if one.cell.is_primary:
                low, high = number(one.estimate.low), number(one.estimate.high)
                parts.append(
                    f"{title_of(name)}, Setup 2 minus Setup 1: {with_unit(name, one.estimate.mean)} "
                    f"[{low}, {high}]: {one.verdict}"
                )
        others = Counter(one.verdict for one in own if not one.cell.is_primary)
        if others:
            counts = ", ".join(f"{count} {word}" for word, count in sorted(others.items()))
            parts.append(f"with the other operators {counts}")
    return parts


EXPERIMENT = Experiment(name="second_learners", plan=plan, report=report)
