"""Questionnaires: forms in SurveyJS's JSON, with the scores that follow from the answers."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from drake_shared.common.errors import InputError
from drake_shared.common.suggestions import did_you_mean

FOLDER = Path(__file__).parent / "forms"
"""Of the questionnaires that ship; each file states its source."""
_RANGES = {"rating": ("rateMin", "rateMax", 1, 5), "slider": ("min", "max", 0, 100)}
LONGEST_TEXT = 5_000
_TYPES = (*_RANGES, "radiogroup", "boolean", "text", "comment")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Score:
    """A score: ``offset`` plus the sum of the answers times their ``weights``, by item."""

    offset: float
    weights: Mapping[str, float]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Questionnaire:
    """A questionnaire.

    Attributes:
        name: In the study; the file's name without its ending.
        form: For SurveyJS.
        scores: By name.
    """

    name: str
    form: Mapping[str, Any]
    scores: Mapping[str, Score]

    @property
    def items(self) -> Sequence[Mapping[str, Any]]:
        """Its questions."""
        items: list[Mapping[str, Any]] = self.form["elements"]
        return items

    def check(self, answers: Any) -> dict[str, Any]:
        """The answers, by item.

        Raises:
            InputError: A required item has no answer, or an answer is unknown or out of range.
        """
        if not isinstance(answers, dict):
            raise InputError(self.name, "", "must be answers by item")
        known = {item["name"]: item for item in self.items}
        for name, value in answers.items():
            if name not in known:
                raise InputError(self.name, str(name), "is unknown")
            _check_answer(known[name], value, self.name)
        for name, item in known.items():
            if item.get("isRequired") and name not in answers:
                raise InputError(self.name, name, "must be answered")
        return answers

    def score(self, answers: Mapping[str, Any]) -> dict[str, float]:
        """All scores; NaN where an item has no answer."""
        return {
            name: score.offset
            + sum(weight * float(answers.get(item, math.nan)) for item, weight in score.weights.items())
            for name, score in self.scores.items()
        }

    def simulated_answers(self, random: np.random.Generator) -> dict[str, Any]:
        """Random answers, for dry runs."""
        answers: dict[str, Any] = {}
        for item in self.items:
            if item["type"] in _RANGES:
                low, high = _range(item)
                answers[item["name"]] = int(random.integers(int(low), int(high) + 1))
            elif item["type"] == "radiogroup":
                answers[item["name"]] = item["choices"][random.integers(len(item["choices"]))]
            elif item["type"] == "boolean":
                answers[item["name"]] = bool(random.integers(2))
            else:
                number = item.get("inputType") == "number"
                answers[item["name"]] = int(random.integers(18, 70)) if number else "simulated"
        return answers


def load_questionnaire(name: str, folder: Path) -> Questionnaire:
    """Reads a questionnaire: one that ships, by its name, or a JSON file relative to ``folder``.

    Raises:
        InputError: There is no such questionnaire, or a field of it is invalid.
    """
    shipped = {path.stem: path for path in sorted(FOLDER.glob("*.json"))}
    path = shipped.get(name, folder / name)
    if not path.is_file():
        expected = f"{name!r} must be a JSON file or one that ships{did_you_mean(name, shipped)}"
        raise InputError("study", "questionnaires", expected)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"must be JSON ({error})") from error
    items = data.get("elements") if isinstance(data, dict) else None
    if not isinstance(items, list) or not items:
        raise InputError(path, "elements", "must be a list of questions")
    for index, item in enumerate(items):
        if not isinstance(item, dict) or not isinstance(item.get("name"), str):
            raise InputError(path, f"elements[{index}]", "must be a question with a name")
        if item.get("type") not in _TYPES:
            expected = f"must be one of {', '.join(_TYPES)}"
            raise InputError(path, f"elements[{index}].type", expected, repr(item.get("type")))
    form = {key: value for key, value in data.items() if key not in ("scores", "source")}
    scores = _scores(data.get("scores", {}), {item["name"] for item in items}, path)
    return Questionnaire(name=path.stem, form=form, scores=scores)


def _scores(data: Any, items: set[str], path: Path) -> dict[str, Score]:
    scores = {}
    for name, score in (data if isinstance(data, dict) else {}).items():
        weights = score.get("weights") if isinstance(score, dict) else None
        if not isinstance(weights, dict) or not set(weights) <= items:
            raise InputError(path, f"scores.{name}.weights", "must be numbers by the names of questions")
        scores[name] = Score(offset=float(score.get("offset", 0.0)), weights=weights)
    return scores


def _check_answer(item: Mapping[str, Any], value: Any, source: str) -> None:
    kind, name = item["type"], item["name"]
    if kind in _RANGES:
        low, high = _range(item)
        valid = isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high
        if not valid:
            raise InputError(source, name, f"must be from {low:g} to {high:g}", repr(value))
    elif kind == "radiogroup" and value not in item.get("choices", ()):
        raise InputError(source, name, "must be one of the choices", repr(value))
    elif kind == "boolean" and not isinstance(value, bool):
        raise InputError(source, name, "must be true or false", repr(value))
    elif kind in ("text", "comment") and not (
        isinstance(value, str | int | float) and len(str(value)) <= LONGEST_TEXT
    ):
        raise InputError(source, name, f"must be text of at most {LONGEST_TEXT} characters")


def _range(item: Mapping[str, Any]) -> tuple[float, float]:
    lowest, highest, low, high = _RANGES[item["type"]]
    return float(item.get(lowest, low)), float(item.get(highest, high))
