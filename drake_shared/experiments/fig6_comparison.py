"""Compares second learners: paired differences over repeats, adjusted within families of comparisons."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.statistics import Estimate, holm, holm_levels, paired, verdict
from drake_shared.experiments.measures import finite_mean
from drake_shared.experiments.training import PRESETS
from drake_shared.operators.named import OPERATORS

PRIMARY_OPERATOR = "primary"
PRIMARY_ARM = "weighted, K kept"
"""Chosen before the experiment was run: the paper weights by score, and tuned K once, by hand."""
ARMS = {
    "weighted, K kept": (True, True),
    "weighted, K anew": (True, False),
    "even, K kept": (False, True),
    "even, K anew": (False, False),
}
"""Whether scores weight the demonstrations, and whether the K of the first learner is kept, by name."""
SETUPS = ("shared", "human", "more")
"""Setup 1, Setup 2, and the control: as many further demonstrations of the first kind."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Criterion:
    """How a measure of trials is compared.

    Attributes:
        better: "lower" or "higher".
        smallest: The smallest effect of interest.
        unit: Of the measure.
        paper: Whether the paper makes a claim about it.
    """

    better: str
    smallest: float
    unit: str
    paper: bool


# Over a drive of 10 s, 20 rad/s correspond to 0.05 rad/s at each wheel in each step: half of the operator's
# own noise, and 4% of the usual value; as a rate, 0.1 rad/s for both wheels together. The others: two trials
# in a hundred, 2 of about 85 rad, and 1 cm of about 15 cm of clearance.
CRITERIA = {
    "disagreement": Criterion(better="lower", smallest=20.0, unit="rad/s", paper=True),
    "mean_human_weight": Criterion(better="lower", smallest=0.02, unit="", paper=True),
    "disagreement_rate": Criterion(better="lower", smallest=0.1, unit="rad/s", paper=False),
    "intent_success": Criterion(better="higher", smallest=0.02, unit="", paper=False),
    "human_effort": Criterion(better="lower", smallest=2.0, unit="rad", paper=False),
    "clearance": Criterion(better="higher", smallest=0.01, unit="m", paper=False),
}
"""Criteria by the name of the measure."""
OF_PAPER = tuple(name for name, criterion in CRITERIA.items() if criterion.paper)
"""The measures about which the paper makes a claim."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Cell:
    """Repeats that differ only in their seeds."""

    preset: str
    operator: str
    arm: str

    @property
    def is_primary(self) -> bool:
        """Whether it belongs to the primary inference."""
        return (self.operator, self.arm) == (PRIMARY_OPERATOR, PRIMARY_ARM)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Comparison:
    """By how much Setup 1 is better than another setup.

    Attributes:
        cell: The repeats.
        measure: Name of the measure.
        against: The other setup: "human" (Setup 2) or "more" (the control).
        differences: One for each repeat, shape (n,); positive if Setup 1 is better.
        plain: Their mean, with the 95% interval.
        estimate: Their mean, with the interval adjusted for the family of comparisons.
        effect, p, verdict: See `Claim`.
    """

    cell: Cell
    measure: str
    against: str
    differences: NDArray[np.float64]
    plain: Estimate
    estimate: Estimate
    effect: float
    p: float
    verdict: str

    @property
    def row(self) -> dict[str, Any]:
        """A row of plain values."""
        return {
            **dataclasses.asdict(self.cell),
            "measure": self.measure,
            "against": self.against,
            "repeats": self.estimate.count,
            "better_by": self.estimate.mean,
            "low": self.plain.low,
            "high": self.plain.high,
            "adjusted_low": self.estimate.low,
            "adjusted_high": self.estimate.high,
            "smallest": CRITERIA[self.measure].smallest,
            "effect": self.effect,
            "p": self.p,
            "verdict": self.verdict,
        }


Means = Mapping[Cell, Mapping[int, Mapping[str, Mapping[str, float]]]]
"""The mean of each measure over trials, by cell, repeat, setup and measure."""


def repeat_means(rows: Iterable[Mapping[str, Any]]) -> Means:
    """The means over the trials with each second learner, in the order of the report.

    Values that are None or NaN are skipped.
    """
    trials: dict[Cell, dict[int, dict[str, list[Mapping[str, Any]]]]] = {}
    for row in rows:
        cell = Cell(preset=row["preset"], operator=row["operator"], arm=row["arm"])
        trials.setdefault(cell, {}).setdefault(row["repeat"], {}).setdefault(row["setup"], []).append(row)
    return {
        cell: {
            repeat: {setup: _means(own) for setup, own in trials[cell][repeat].items()}
            for repeat in sorted(trials[cell])
        }
        for cell in sorted(trials, key=_order)
    }


def _means(trials: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    return {
        name: finite_mean([np.nan if trial[name] is None else float(trial[name]) for trial in trials])
        for name in CRITERIA
    }


def compare(means: Means) -> list[Comparison]:
    """Compares Setup 1 with Setup 2, and with the control where there is one.

    Each preset has families of comparisons, each adjusted by Holm's method: the two measures of the paper in
    the primary arm over all operators; the same in the other arms; the other measures, likewise; and the
    control.
    """
    families: dict[tuple[Any, ...], list[tuple[Cell, str, str, NDArray[np.float64]]]] = {}
    for cell, repeats in means.items():
        for against in SETUPS[1:]:
            pairs = [setups for setups in repeats.values() if {"shared", against} <= set(setups)]
            for name, criterion in CRITERIA.items():
                sign = 1.0 if criterion.better == "higher" else -1.0
                differences = sign * np.array([one["shared"][name] - one[against][name] for one in pairs])
                if pairs:
                    family = (cell.preset, cell.arm == PRIMARY_ARM, criterion.paper, against)
                    families.setdefault(family, []).append((cell, name, against, differences))
    return [compared for family in families.values() for compared in _adjusted(family)]


def _adjusted(family: Sequence[tuple[Cell, str, str, NDArray[np.float64]]]) -> list[Comparison]:
    plain = [paired(differences, np.zeros_like(differences)) for *_, differences in family]
    p = [one.p for one in plain]
    found = []
    for (cell, name, against, differences), one, adjusted, level in zip(
        family, plain, holm(p), holm_levels(p), strict=True
    ):
        estimate = paired(differences, np.zeros_like(differences), level=level).estimate
        found.append(
            Comparison(
                cell=cell,
                measure=name,
                against=against,
                differences=differences,
                plain=one.estimate,
                estimate=estimate,
                effect=one.effect,
                p=adjusted,
                verdict=verdict(estimate, CRITERIA[name].smallest),
            )
        )
    return found


def _order(cell: Cell) -> tuple[int, int, int]:
    return PRESETS.index(cell.preset), list(OPERATORS).index(cell.operator), list(ARMS).index(cell.arm)
