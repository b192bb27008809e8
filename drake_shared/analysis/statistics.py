"""What samples say: intervals by bootstrap, paired differences, many questions at once, and verdicts."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

RESAMPLES = 10_000
FEWEST = 6
"""Of fewer independent values no signed-rank test can reach 5%, and a bootstrap's interval is too narrow."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Estimate:
    """A mean with its interval.

    Attributes:
        mean: Of the sample.
        low, high: Of its interval by bootstrap; equal to the mean for a sample of one.
        count: Size of the sample.
    """

    mean: float
    low: float
    high: float
    count: int


@dataclasses.dataclass(frozen=True, kw_only=True)
class Difference:
    """A mean paired difference, one minus other.

    Attributes:
        estimate: Of the mean difference, at the level asked for.
        effect: Mean over standard deviation of the differences (Cohen's d_z); 0 where all are 0, infinite
            where all are one other number, NaN where there are fewer than two.
        p: Of the Wilcoxon signed-rank test; 1 where all differences are 0.
    """

    estimate: Estimate
    effect: float
    p: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement about a number, and whether it held.

    Attributes:
        text: What is claimed, in words.
        estimate: Of the number; positive speaks for the claim. Its interval is adjusted for the number of
            questions asked.
        smallest: The smallest effect of interest, in the same unit.
        unit: Of the number.
        verdict: "holds", "equivalent", "reversed" or "open"; see `verdict`.
        p: Adjusted, where a test was made.
        effect: Cohen's d_z, where the comparison is paired.
    """

    text: str
    estimate: Estimate
    smallest: float
    unit: str
    verdict: str
    p: float | None = None
    effect: float | None = None


def interval(values: ArrayLike, *, level: float = 0.95, seed: int = 0) -> Estimate:
    """Mean of ``values`` (n,) and its interval, by the percentile bootstrap over them; NaN do not count.

    The values must be independent: means over the trials of a learner, say, not the trials themselves.
    """
    sample = np.asarray(values, dtype=float)
    sample = sample[np.isfinite(sample)]
    if not sample.size:
        return Estimate(mean=math.nan, low=math.nan, high=math.nan, count=0)
    mean = float(sample.mean())
    if np.ptp(sample) == 0.0:
        return Estimate(mean=mean, low=mean, high=mean, count=sample.size)
    rng = np.random.default_rng(seed)
    means = np.empty(RESAMPLES)
    for begin in range(0, RESAMPLES, 1_000):
        means[begin : begin + 1_000] = sample[rng.integers(sample.size, size=(1_000, sample.size))].mean(
            axis=1
        )
    low, high = np.quantile(means, [0.5 - level / 2, 0.5 + level / 2])
    return Estimate(mean=mean, low=float(low), high=float(high), count=sample.size)


def paired(one: ArrayLike, other: ArrayLike, *, level: float = 0.95, seed: int = 0) -> Difference:
    """How much larger ``one`` (n,) is than ``other`` (n,), pair by pair; pairs with NaN do not count.

    Raises:
        ValueError: They are not of one length.
    """
    first, second = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    if first.shape != second.shape:
        raise ValueError(f"pairs need as many of one as of the other, got {first.shape} and {second.shape}")
    kept = np.isfinite(first - second)
    first, second = first[kept], second[kept]
    differences = first - second
    # What is left of a difference by rounding alone is no spread.
    rounding = (
        8.0 * np.finfo(float).eps * max(np.abs(first).max(initial=0.0), np.abs(second).max(initial=0.0))
    )
    if differences.size and np.ptp(differences) <= rounding:
        differences = np.full_like(differences, np.median(differences))
    estimate = interval(differences, level=level, seed=seed)
    return Difference(estimate=estimate, effect=_effect(differences), p=_signed_rank(differences))


def _effect(differences: np.ndarray) -> float:
    if differences.size < 2:
        return math.nan
    mean = float(differences.mean())
    if np.ptp(differences) == 0.0:
        return math.copysign(math.inf, mean) if mean else 0.0
    return mean / float(differences.std(ddof=1))


def _signed_rank(differences: np.ndarray) -> float:
    return float(stats.wilcoxon(differences).pvalue) if differences.any() else 1.0


def holm(p: Sequence[float]) -> list[float]:
    """Holm's adjusted p-values: the chance of one false rejection among all is at most that level."""
    order = np.argsort(p, kind="stable")
    adjusted = np.empty(len(p))
    worst = 0.0
    for rank, index in enumerate(order):
        worst = max(worst, min(1.0, (len(p) - rank) * p[index]))
        adjusted[index] = worst
    return adjusted.tolist()


def holm_levels(p: Sequence[float], *, level: float = 0.95) -> list[float]:
    """The level of each question's interval that goes with `holm`: 1 - alpha / (m - rank).

    Holm's method ends at the first question that it cannot decide. That one's level is the level of all that
    come after it; with less, their intervals could leave 0 out where their adjusted p is above alpha.
    """
    levels = np.empty(len(p))
    share, ended = 1.0 - level, False
    for rank, index in enumerate(np.argsort(p, kind="stable")):
        if not ended:
            share = (1.0 - level) / (len(p) - rank)
            ended = p[index] > share
        levels[index] = 1.0 - share
    return levels.tolist()


def verdict(estimate: Estimate, smallest: float) -> str:
    """What an interval says of a claim that its number is above 0.

    Returns:
        "holds" if all of it lies above ``smallest``, "reversed" if all lies below its negative, "equivalent"
        if all lies between the two, else, and with fewer than six values, "open".
    """
    if not (math.isfinite(estimate.low) and math.isfinite(estimate.high)) or estimate.count < FEWEST:
        return "open"
    if estimate.low > smallest:
        return "holds"
    if estimate.high < -smallest:
        return "reversed"
    return "equivalent" if estimate.low > -smallest and estimate.high < smallest else "open"


def claim(text: str, values: ArrayLike, *, smallest: float, unit: str, level: float = 0.95) -> Claim:
    """The claim that the mean of ``values`` (n,) is above 0, by its interval alone."""
    estimate = interval(values, level=level)
    return Claim(
        text=text, estimate=estimate, smallest=smallest, unit=unit, verdict=verdict(estimate, smallest)
    )


def not_worse(text: str, values: ArrayLike, *, margin: float, unit: str, level: float = 0.95) -> Claim:
    """The claim that the mean of ``values`` (n,) is above ``-margin``: not worse by as much as matters.

    It "holds" where the whole interval is above that bound and is "reversed" where all of it is below.
    """
    estimate = interval(values, level=level)
    if verdict(estimate, margin) == "reversed":
        found = "reversed"
    else:
        found = "holds" if estimate.count >= FEWEST and estimate.low > -margin else "open"
    return Claim(text=text, estimate=estimate, smallest=-margin, unit=unit, verdict=found)


def at_least(text: str, values: ArrayLike, *, least: float, unit: str, level: float = 0.95) -> Claim:
    """The claim that the mean of ``values`` (n,) is ``least`` or more, and its interval above 0.

    Weaker than `claim`, which asks for the whole interval to be above the smallest effect; where it does not
    hold the verdict is that of `verdict`.
    """
    estimate = interval(values, level=level)
    held = estimate.count >= FEWEST and estimate.mean >= least and estimate.low > 0.0
    return Claim(
        text=text,
        estimate=estimate,
        smallest=least,
        unit=unit,
        verdict="holds" if held else verdict(estimate, least),
    )


def never(text: str, shares: ArrayLike) -> Claim:
    """The claim that something happens in no trial: one is enough to refute it.

    That it was not seen says much only where many had the chance, so that with fewer than six learners it is
    open, and the claim tells what the rule of three leaves possible: 3 / n, of learners, as the trials with
    one are alike.

    Args:
        text: What does not happen.
        shares: Of the trials with each learner those in which it did, shape (learners,).
    """
    seen = np.asarray(shares, dtype=float)
    if seen.any():
        found = "reversed"
    else:
        found = "holds" if seen.size >= FEWEST else "open"
        text += f" (by the rule of three it may with {min(1.0, 3.0 / max(seen.size, 1)):.0%} of learners)"
    return Claim(text=text, estimate=interval(-100.0 * seen), smallest=0.0, unit="%", verdict=found)


def paired_claims(questions: Sequence[dict[str, Any]], *, level: float = 0.95) -> list[Claim]:
    """Claims that "one" is larger than "other", adjusted together by Holm's method.

    Args:
        questions: Each with ``text``, ``one`` (n,), ``other`` (n,), ``smallest`` and ``unit``.
    """
    p = [paired(question["one"], question["other"]).p for question in questions]
    claims = []
    for question, adjusted, own_level in zip(questions, holm(p), holm_levels(p, level=level), strict=True):
        found = paired(question["one"], question["other"], level=own_level)
        claims.append(
            Claim(
                text=question["text"],
                estimate=found.estimate,
                smallest=question["smallest"],
                unit=question["unit"],
                verdict=verdict(found.estimate, question["smallest"]),
                p=adjusted,
                effect=found.effect,
            )
        )
    return claims
