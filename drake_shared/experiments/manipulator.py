"""Shared control of an arm: operators, axes, arbiters, Fitts' law, and the dynamic plant."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.statistics import POINTS, Claim, at_least, differences, judge, not_worse, seldom
from drake_shared.experiments.manipulator_figures import (
    SWITCHES,
    TIME,
    cases_table,
    draw_controls,
    draw_operators,
    switches_table,
    targets_table,
)
from drake_shared.experiments.manipulator_trials import (
    AGENT,
    AIMS_AHEAD,
    ALONE,
    CLEARANCE,
    COMPARED,
    CONTROLS,
    CUPS,
    NOISY_CLICK,
    OPERATORS,
    PLANTS,
    PRESET,
    SHARED,
    STEADY,
    STEADY_CLICK,
    TARGETS,
    UNSTEADY,
    WITH_CLEARANCE,
    Case,
    run_cups,
    run_targets,
)
from drake_shared.experiments.measures import INTENT_SUCCESS, Measure, by_learner, estimate
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size
from drake_shared.experiments.text import number, paragraphs
from drake_shared.experiments.training import training_cost
from drake_shared.simulation.runner import Task

_GAIN, _MARGIN, _MOST, _RMS = 30.0, 5.0, 20.0, 5.0
# Three trials take each route once; the unsteady operator's gain is near the smallest one of interest.
_TRIALS, _MORE = 3, 4
# A throughput needs two selections of each target.
_TARGET_LEARNERS, _TARGET_TRIALS, _FEWEST = 6, 18, 12
# Of a trial on one core, in [s].
_CUPS_COST, _PLANTS_COST, _TARGET_COST = 0.13, 0.4, 0.13
# Of the network of the arbiter "consistency".
_NETWORK_COST = 4.2


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each learner of the cups, and of the targets.

    The scenarios are those of the arm, whatever ``scenario`` is. A quick run has one trial in each case.
    """
    full = size.all_arms
    trials = _TRIALS if full else 1
    cases = list(cases_of(trials, more=_MORE if full else 1))
    given = [dataclasses.asdict(case) for case in cases]
    operators = (STEADY, UNSTEADY) if full else (STEADY,)
    targets = _TARGET_TRIALS if full else _FEWEST
    training = training_cost(PRESET, 1)
    cups_cost = (
        training + _NETWORK_COST + _CUPS_COST * sum(case.trials for case in cases) + _PLANTS_COST * trials
    )
    targets_cost = training + _TARGET_COST * 2 * len(operators) * targets
    return [
        *(
            PlannedTask(Task.of(run_cups, learner=index, cases=given, trials=trials), cups_cost)
            for index in range(size.learners)
        ),
        *(
            PlannedTask(
                Task.of(run_targets, learner=index, operators=operators, trials=targets), targets_cost
            )
            for index in range(_TARGET_LEARNERS if full else 1)
        ),
    ]


def cases_of(trials: int, *, more: int = 1) -> Iterator[Case]:
    """All cases.

    Args:
        trials: Number of trials with each learner.
        more: Factor on it for the unsteady operator, alone and in shared control.
    """
    yield Case(STEADY, AGENT, keeps_clear=False, trials=trials)
    for operator in OPERATORS:
        count = more * trials if operator == UNSTEADY else trials
        for keeps_clear in (False, True) if operator in WITH_CLEARANCE else (False,):
            for control in (ALONE, SHARED):
                yield Case(operator, control, keeps_clear, count)
    for operator in COMPARED:
        for control in CONTROLS:
            if control not in (ALONE, AGENT, SHARED):
                yield Case(operator, control, keeps_clear=False, trials=trials)


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Figures and tables of operators, of ways to share control and of targets, and the claims."""
    cups = [result for result in results if isinstance(result, dict)]
    rows = [row for result in cups for row in result["trials"]]
    plants = [row for result in cups for row in result["plants"]]
    targets = [row for result in results if not isinstance(result, dict) for row in result]
    learners = {row["learner"] for row in rows}
    success = {plant: estimate(plants, dataclasses.replace(INTENT_SUCCESS, name=plant)) for plant in PLANTS}
    return Section(
        title="A manipulator",
        text=paragraphs(
            "manipulator",
            cups=CUPS,
            targets=TARGETS,
            preset=PRESET,
            learners=len(learners),
            trials=len({row["seed"] for row in rows if row["operator"] == STEADY}) // len(learners),
            more=len({row["seed"] for row in rows}) // len(learners),
            target_learners=len({row["learner"] for row in targets}),
            clearance=1000.0 * CLEARANCE,
            rms=estimate(plants, Measure("rms", "distance", "mm", 1000.0)),
            success=success,
        ),
        pictures=[
            Picture.of(
                draw_operators(rows),
                "Operators, alone and in shared control: means with 95% intervals over learners. Hollow: the "
                f"arm keeps {number(1000.0 * CLEARANCE)} mm.",
            ),
            Picture.of(
                draw_controls(rows),
                "Ways to share control: means with 95% intervals over learners. The conflict angle of shared "
                "control is 1.2 rad.",
            ),
        ],
        tables=[cases_table(rows), switches_table(rows), targets_table(targets)],
        claims=claims(rows, plants),
        data={"manipulator": rows, "manipulator_plants": plants, "manipulator_targets": targets},
    )


def claims(rows: Rows, plants: Rows) -> list[Claim]:
    """Claims about shared control with each operator, the dynamic plant, and contact."""
    kept = f", where the arm keeps {number(1000.0 * CLEARANCE)} mm"
    questions = [
        at_least(
            f"The unsteady operator's intent success in three axes is at least {number(_GAIN)} points higher "
            f"in shared control than alone{kept if keeps_clear else ''}",
            differences(*_shared_and_alone(rows, INTENT_SUCCESS, UNSTEADY, keeps_clear)),
            least=_GAIN,
            unit="points",
            bounds=POINTS,
            paired=True,
        )
        for keeps_clear in (False, True)
    ]
    questions.append(
        not_worse(
            "Shared control lowers the intent success of the operator who aims ahead by less than "
            f"{number(_MARGIN)} points",
            *_shared_and_alone(rows, INTENT_SUCCESS, AIMS_AHEAD),
            margin=_MARGIN,
            unit="points",
            bounds=POINTS,
        )
    )
    for operator in (STEADY_CLICK, NOISY_CLICK):
        for measure, text in ((SWITCHES, "at most as many switches of plane as"), (TIME, "less time than")):
            shared, alone = _shared_and_alone(rows, measure, operator)
            questions.append(
                at_least(
                    f"Shared control takes {text} the human alone (operator {operator})",
                    differences(alone, shared),
                    least=0.0,
                    unit=measure.unit,
                    bounds=measure.difference_bounds,
                    paired=True,
                )
            )
    questions.append(
        at_least(
            f"With the same commands, the tip of the dynamic arm is within {number(_RMS)} mm rms of that of "
            f"the kinematic one (the estimate is {number(_RMS)} mm less the distance)",
            _RMS - 1000.0 * by_learner(plants, "rms"),
            least=0.0,
            unit="mm",
        )
    )
    kept_clear = [row for row in rows if row["keeps_clear"]]
    questions.append(
        seldom(
            f"With less than {number(_MOST)}% of learners an arm that keeps {number(1000.0 * CLEARANCE)} mm "
            "has contact (the estimate is the share of learners, negative): it had in "
            f"{sum(row['collision'] for row in kept_clear)} of {len(kept_clear)} trials",
            by_learner(kept_clear, "collision"),
            most=_MOST,
        )
    )
    return judge("manipulator", questions)


def _shared_and_alone(
    rows: Rows, measure: Measure, operator: str, keeps_clear: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A measure by learner in shared control, and of the human alone, in the unit of the report."""
    shared, alone = (
        measure.factor
        * by_learner(rows, measure.name, operator=operator, control=control, keeps_clear=keeps_clear)
        for control in (SHARED, ALONE)
    )
    return shared, alone


EXPERIMENT = Experiment(name="manipulator", plan=plan, report=report)
