"""The data of a study as tidy rows, one for each trial and one for each answered questionnaire."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.metrics import metrics
from drake_shared.study.design import RUN_FIELDS, Study
from drake_shared.study.steps import PRACTICE, participants_of
from drake_shared.study.store import EXCLUDED, StudyData

Row = dict[str, Any]
_KEYS = ("participant", "condition", "place", "block", "trial", "route", "simulated")


def trial_rows(data: StudyData) -> list[Row]:
    """A row for each trial: its keys, how it ended, timing, metrics, and why it is excluded (else empty).

    Practice is excluded from the analysis, as are trials and participants by the rules of the protocol and by
    the experimenter.
    """
    rows = []
    for step, trial in data.trials():
        entry = trial.metadata["study"]
        rows.append(
            {name: entry.get(name) for name in _KEYS}
            | {"seed": step.seed, "status": trial.status}
            | {name: entry.get(name) for name in ("latency_p50", *RUN_FIELDS)}
            | metrics(trial)
        )
    _exclude(rows, data)
    return rows


def answer_rows(data: StudyData) -> list[Row]:
    """A row for each answered questionnaire: its keys, answers as ``item.NAME``, and scores."""
    asked = data.study.load_questionnaires()
    rows = []
    for step, answers in data.answers():
        assert step.questionnaire is not None
        row = {name: getattr(step, name) for name in _KEYS if name != "simulated"}
        row |= {"questionnaire": step.questionnaire}
        row |= {f"item.{name}": value for name, value in answers.items()}
        rows.append(row | asked[step.questionnaire].score(answers))
    return rows


def values_of(name: str, trials: Sequence[Row], answers: Sequence[Row], study: Study) -> list[Row]:
    """The rows on which a measure is compared: those of trials that count, or of questionnaires.

    Returns:
        Rows with participant, condition, place, block, route (None for questionnaires) and a finite value.
    """
    questionnaire, dot, score = name.partition(".")
    source: Sequence[Row] = trials
    if dot:
        gone = {row["participant"] for row in trials if row["excluded"].startswith("participant")}
        source = [
            row for row in answers if row["questionnaire"] == questionnaire and row["participant"] not in gone
        ]
    rows = []
    for row in source:
        value = row.get(score if dot else name)
        if row.get("excluded") or value is None or not math.isfinite(value):
            continue
        keys = {key: row[key] for key in ("participant", "condition", "place", "block", "route")}
        if dot and keys["condition"] is None and study.design == "between":
            # Asked once in a study between participants, it is about the participant's only condition.
            number = participants_of(study).index(row["participant"])
            keys |= {"condition": list(study.conditions)[study.orders()[number][0]], "place": 0}
        if keys["condition"] is not None:
            rows.append(keys | {"value": float(value)})
    return rows


def _exclude(rows: Sequence[Row], data: StudyData) -> None:
    """Adds the column ``excluded``: the reason, which begins with "participant" if all trials are."""
    rules = data.study.exclusions
    reasons: dict[str, str] = {}
    for participant in {row["participant"] for row in rows}:
        own = [row for row in rows if row["participant"] == participant and row["block"] != PRACTICE]
        for rule in rules:
            values = [float(row[rule.measure]) for row in own if row.get(rule.measure) is not None]
            finite = [value for value in values if math.isfinite(value)]
            if rule.of == "participant" and finite and rule.holds(float(np.mean(finite))):
                reasons[participant] = f"participant: {rule}"
        ended = data.ended(participant)
        if ended is not None and ended["kind"] == EXCLUDED:
            reasons[participant] = f"participant: {ended['reason']}"
    for row in rows:
        of_trial = [
            str(rule) for rule in rules if rule.of == "trial" and rule.holds(_number(row.get(rule.measure)))
        ]
        practice = "practice" if row["block"] == PRACTICE else ""
        row["excluded"] = reasons.get(row["participant"]) or practice or "; ".join(of_trial)


def _number(value: Any) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
