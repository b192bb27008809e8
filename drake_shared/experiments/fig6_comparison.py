"""Compares second learners: paired differences over repeats, adjusted within families of comparisons."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.mean_tests import UNBOUNDED
from drake_shared.analysis.statistics import Claim, Estimate, Question, interval, judge
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
        bounds: The least and the largest possible difference.
    """

    better: str
    smallest: float
    unit: str
    paper: bool
    bounds: tuple[float, float] = UNBOUNDED


# Over a drive of 10 s, 20 rad/s correspond to 0.05 rad/s at each wheel in each step: half of the operator's
# own noise, and 4% of the usual value; as a rate, 0.1 rad/s for both wheels together. The others: two trials
# in a hundred, 2 of about 85 rad, and 1 cm of about 15 cm of clearance.
CRITERIA = {
    "disagreement": Criterion(better="lower", smallest=20.0, unit="rad/s", paper=True),
    "mean_human_weight": Criterion(better="lower", smallest=0.02, unit="", paper=True, bounds=(-1.0, 1.0)),
    "disagreement_rate": Criterion(better="lower", smallest=0.1, unit="rad/s", paper=False),
    "intent_success": Criterion(better="higher", smallest=0.02, unit="", paper=False, bounds=(-1.0, 1.0)),
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
        claim: Whether Setup 1 is better, decided within the family of comparisons.
    """

    cell: Cell
    measure: str
    against: str
    differences: NDArray[np.float64]
    plain: Estimate
    claim: Claim

    @property
    def estimate(self) -> Estimate:
        """Their mean, with the interval adjusted for the family."""
        return self.claim.estimate

    @property
    def verdict(self) -> str:
        """Whether Setup 1 is better; see `Claim`."""
        return self.claim.verdict

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
            "effect": self.claim.effect,
            "p": self.claim.p,
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


def compare(means: Means, missing: Iterable[Mapping[str, Any]] = ()) -> list[Comparison]:
    """Compares Setup 1 with Setup 2, and with the control where there is one.

    A repeat is missing where a setup could not be driven, so that leaving it out favours that setup. So a
    verdict also has to follow if all missing repeats had the least possible difference, and if they had the
    largest (of measures without bounds: the least and the largest that were seen). Otherwise it is open.

    Each preset has families of comparisons, each adjusted by Holm's method: the two measures of the paper in
    the primary arm over all operators; the same in the other arms; the other measures, likewise; and the
    control.

    Args:
        means: Of the repeats.
        missing: A row with preset and operator for each missing repeat.
    """
    lost = Counter((row["preset"], row["operator"]) for row in missing)
    families: dict[tuple[str, bool, bool, str], list[tuple[Cell, str, str, NDArray[np.float64]]]] = {}
    for cell, repeats in means.items():
        for against in SETUPS[1:]:
            pairs = [setups for setups in repeats.values() if {"shared", against} <= set(setups)]
            for name, criterion in CRITERIA.items():
                sign = 1.0 if criterion.better == "higher" else -1.0
                differences = sign * np.array([one["shared"][name] - one[against][name] for one in pairs])
                if pairs:
                    family = (cell.preset, cell.arm == PRIMARY_ARM, criterion.paper, against)
                    families.setdefault(family, []).append((cell, name, against, differences))
    return [compared for family, members in families.items() for compared in _judged(family, members, lost)]


def _judged(
    family: tuple[str, bool, bool, str],
    members: Sequence[tuple[Cell, str, str, NDArray[np.float64]]],
    lost: Mapping[tuple[str, str], int],
) -> list[Comparison]:
    preset, primary, paper, against = family
    name = ", ".join(
        (
            f"second learners ({preset})",
            "primary arm" if primary else "other arms",
            "the paper's measures" if paper else "other measures",
            "against Setup 2" if against == "human" else "against the control",
        )
    )
    claims = judge(name, [_question(*member) for member in members])
    counts = [lost.get((cell.preset, cell.operator), 0) for cell, *_ in members]
    for extreme in (0, 1) if any(counts) else ():
        imputed = judge(
            name,
            [
                _question(*member, missing=count, extreme=extreme)
                for member, count in zip(members, counts, strict=True)
            ],
        )
        claims = [
            claim
            if claim.verdict == other.verdict
            else dataclasses.replace(
                claim, verdict="open", note=f"{count} missing repeats could change the verdict"
            )
            for claim, other, count in zip(claims, imputed, counts, strict=True)
        ]
    return [
        Comparison(
            cell=cell,
            measure=measure,
            against=against,
            differences=differences,
            plain=interval(differences, bounds=CRITERIA[measure].bounds),
            claim=claim,
        )
        for (cell, measure, against, differences), claim in zip(members, claims, strict=True)
    ]


def _question(
    cell: Cell,
    measure: str,
    against: str,
    differences: NDArray[np.float64],
    *,
    missing: int = 0,
    extreme: int = 0,
) -> Question:
    """The question of a comparison, with the least (0) or the largest (1) difference for missing repeats."""
    criterion = CRITERIA[measure]
    if missing and np.isfinite(differences).any():
        seen = float(np.nanmin(differences)), float(np.nanmax(differences))
        limits = criterion.bounds if np.isfinite(criterion.bounds).all() else seen
        differences = np.append(differences, np.full(missing, limits[extreme]))
    setup = "Setup 2" if against == "human" else "the control"
    text = f"{measure.replace('_', ' ').capitalize()} is {criterion.better} with Setup 1 than with {setup}"
    text += f" (preset {cell.preset}{'' if criterion.paper else '; not reported in the paper'})"
    return Question(
        text=text,
        values=differences,
        unit=criterion.unit,
        above=criterion.smallest,
        below=-criterion.smallest,
        bounds=criterion.bounds,
        paired=True,
        units="repeats",
    )


def _order(cell: Cell) -> tuple[int, int, int]:
    return PRESETS.index(cell.preset), list(OPERATORS).index(cell.operator), list(ARMS).index(cell.arm)
