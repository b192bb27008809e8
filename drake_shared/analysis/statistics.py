"""Statistics of samples: bootstrap intervals, paired differences, multiple comparisons and verdicts."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

RESAMPLES = 10_000
FEWEST = 6
"""With fewer independent values no signed-rank test can reach 5%, and a bootstrap interval is too narrow."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Estimate:
    """A mean with its interval.

    Attributes:
        mean: Of the sample.
        low, high: Bootstrap interval of the mean; equal to the mean for a sample of one.
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
        estimate: Of the mean difference, at the given level.
        effect: Mean over standard deviation of the differences (Cohen's d_z); 0 if all are 0, infinite if all
            are another constant, NaN if there are fewer than two.
        p: Of the Wilcoxon signed-rank test; 1 if all differences are 0.
    """

    estimate: Estimate
    effect: float
    p: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement about a quantity, and its verdict.

    Attributes:
        text: The claim in words.
        estimate: Of the quantity; positive values support the claim. Its interval is adjusted for the number
            of comparisons.
        smallest: The smallest effect of interest, in the same unit.
        unit: Of the quantity.
        verdict: "holds", "equivalent", "reversed" or "open"; see `verdict`.
        p: Adjusted p-value, if there was a test.
        effect: Cohen's d_z, if the comparison is paired.
    """

    text: str
    estimate: Estimate
    smallest: float
    unit: str
    verdict: str
    p: float | None = None
    effect: float | None = None


def interval(values: ArrayLike, *, level: float = 0.95, seed: int = 0) -> Estimate:
    """Mean of ``values`` (n,) and its percentile bootstrap interval; NaN and infinite values are left out.

    The values must be independent: for example means over the trials of a learner, not the trials themselves.
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
    """The paired difference of ``one`` (n,) and ``other`` (n,); pairs with NaN are left out.

    Raises:
        ValueError: Their lengths differ.
    """
    first, second = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    if first.shape != second.shape:
        raise ValueError(f"paired samples must have one shape, got {first.shape} and {second.shape}")
    kept = np.isfinite(first - second)
    first, second = first[kept], second[kept]
    differences = first - second
    # Differences that vary by rounding only count as constant.
    rounding = (
        8.0 * np.finfo(float).eps * max(np.abs(first).max(initial=0.0), np.abs(second).max(initial=0.0))
    )
    if differences.size and np.ptp(differences) <= rounding:
        differences = np.full_like(differences, np.median(differences))
    estimate = interval(differences, level=level, seed=seed)
    return Difference(estimate=estimate, effect=_effect(differences), p=_signed_rank(differences))


def _effect(differences: NDArray[np.float64]) -> float:
    if differences.size < 2:
        return math.nan
    mean = float(differences.mean())
    if np.ptp(differences) == 0.0:
        return math.copysign(math.inf, mean) if mean else 0.0
    return mean / float(differences.std(ddof=1))


def _signed_rank(differences: NDArray[np.float64]) -> float:
    return float(stats.wilcoxon(differences).pvalue) if differences.any() else 1.0


def holm(p: Sequence[float]) -> list[float]:
    """Holm's adjusted p-values, which control the familywise error rate."""
    order = np.argsort(p, kind="stable")
    adjusted = np.empty(len(p))
    worst = 0.0
    for rank, index in enumerate(order):
        worst = max(worst, min(1.0, (len(p) - rank) * p[index]))
        adjusted[index] = worst
    return adjusted.tolist()


def holm_levels(p: Sequence[float], *, level: float = 0.95) -> list[float]:
    """Levels of the intervals that correspond to `holm`: 1 - alpha / (m - rank).

    Holm's method stops at the first hypothesis that it does not reject. All later ones get that level, since
    otherwise their intervals could exclude 0 although their adjusted p is above alpha.
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
    """The verdict of an interval on the claim that its quantity is positive.

    Returns:
        "holds" if the interval lies above ``smallest``, "reversed" if it lies below ``-smallest``,
        "equivalent" if it lies between the two; otherwise, or with fewer than six values, "open".
    """
    if not (math.isfinite(estimate.low) and math.isfinite(estimate.high)) or estimate.count < FEWEST:
        return "open"
    if estimate.low > smallest:
        return "holds"
    if estimate.high < -smallest:
        return "reversed"
    return "equivalent" if estimate.low > -smallest and estimate.high < smallest else "open"


def claim(text: str, values: ArrayLike, *, smallest: float, unit: str, level: float = 0.95) -> Claim:
    """The claim that the mean of ``values`` (n,) is positive, by its interval."""
    estimate = interval(values, level=level)
    return Claim(
        text=text, estimate=estimate, smallest=smallest, unit=unit, verdict=verdict(estimate, smallest)
    )


def not_worse(text: str, values: ArrayLike, *, margin: float, unit: str, level: float = 0.95) -> Claim:
    """The claim that the mean of ``values`` (n,) is above ``-margin`` (non-inferiority).

    It "holds" if the interval lies above that bound and is "reversed" if it lies below.
    """
    estimate = interval(values, level=level)
    if verdict(estimate, margin) == "reversed":
        found = "reversed"
    else:
        found = "holds" if estimate.count >= FEWEST and estimate.low > -margin else "open"
    return Claim(text=text, estimate=estimate, smallest=-margin, unit=unit, verdict=found)


def at_least(text: str, values: ArrayLike, *, least: float, unit: str, level: float = 0.95) -> Claim:
    """The claim that the mean of ``values`` (n,) is at least ``least``, with an interval above 0.

    Weaker than `claim`, which requires the whole interval above the smallest effect; if it does not hold, the
    verdict is that of `verdict`.
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
    """The claim that an event occurs in no trial; a single occurrence refutes it.

    With fewer than six learners the verdict is "open". The text gives the upper bound by the rule of three,
    3 / n, with n the number of learners, since the trials of one learner are not independent.

    Args:
        text: The event that does not occur.
        shares: Share of each learner's trials with the event: shape (learners,).
    """
    observed = np.asarray(shares, dtype=float)
    if observed.any():
        found = "reversed"
    else:
        found = "holds" if observed.size >= FEWEST else "open"
        text += f" (by the rule of three it may with {min(1.0, 3.0 / max(observed.size, 1)):.0%} of learners)"
    return Claim(text=text, estimate=interval(-100.0 * observed), smallest=0.0, unit="%", verdict=found)


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
