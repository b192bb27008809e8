"""Mispredictions on purpose: what was never taught, a change of mind, and an obstacle nobody knew of."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import Claim, at_least, never
from drake_shared.arbitration.authority import Authority
from drake_shared.experiments.common import (
    as_demonstrations,
    measured,
    scenario_of,
    simulation_of,
    train_all,
    training_cost,
)
from drake_shared.experiments.misprediction_cases import (
    ARMS,
    CASES,
    LEAST,
    NEAR,
    OPERATORS,
    PARTED,
    PRESETS,
    RADIUS,
    ROOMS,
    WATCHED,
    Drive,
    drive_of,
    moment,
    recovery,
    rooms_in_words,
    strayed,
    switch_time_in,
    untaught,
    variants,
)
from drake_shared.experiments.misprediction_figures import paths, recoveries, successes, table
from drake_shared.experiments.paired_trials import by_learner, groups, settings, taught
from drake_shared.experiments.report import number
from drake_shared.experiments.section import Experiment, Picture, Section, Size
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.runner import Task
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings

# Round a new obstacle three trials are enough: they take each route of the shipped scenarios once.
_GROUP, _ROUND = 10, 3
_TRIAL_SECONDS, _ALONE_SECONDS = 0.08, 0.045


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """One for the human alone, and one for each preset and ten learners of each kind."""
    told = {"scenario": scenario, "trials": size.trials}
    whom = [("none", list(range(size.learners)))]
    whom += [(preset, learners) for preset in PRESETS for learners in groups(size.learners, _GROUP)]
    return [
        Task(
            "drake_shared.experiments.mispredictions:run_cases",
            {**told, "preset": preset, "learners": learners},
        )
        for preset, learners in whom
    ]


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    preset, count = task.arguments["preset"], len(task.arguments["learners"])
    trials = count * sum(_count(case, task.arguments["trials"]) for case in CASES) * len(OPERATORS)
    if preset == "none":
        return _ALONE_SECONDS * trials
    # Taught all routes, and all but one.
    return training_cost(preset, 2 * count) + 0.2 * count + len(ARMS) * _TRIAL_SECONDS * trials


def run_cases(scenario: str | None, preset: str, learners: list[int], trials: int) -> dict[str, Any]:
    """Trials of each case and operator, with and without authority; the same for all presets.

    Args:
        scenario: File or name.
        preset: Of the learners; "none": the human is alone.
        learners: Their indices; they fix demonstrations, trainings and trials.
        trials: Of each case, operator and arm, fewer round a new obstacle.

    Returns:
        The rows, and of the first trial of learner 0 in each case, by the primary operator, the paths.
    """
    arms = ("human",) if preset == "none" else tuple(ARMS)
    rows, drawn = [], {}
    for index, (whole, partial) in zip(learners, _trained(scenario, preset, learners), strict=True):
        for case in CASES:
            learner = partial if case == "unseen" else whole
            for operator in OPERATORS:
                for number_of_trial in range(_count(case, trials)):
                    drive = drive_of(scenario, case, index, number_of_trial)
                    told = settings(scenario, operator, index, number_of_trial)
                    for arm in arms:
                        trial = _run(scenario, drive, arm, learner, told)
                        rows.append(
                            measured(
                                trial,
                                case=case,
                                preset=preset,
                                arm=arm,
                                operator=operator,
                                learner=index,
                                strayed=strayed(drive, trial),
                                **recovery(trial, moment(scenario, drive, case, trial)),
                            )
                        )
                        if (index, operator, number_of_trial) == (0, OPERATORS[0], 0):
                            drawn[f"{case} {arm}"] = np.round(trial.positions, 3)
    return {"rows": rows, "drawn": drawn}


def _count(case: str, trials: int) -> int:
    return min(trials, _ROUND) if case in ROOMS else trials


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Figures, a table for each operator, and the claims."""
    rows = [row for result in results for row in result["rows"]]
    unmet = sum(row["weight"] == "unmet" for row in rows if row["arm"] != "human")
    shared = sum(row["arm"] != "human" for row in rows)
    return Section(
        title="Mispredictions on purpose",
        text=[
            "Ways to make the agent wrong. A route never taught: the learner has demonstrations of all "
            "routes but one, and the operator takes that one, each route in turn over learners. A change "
            "of route: the operator leaves one for another after "
            f"{number(switch_time_in(scenario))} s. A new obstacle: a pillar of {number(RADIUS)} m radius "
            "stands on the route as it was taught, and the operator, who knows of it, goes round; the "
            "learner knows the old way only and no obstacles. "
            "The way round is laid once with more room and once with less, since what assistance may cost "
            f"hangs on it: {rooms_in_words(scenario)}.",
            f"{size.learners} learners of each preset, as many again for the route never taught, and "
            f"{size.trials} trials with each of the simulated operators {' and '.join(OPERATORS)} in each "
            f"case, {_count('obstacle', size.trials)} round a new obstacle. "
            "In every arm the routes and seeds are the same: the human alone, shared control in which the "
            "human is kept in charge (with authority: usual with preset default), and the blend of eq. (2) "
            "by itself (without: usual with preset paper). Intervals are 95% bootstrap over learners; those "
            "of claims are adjusted for the number of cases, and take both operators' trials together.",
            "Time until w, the human's weight, is back above 0.5 counts from the moment at which the "
            "misprediction begins to matter: the robot comes to where the operator's route is more than "
            f"{number(PARTED)} m from every route taught; the operator changes; the robot is within "
            f"{number(NEAR)} m of the new obstacle's edge. It ends where w is first above 0.5 after it was "
            f"not; where w was above throughout the first {number(WATCHED)} s the trial counts as above all "
            "along, and where it did not come back before the trial ended, as never. "
            f"In {unmet} of {shared} shared trials that moment never came. A small w "
            "is no harm by itself: an agent that goes by the command may be confident and right. How "
            "far the robot strayed is its largest distance from the route meant at the time, "
            "after a change from the new one, which "
            "begins with the distance between the two.",
        ],
        pictures=[
            Picture.of(
                successes(rows),
                "Intent success by case, arm and operator: means with 95% bootstrap intervals over learners.",
            ),
            Picture.of(
                recoveries(rows),
                "Share of trials in which w is above 0.5, by the time since the misprediction began to "
                "matter: a line starts at the share that was above all along, and what it lacks of 100% at "
                "the right never came back.",
            ),
            Picture.of(
                paths(scenario, results),
                "The first trial of the first learner in each case, primary operator. Dotted: the route "
                "meant, after a change in grey the one left; the darker pillar is new.",
            ),
        ],
        tables=[table(rows, operator) for operator in OPERATORS],
        claims=claims(rows),
        data={"mispredictions": rows},
    )


def claims(rows: Sequence[Mapping[str, Any]]) -> list[Claim]:
    """With authority: intent success of at least 95% in each case, and no collision the human had not."""
    level = 1.0 - 0.05 / len(CASES)
    found = [
        at_least(
            f"Intent success with authority is at least {number(LEAST)}%: {words} (preset {preset}; the "
            f"number is what is above {number(LEAST)})",
            100.0 * by_learner(rows, "intent_success", case=case, preset=preset, arm="on") - LEAST,
            least=0.0,
            unit="points",
            level=level,
        )
        for preset in PRESETS
        for case, words in CASES.items()
    ]
    kinds = {
        "where another way is meant than was taught or begun": [case for case in CASES if case not in ROOMS],
        "round a new obstacle": list(ROOMS),
    }
    return found + [
        _no_new_collision([row for row in rows if row["case"] in cases], preset, words)
        for preset in PRESETS
        for words, cases in kinds.items()
    ]


def _no_new_collision(rows: Sequence[Mapping[str, Any]], preset: str, words: str) -> Claim:
    def key(row: Mapping[str, Any]) -> tuple[Any, ...]:
        return tuple(row[name] for name in ("case", "operator", "learner", "seed"))

    alone = {key(row) for row in rows if row["arm"] == "human" and row["collision"]}
    shared = [
        {"learner": row["learner"], "new": row["collision"] and key(row) not in alone}
        for row in rows
        if row["preset"] == preset and row["arm"] == "on"
    ]
    return never(
        f"With authority there is no collision that the human alone had not, {words} (preset {preset}; the "
        f"number is the share of trials, negative): there was in {sum(row['new'] for row in shared)} of "
        f"{len(shared)} trials",
        by_learner(shared, "new"),
    )


def _trained(scenario: str | None, preset: str, learners: Sequence[int]) -> list[tuple[Any, Any]]:
    """Of each index a learner of all routes and one of all but one, all trained side by side."""
    if preset == "none":
        return [(None, None)] * len(learners)
    whole = [taught(scenario, index) for index in learners]
    world = scenario_of(scenario)
    partial = [
        as_demonstrations(
            scenario,
            [item for item in one if item.provenance["route"] != untaught(world, index).name],
        )
        for index, one in zip(learners, whole, strict=True)
    ]
    trained = train_all([*whole, *partial], [*learners, *learners], preset=preset)
    return list(zip(trained[: len(whole)], trained[len(whole) :], strict=True))


def _run(scenario: str | None, drive: Drive, arm: str, learner: Any, told: Mapping[str, Any]) -> Trial:
    behaviour = told["behaviour"]
    if drive.then is not None:
        behaviour = dataclasses.replace(behaviour, switch_time=switch_time_in(scenario))
    given = TrialSettings(
        driver="human" if arm == "human" else "shared",
        seed=told["seed"],
        route=drive.route,
        then=drive.then,
        behaviour=behaviour,
    )
    return _simulation(scenario, drive.variant, arm == "on").run(given, learner=learner)


@functools.cache
def _simulation(scenario: str | None, variant: tuple[str, int] | None, authority: bool) -> Simulation:
    config = SharedControlConfig(authority=Authority(enabled=authority))
    if variant is None:
        return simulation_of(scenario, config)
    case, index = variant
    return Simulation(variants(scenario, case)[index], config=config)


EXPERIMENT = Experiment(name="mispredictions", tasks=tasks, cost=cost, report=report)
