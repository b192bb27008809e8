"""Dry runs of a study with simulated participants, who drive, answer at random, and may drop out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import Behaviour
from drake_shared.simulation.log import Trial
from drake_shared.study.simulated import run_steps, simulated_behaviours, simulation_of
from drake_shared.study.steps import Step
from drake_shared.study.store import WITHDRAWN, StudyData

_TOGETHER = 8
"""Participants whose trials are run in lock-step; a killed run repeats at most theirs."""


def simulate(
    data: StudyData, count: int, *, dropout: float = 0.0, fitted: Sequence[Behaviour] = ()
) -> Iterator[str]:
    """Takes the first participants through all steps that are not complete; yields each when done.

    What a participant does is a function of the study and the participant: a run that was killed continues as
    if it had not been.

    Args:
        data: Of the study.
        count: Number of participants.
        dropout: Probability with which each withdraws, at a random step.
        fitted: See `drake_shared.study.simulated.simulated_behaviours`.

    Raises:
        InputError: There are fewer participants, ``dropout`` is no probability, or the data are of people.
        RunError: A file cannot be written.
    """
    participants = list(data.steps)
    if not 1 <= count <= len(participants):
        expected = f"must be from 1 to {len(participants)}, the study's participants"
        raise InputError("study run", "--simulate", expected, count)
    if not 0.0 <= dropout <= 1.0:
        raise InputError("study run", "--dropout", "must be from 0 to 1", dropout)
    data.check_kind(simulated=True)
    behaviours = simulated_behaviours(len(participants), seed=data.study.seed, fitted=fitted)
    simulations = {name: simulation_of(data.study, name) for name in data.study.conditions}
    asked = data.study.load_questionnaires()
    for begin in range(0, count, _TOGETHER):
        group = participants[begin : min(begin + _TOGETHER, count)]
        numbers = {name: begin + index for index, name in enumerate(group)}
        left = {name: _steps_left(data, name, numbers[name], dropout) for name in group}
        trials: dict[Step, Trial] = {}
        for condition, simulation in simulations.items():
            steps = [
                step
                for name in group
                for step in left[name]
                if step.kind == "trial" and step.condition == condition
            ]
            if steps:
                each = [behaviours[numbers[step.participant]] for step in steps]
                trials |= zip(steps, run_steps(simulation, steps, each), strict=True)
        for name in group:
            for step in left[name]:
                random = np.random.default_rng([data.study.seed, numbers[name], step.index, 13])
                if step.kind == "trial":
                    data.write_trial(step, trials.pop(step), simulated=True, measured={"late_share": 0.0})
                elif step.questionnaire is not None:
                    answers = asked[step.questionnaire].simulated_answers(random)
                    data.write_answers(step, answers, simulated=True)
                else:
                    data.write_answers(step, {}, simulated=True)
            if data.next_step(name) is not None:
                data.end(name, WITHDRAWN, "simulated", simulated=True)
            yield name


def _steps_left(data: StudyData, participant: str, number: int, dropout: float) -> list[Step]:
    """The steps that the participant still completes."""
    steps = data.steps[participant]
    random = np.random.default_rng([data.study.seed, number, 17])
    last = len(steps)
    if random.random() < dropout:
        last = int(random.integers(1, len(steps)))
    following = data.next_step(participant)
    return [] if following is None else steps[following.index : last]
