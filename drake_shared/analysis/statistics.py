"""Questions about means, decided together in families, and estimates of means with their intervals.

Every question divides the possible values of a mean into up to three parts: where its claim holds, where it
is reversed, and, between the two, where both sides are equivalent. Its p-value is twice the smallest of three
one-sided ones: of a test of superiority, of its mirror image, and of two one-sided tests of equivalence
(Schuirmann 1987). A verdict follows where the p-value, adjusted by Holm's method within the family, is at
most 5%: the probability that a family contains any false verdict is then at most that. The interval of a
claim has the level at which its question was decided, so that it lies within the part of its verdict.

The values must be independent: means over the trials of each learner, not the trials themselves.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from drake_shared.analysis.mean_tests import UNBOUNDED, mean_limits, verdict_probabilities

FEWEST = 6
"""With fewer values the intervals do not cover what they should, and every question stays open."""
ALPHA = 0.05
"""Largest probability of any false verdict in a family."""
PERCENT = (0.0, 100.0)
POINTS = (-100.0, 100.0)
"""Bounds of percentages, and of their differences."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Estimate:
    """A mean with its interval.

    Attributes:
        mean: Of the sample.
        low, high: Limits of the mean; infinite where the sample does not determine them.
        count: Size of the sample.
    """

    mean: float
    low: float
    high: float
    count: int


@dataclasses.dataclass(frozen=True, kw_only=True)
class Question:
    """A claim about the mean of a sample, before it is decided.

    Attributes:
        text: The claim in words.
        values: Independent values, shape (n,); NaN and infinite ones are left out.
        unit: Of the values.
        above: The claim holds if the mean is larger.
        below: The claim is reversed if the mean is smaller; at most ``above``.
        bounds: The least and the largest possible value. Without them nothing can be concluded from a sample
            in which most values are the same.
        exact: Whether the values are counts of a rare event; see `drake_shared.analysis.mean_tests`.
        paired: Whether the values are differences of pairs.
        units: What is independent, in words: "learners", "repeats", "demonstration sets".
    """

    text: str
    values: ArrayLike
    unit: str
    above: float
    below: float
    bounds: tuple[float, float] = UNBOUNDED
    exact: bool = False
    paired: bool = False
    units: str = "learners"

    def __post_init__(self) -> None:
        if not self.below <= self.above:
            raise ValueError(f"below must be at most above, got {self.below} and {self.above}")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Claim:
    """A question and its verdict.

    Attributes:
        text: The claim in words.
        estimate: Of the quantity, with the interval at ``level``.
        smallest: The value beyond which the claim holds, in the same unit.
        unit: Of the quantity.
        verdict: "holds", "reversed", "equivalent" or "open".
        p: Adjusted p-value; the verdict is open if it is above 5%, or if there are fewer than six values.
        effect: Cohen's d_z, if the comparison is paired.
        level: Level of the interval, adjusted for the family.
        family: Questions that were decided together.
        note: What the sample means where its values are all the same; otherwise empty.
    """

    text: str
    estimate: Estimate
    smallest: float
    unit: str
    verdict: str
    p: float
    effect: float | None
    level: float
    family: str
    note: str = ""


def interval(
    values: ArrayLike,
    *,
    level: float = 0.95,
    bounds: tuple[float, float] = UNBOUNDED,
    exact: bool = False,
) -> Estimate:
    """Mean of ``values`` (n,) and its interval; NaN and infinite values are left out.

    Args:
        values: Independent values.
        level: Probability with which the interval contains the mean.
        bounds: The least and the largest possible value.
        exact: Whether the values are counts of a rare event; see `drake_shared.analysis.mean_tests`.
    """
    sample = _finite(values)
    if not sample.size:
        return Estimate(mean=math.nan, low=math.nan, high=math.nan, count=0)
    low, high = mean_limits(sample, level, bounds=bounds, exact=exact)
    return Estimate(mean=float(sample.mean()), low=float(low), high=float(high), count=sample.size)


def differences(one: ArrayLike, other: ArrayLike) -> NDArray[np.float64]:
    """The differences of pairs, ``one`` (n,) minus ``other`` (n,); those by rounding only are 0.

    Raises:
        ValueError: Their lengths differ.
    """
    first, second = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    if first.shape != second.shape:
        raise ValueError(f"paired samples must have one shape, got {first.shape} and {second.shape}")
    found: NDArray[np.float64] = first - second
    found[np.abs(found) <= 1e-12 * np.maximum(np.abs(first), np.abs(second))] = 0.0
    return found


def larger(
    text: str,
    one: ArrayLike,
    other: ArrayLike,
    *,
    smallest: float,
    unit: str,
    bounds: tuple[float, float] = UNBOUNDED,
    units: str = "learners",
) -> Question:
    """Is ``one`` (n,) larger than ``other`` (n,), in pairs, by more than the smallest effect of interest?"""
    return Question(
        text=text,
        values=differences(one, other),
        unit=unit,
        above=smallest,
        below=-smallest,
        bounds=bounds,
        paired=True,
        units=units,
    )


def at_least(
    text: str,
    values: ArrayLike,
    *,
    least: float,
    unit: str,
    bounds: tuple[float, float] = UNBOUNDED,
    paired: bool = False,
    units: str = "learners",
) -> Question:
    """Is the mean of ``values`` (n,) at least ``least``? It is reversed if it is less."""
    return Question(
        text=text,
        values=values,
        unit=unit,
        above=least,
        below=least,
        bounds=bounds,
        paired=paired,
        units=units,
    )


def not_worse(
    text: str,
    one: ArrayLike,
    other: ArrayLike,
    *,
    margin: float,
    unit: str,
    bounds: tuple[float, float] = UNBOUNDED,
    units: str = "learners",
) -> Question:
    """Is ``one`` (n,) lower than ``other`` (n,), in pairs, by less than ``margin`` (non-inferiority)?"""
    values = differences(one, other)
    return at_least(text, values, least=-margin, unit=unit, bounds=bounds, paired=True, units=units)


def seldom(text: str, events: ArrayLike, *, most: float, units: str = "learners") -> Question:
    """Does an event occur with less than ``most``, in %, of the learners?

    The quantity is the negative share of learners, in %, with its exact interval. That an event was not seen
    in n learners bounds this share, but does not show that it never occurs.

    Args:
        text: The claim.
        events: Whether it occurred in any trial of each learner, or the share of these trials: shape (n,).
        most: The share of learners below which the claim holds.
        units: See `Question`.
    """
    occurred = np.asarray(events, dtype=float)
    values = np.where(np.isfinite(occurred), -100.0 * (occurred > 0.0), np.nan)
    return Question(
        text=text,
        values=values,
        unit="%",
        above=-most,
        below=-most,
        bounds=(-100.0, 0.0),
        exact=True,
        units=units,
    )


def judge(family: str, questions: Sequence[Question], *, alpha: float = ALPHA) -> list[Claim]:
    """Decides a family of questions, with at most ``alpha`` probability of any false verdict among them.

    Args:
        family: Its name in the report.
        questions: All that are asked together, declared before the data are seen.
        alpha: The probability.
    """
    found = [_verdict_and_p(question) for question in questions]
    adjusted = holm([p for _, p in found])
    levels = holm_levels([p for _, p in found], level=1.0 - alpha)
    claims = []
    for question, (verdict, _), p, level in zip(questions, found, adjusted, levels, strict=True):
        sample = _finite(question.values)
        estimate = interval(sample, level=level, bounds=question.bounds, exact=question.exact)
        claims.append(
            Claim(
                text=question.text,
                estimate=estimate,
                smallest=question.above,
                unit=question.unit,
                verdict=verdict if p <= alpha else "open",
                p=p,
                effect=_effect(sample) if question.paired else None,
                level=level,
                family=family,
                note=_note(sample, question),
            )
        )
    return claims


def _verdict_and_p(question: Question) -> tuple[str, float]:
    """The verdict that the values support best, and its p-value before adjustment."""
    sample = _finite(question.values)
    if sample.size < FEWEST:
        return "open", 1.0
    p = {
        verdict: float(one)
        for verdict, one in verdict_probabilities(
            sample,
            above=question.above,
            below=question.below,
            bounds=question.bounds,
            exact=question.exact,
        ).items()
    }
    best = min(p, key=lambda verdict: p[verdict])
    return best, min(1.0, 2.0 * p[best])


def _effect(values: NDArray[np.float64]) -> float:
    """Mean over standard deviation; 0 if all are 0, infinite if all are another constant."""
    if values.size < 2:
        return math.nan
    mean, spread = float(values.mean()), float(values.std(ddof=1))
    if spread <= 1e-12 * abs(mean):
        return math.copysign(math.inf, mean) if mean else 0.0
    return mean / spread


def _note(sample: NDArray[np.float64], question: Question) -> str:
    if not sample.size or np.ptp(sample) > 0.0 or not (question.paired or question.exact) or sample[0]:
        return ""
    share = stats.binomtest(0, sample.size, alternative="less").proportion_ci(0.95, "exact").high
    seen, may = ("difference", "differ") if question.paired else ("case", "have one")
    return f"no {seen} seen in {sample.size} {question.units}; up to {share:.0%} may {may}"


def _finite(values: ArrayLike) -> NDArray[np.float64]:
    sample = np.asarray(values, dtype=float)
    finite: NDArray[np.float64] = sample[np.isfinite(sample)]
    return finite


def holm(p: Sequence[float]) -> list[float]:
    """Holm's adjusted p-values, which control the probability of any false verdict."""
    # multipletests of statsmodels collects all garbage at each call, which takes a hundred times as long.
    order = np.argsort(p, kind="stable")
    multiplied = np.asarray(p, dtype=float)[order] * np.arange(len(p), 0, -1)
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(np.maximum.accumulate(multiplied), 1.0)
    return adjusted.tolist()


def holm_levels(p: Sequence[float], *, level: float = 0.95) -> list[float]:
    """Levels of the intervals that correspond to `holm`: 1 - alpha / (m - rank).

    Holm's method stops at the first hypothesis that it does not reject. All later ones get that level, since
    otherwise their intervals could exclude a value although their adjusted p is above alpha.
    """
    levels = np.empty(len(p))
    share, ended = 1.0 - level, False
    for rank, index in enumerate(np.argsort(p, kind="stable")):
        if not ended:
            share = (1.0 - level) / (len(p) - rank)
            ended = p[index] > share
        levels[index] = 1.0 - share
    return levels.tolist()
