"""The trials of an arm: operators, ways to share control, targets of Fitts' law, and both plants."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_shared.analysis.fitts import throughput
from drake_shared.analysis.metrics import metrics
from drake_shared.arbitration.authority import Authority
from drake_shared.experiments.common import run_all, scenario_of
from drake_shared.experiments.paired_trials import (
    Condition,
    demonstrations_of,
    run_conditions,
)
from drake_shared.experiments.training import train_all
from drake_shared.learners import Learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.named import ARM_OPERATORS
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.recorded_input import RecordedInput

CUPS, TARGETS = "table_three_cups", "table_fitts"
"""Scenarios."""
PRESET = "default"
CLEARANCE = 0.015
"""Distance that an arm keeps in some trials, in [m]."""
PLANTS = ("kinematic", "dynamic")

STEADY, UNSTEADY, AIMS_AHEAD = "steady", "unsteady", "aims ahead"
STEADY_CLICK, NOISY_CLICK = "steady, two axes", "noisy, two axes"
_CLICK = ARM_OPERATORS["switches-planes"].behaviour
OPERATORS: Mapping[str, Behaviour] = {
    STEADY: ARM_OPERATORS["steady"].behaviour,
    UNSTEADY: ARM_OPERATORS["unsteady"].behaviour,
    AIMS_AHEAD: ARM_OPERATORS["aims-ahead"].behaviour,
    STEADY_CLICK: dataclasses.replace(_CLICK, noise=0.01),
    NOISY_CLICK: _CLICK,
}

WITH_CLEARANCE = (UNSTEADY, AIMS_AHEAD, NOISY_CLICK)
"""Operators who are also tried with an arm that keeps `CLEARANCE`; steady ones do not come near obstacles."""
COMPARED = (UNSTEADY, NOISY_CLICK)
"""Operators of all controls; the others drive alone and in shared control."""


def _with_conflict_angle(angle: float) -> SharedControlConfig:
    authority = Authority(conflict_angle=angle, agreement_angle=min(angle, 0.8), conflict_time=0.5)
    return SharedControlConfig(authority=authority)


ALONE, AGENT, SHARED = "human alone", "agent alone", "shared control"
CONTROLS: Mapping[str, SharedControlConfig] = {
    ALONE: SharedControlConfig(driver="human"),
    AGENT: SharedControlConfig(driver="agent"),
    "constant weight 0.5": SharedControlConfig(arbitration="halves"),
    "traded control": SharedControlConfig(arbitration="traded"),
    "leader and follower": SharedControlConfig(arbitration="leader-follower"),
    "consistency": SharedControlConfig(arbitration="consistency"),
    "blend (paper)": SharedControlConfig(authority=Authority(enabled=False)),
    "conflict angle 0.5 rad": _with_conflict_angle(0.5),
    "conflict angle 0.8 rad": _with_conflict_angle(0.8),
    SHARED: SharedControlConfig(),
    "conflict angle 1.6 rad": _with_conflict_angle(1.6),
}
"""With the arbiters that an arm can have. Shared control is the blend with the authority of an arm, whose
conflict angle is 1.2 rad."""


@dataclasses.dataclass(frozen=True)
class Case:
    """An operator, a way to share control, and whether the arm keeps the clearance.

    Attributes:
        operator, control: Keys of `OPERATORS` and `CONTROLS`.
        keeps_clear: Whether the arm keeps `CLEARANCE`.
        trials: Number of trials with each learner.
    """

    operator: str
    control: str
    keeps_clear: bool
    trials: int

    def condition(self) -> Condition:
        """The condition, with operator, control and clearance as columns of its rows."""
        config = CONTROLS[self.control]
        if self.keeps_clear:
            config = dataclasses.replace(config, safety_clearance=CLEARANCE)
        return Condition(
            columns={"operator": self.operator, "control": self.control, "keeps_clear": self.keeps_clear},
            behaviour=OPERATORS[self.operator],
            config=config,
            alone=self.control == ALONE,
        )


def run_cups(learner: int, cases: list[dict[str, Any]], trials: int) -> dict[str, list[dict[str, Any]]]:
    """Runs trials of the task with three cups.

    Args:
        learner: Its index, which determines demonstrations, training and trials.
        cases: The fields of each `Case`.
        trials: Number of trials in which the plants are compared.

    Returns:
        The rows of ``trials``, and those of ``plants``.
    """
    trained = {learner: _trained(CUPS, learner)}
    found = [Case(**one) for one in cases]
    rows = []
    for count in sorted({one.trials for one in found}):
        conditions = [one.condition() for one in found if one.trials == count]
        rows += run_conditions(CUPS, trained, conditions, count)
    return {"trials": rows, "plants": compare_plants(trained[learner], learner, trials)}


def _trained(scenario: str, index: int) -> Learner:
    learner: Learner = train_all(demonstrations_of(scenario, [index]), [index], preset=PRESET)[0]
    return learner


def compare_plants(learner: Learner, index: int, trials: int) -> list[dict[str, Any]]:
    """Gives the commands of shared control with the unsteady operator to the arm with either plant.

    Args:
        learner: Takes part in shared control.
        index: Of the learner.
        trials: Number of trials.

    Returns:
        A row for each trial: ``learner``; ``rms``, the distance of the tips until one of them reaches a cup,
        in [m]; and intent success, by the name of the plant.
    """
    world = scenario_of(CUPS)
    played = {
        plant: Simulation(
            dataclasses.replace(world, plant=plant),
            operator=RecordedInput(robot=world.robot, period=world.control_period),
        )
        for plant in PLANTS
    }
    condition = Condition(columns={}, behaviour=OPERATORS[UNSTEADY])
    given = [condition.settings(CUPS, index, learner, trial) for trial in range(trials)]
    # Until the end of the time, since the dynamic arm may reach a cup later.
    steered = run_all(CUPS, [learner] * trials, given, config=SharedControlConfig(end="duration"))
    rows = []
    for settings, trial in zip(given, steered, strict=True):
        recording = trial.commands("shared")[:-1]
        driven = {
            plant: simulation.run(
                TrialSettings(route=settings.route, seed=settings.seed, recording=recording)
            )
            for plant, simulation in played.items()
        }
        common = min(len(one["t"]) for one in driven.values())
        apart = np.subtract(*(one.positions[:common] for one in driven.values()))
        rows.append(
            {
                "learner": index,
                "rms": float(np.sqrt((apart**2).sum(axis=1).mean())),
                **{plant: metrics(one)["intent_success"] for plant, one in driven.items()},
            }
        )
    return rows


def run_targets(learner: int, operators: list[str], trials: int) -> list[dict[str, Any]]:
    """Runs trials of the task of Fitts' law, of each operator alone and in shared control.

    Args:
        learner: As in `run_cups`.
        operators: Names in `OPERATORS`.
        trials: Number of trials with each operator and control; two for each target are the fewest that give
            a throughput.

    Returns:
        A row for each operator and control: ``throughput`` in [bit/s], and ``selected``.
    """
    trained = _trained(TARGETS, learner)
    rows = []
    for operator in operators:
        for control in (ALONE, SHARED):
            condition = Case(operator, control, keeps_clear=False, trials=trials).condition()
            given = [condition.settings(TARGETS, learner, trained, trial) for trial in range(trials)]
            config = dataclasses.replace(CONTROLS[control], end="duration")
            taking_part = [None if control == ALONE else trained] * trials
            found = throughput(run_all(TARGETS, taking_part, given, config=config))
            rows.append({**condition.columns, "learner": learner, **dataclasses.asdict(found)})
    return rows
