"""What is compared of second learners: paired differences over repeats, in families of questions."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.statistics import Estimate, holm, holm_levels, paired, verdict
from drake_shared.operators.named import OPERATORS

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


@dataclasses.dataclass(frozen=True, kw_only=True)
class Measure:
    """What is asked of a measure of trials.

    Attributes:
        better: "lower" or "higher".
        smallest: The smallest effect of interest.
        unit: Of the measure.
        paper: Whether the paper claims something of it.
    """

    better: str
    smallest: float
    unit: str
    paper: bool


# Over a drive of 10 s, 20 rad/s are 0.05 rad/s on each wheel in each step: half of the operator's own noise,
# and some 4% of what is usual; as a rate, 0.1 rad/s for both together. Two
# trials in a hundred; 2 of some 85 rad; 1 cm of some 15 in clearance.
MEASURES = {
    "disagreement": Measure(better="lower", smallest=20.0, unit="rad/s", paper=True),
    "mean_human_weight": Measure(better="lower", smallest=0.02, unit="", paper=True),
    "disagreement_rate": Measure(better="lower", smallest=0.1, unit="rad/s", paper=False),
    "intent_success": Measure(better="higher", smallest=0.02, unit="", paper=False),
    "human_effort": Measure(better="lower", smallest=2.0, unit="rad", paper=False),
    "clearance": Measure(better="higher", smallest=0.01, unit="m", paper=False),
}
"""Measures of trials by name."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Cell:
    """Repeats that differ in their seeds alone."""

    preset: str
    operator: str
    arm: str

    @property
    def is_primary(self) -> bool:
        """Whether it is that of the primary inference."""
        return (self.operator, self.arm) == (PRIMARY_OPERATOR, PRIMARY_ARM)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Compared:
    """By how much Setup 1 is better than something else.

    Attributes:
        cell: Of which repeats.
        measure: Name of the measure.
        against: The other: "human" (Setup 2) or "more" (the control).
        differences: Shape (n,), of each repeat; positive is better with Setup 1.
        plain: Their mean, with the interval of 95%.
        estimate: Their mean, with the interval adjusted for the family of questions.
        effect, p, verdict: See `Claim`.
    """

    cell: Cell
    measure: str
    against: str
    differences: np.ndarray
    plain: Estimate
    estimate: Estimate
    effect: float
    p: float
    verdict: str

    @property
    def row(self) -> dict[str, Any]:
        """As a row of plain values."""
        told = {**dataclasses.asdict(self.cell), "measure": self.measure, "against": self.against}
        told |= {"repeats": self.estimate.count, "better_by": self.estimate.mean}
        told |= {"low": self.plain.low, "high": self.plain.high}
        told |= {"adjusted_low": self.estimate.low, "adjusted_high": self.estimate.high}
        told |= {"smallest": MEASURES[self.measure].smallest}
        return told | {"effect": self.effect, "p": self.p, "verdict": self.verdict}


Means = Mapping[Cell, Mapping[int, Mapping[str, Mapping[str, float]]]]
"""Cell to repeat to setup to the mean of each measure over the trials."""


def repeat_means(rows: Iterable[Mapping[str, Any]]) -> Means:
    """The means over the trials with each second learner; cells in the order of reading.

    Measures that say nothing of a trial do not count in it.
    """
    trials: dict[Cell, dict[int, dict[str, list[Mapping[str, Any]]]]] = {}
    for row in rows:
        cell = Cell(preset=row["preset"], operator=row["operator"], arm=row["arm"])
        trials.setdefault(cell, {}).setdefault(row["repeat"], {}).setdefault(row["setup"], []).append(row)
    return {
        cell: {
            repeat: {
                setup: {name: _mean([one[name] for one in own]) for name in MEASURES}
                for setup, own in trials[cell][repeat].items()
            }
            for repeat in sorted(trials[cell])
        }
        for cell in sorted(trials, key=_order)
    }


def compare(means: Means) -> list[Compared]:
    """Setup 1 with Setup 2, and with the control where there is one.

    Each preset has families of questions of its own, each adjusted by Holm's method: the two measures of the
    paper in the primary arm, over all operators; these in the other arms; the other measures, likewise; and
    the control.
    """
    families: dict[tuple[Any, ...], list[tuple[Cell, str, str, np.ndarray]]] = {}
    for cell, repeats in means.items():
        for against in SETUPS[1:]:
            pairs = [setups for setups in repeats.values() if {"shared", against} <= set(setups)]
            for name, measure in MEASURES.items():
                sign = 1.0 if measure.better == "higher" else -1.0
                found = sign * np.array([one["shared"][name] - one[against][name] for one in pairs])
                if pairs:
                    family = (cell.preset, cell.arm == PRIMARY_ARM, measure.paper, against)
                    families.setdefault(family, []).append((cell, name, against, found))
    return [compared for questions in families.values() for compared in _answered(questions)]


def _answered(questions: Sequence[tuple[Cell, str, str, np.ndarray]]) -> list[Compared]:
    plain = [paired(found, np.zeros_like(found)) for *_, found in questions]
    p = [one.p for one in plain]
    answers = []
    for (cell, name, against, found), one, adjusted, level in zip(
        questions, plain, holm(p), holm_levels(p), strict=True
    ):
        estimate = paired(found, np.zeros_like(found), level=level).estimate
        answers.append(
            Compared(
                cell=cell,
                measure=name,
                against=against,
                differences=found,
                plain=one.estimate,
                estimate=estimate,
                effect=one.effect,
                p=adjusted,
                verdict=verdict(estimate, MEASURES[name].smallest),
            )
        )
    return answers


def _order(cell: Cell) -> tuple[int, int, int]:
    return PRESETS.index(cell.preset), list(OPERATORS).index(cell.operator), list(ARMS).index(cell.arm)


def _mean(values: Sequence[Any]) -> float:
    told = np.array([np.nan if value is None else float(value) for value in values])
    told = told[np.isfinite(told)]
    return float(told.mean()) if told.size else np.nan
