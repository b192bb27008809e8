"""What a participant does, step by step."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from drake_shared.scenario import Scenario
from drake_shared.study.design import Study

PRACTICE = 0
"""Number of the block of practice."""
# For the expected duration: between two trials, for an item of a questionnaire, and to read a word, in [s].
_BETWEEN, _ITEM, _WORD = 5.0, 10.0, 0.3


@dataclasses.dataclass(frozen=True, kw_only=True)
class Step:
    """A step.

    Attributes:
        participant: Pseudonym, such as P01.
        index: From 0.
        kind: What is done.
        condition: Of trials and of questionnaires about them.
        place: Of the condition in the participant's order, from 0.
        block: From 1; `PRACTICE` before.
        trial: In the block, from 1.
        route: That is instructed.
        seed: Of the trial.
        questionnaire: Its name.
    """

    participant: str
    index: int
    kind: Literal["consent", "introduction", "questionnaire", "trial", "thanks"]
    condition: str | None = None
    place: int | None = None
    block: int | None = None
    trial: int | None = None
    route: str | None = None
    seed: int = 0
    questionnaire: str | None = None

    @property
    def name(self) -> str:
        """Unique among the steps of a participant, and sorted as they are."""
        parts = [f"{self.index:03d}", self.questionnaire or self.kind]
        if self.condition is not None:
            parts += ["practice" if self.block == PRACTICE else f"block{self.block}", self.condition]
        return "_".join(parts + ([] if self.trial is None else [f"{self.trial:02d}"]))


def participants_of(study: Study) -> list[str]:
    """The pseudonyms of all participants."""
    return [f"P{number:02d}" for number in range(1, study.participants + 1)]


def steps_of(study: Study, participant: str) -> list[Step]:
    """The steps of a participant; a function of the study alone."""
    number = participants_of(study).index(participant)
    return [
        dataclasses.replace(step, index=index)
        for index, step in enumerate(_steps(study, participant, number))
    ]


def end_of_trials(steps: Sequence[Step], first: Step) -> int:
    """The index of the first step after ``first`` that is no trial of its block."""
    later = steps[first.index :]
    return next((s.index for s in later if (s.kind, s.block) != ("trial", first.block)), len(steps))


def _steps(study: Study, participant: str, number: int) -> Iterator[Step]:
    def step(kind: str, **fields: object) -> Step:
        return Step(participant=participant, index=0, kind=kind, **fields)  # type: ignore[arg-type]

    names, order = list(study.conditions), study.orders()[number]
    asked = study.questionnaires
    yield step("consent")
    if study.texts.introduction:
        yield step("introduction")
    for name in asked.participant:
        yield step("questionnaire", questionnaire=name)
    blocks = [(PRACTICE, 0, order[0])] if study.practice else []
    sequence = enumerate(order * study.blocks)
    blocks += [(block, place, condition) for block, (place, condition) in enumerate(sequence, start=1)]
    for block, place, condition in blocks:
        where = {"condition": names[condition], "place": place, "block": block}
        random = np.random.default_rng([study.seed, number, block])
        count = study.practice if block == PRACTICE else study.trials
        for trial, route in enumerate(_routes(study, count, random), start=1):
            seed = int(random.integers(2**32))
            yield step("trial", **where, trial=trial, route=route, seed=seed)
            if block != PRACTICE:
                for name in asked.trial:
                    yield step("questionnaire", **where, trial=trial, questionnaire=name)
        if block != PRACTICE:
            for name in asked.block:
                yield step("questionnaire", **where, questionnaire=name)
    yield step("thanks")


def _routes(study: Study, count: int, random: np.random.Generator) -> list[str]:
    """Each route as often, in random order."""
    names = study.route_names()
    found = [names[index % len(names)] for index in range(count)]
    return [found[index] for index in random.permutation(count)]


def expected_minutes(study: Study, scenario: Scenario) -> float:
    """Expected duration for a participant, if every trial takes the scenario's travel time."""
    steps = steps_of(study, "P01")
    asked = study.load_questionnaires()
    trials = sum(step.kind == "trial" for step in steps)
    items = sum(len(asked[step.questionnaire].items) for step in steps if step.questionnaire)
    words = sum(len(text.split()) for text in dataclasses.asdict(study.texts).values())
    return (trials * (scenario.travel_time + _BETWEEN) + items * _ITEM + words * _WORD) / 60.0
