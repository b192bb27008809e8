"""Tests and confidence intervals of a mean that agree with each other, from independent values.

Two procedures, each of which gives p-values and limits from the same distribution:

- Values that vary are judged by their studentised mean: Student's t, and the same corrected for skewness by
  the monotone cubic transformation of Hall (1992, "On the removal of skewness by transformation"), whichever
  is more cautious on each side. A sample shows less skewness than its population, by about half in ten
  exponential values, so the sample skewness is multiplied by 1 + 10 / n. Few values may show none of it, and
  families of questions are decided far in the tails, so that a two-sided p-value is never smaller than the
  probability with which the mean of as many exponential values lies so far below that of their population.
  Above 2.5% it may be: its geometric mean with 2.5% is the limit. Otherwise 95% intervals of six normal
  values would contain the mean in 99%.
- Where more than half of the values are the same, or ``exact`` is requested, the studentised mean says
  nothing about rare events that the sample does not show. The bound of Learned-Miller and Thomas (2020, "A
  new confidence interval for the mean of a bounded random variable") takes its place, which needs the range
  of the quantity. For values 0 and 1 it is the interval of Clopper and Pearson. Without a range there is no
  bound, and the interval is infinite.

All functions take samples along the last axis, so that many are judged at once.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray
from scipy import special

Floats = NDArray[np.float64]
UNBOUNDED = (-np.inf, np.inf)
_DRAWS = 20_000
_GUARDED = 0.025
"""Two-sided p-values up to here are at least those of exponential values."""


def tail_probabilities(
    values: Floats, null: float, *, bounds: tuple[float, float] = UNBOUNDED, exact: bool = False
) -> tuple[Floats, Floats]:
    """One-sided p-values of the hypotheses that the mean is at most ``null``, and that it is at least that.

    Args:
        values: Shape (..., n), independent along the last axis, finite.
        null: The value to compare with.
        bounds: The least and the largest possible value.
        exact: Always use the bound for bounded quantities.

    Returns:
        Two arrays of shape (...): small values speak for a mean above ``null``, and below it.
    """
    tied = _is_tied(values, bounds) | exact
    above, below = np.ones(tied.shape), np.ones(tied.shape)
    if (free := ~tied).any():
        above[free], below[free] = _student_and_hall(values[free], null)
    for index in map(tuple, np.argwhere(tied)):
        if np.isfinite(bounds).all():
            highest = _highest_means(values[index], bounds[1])
            lowest = -_highest_means(-values[index], -bounds[0])
            below[index] = (1 + (highest >= null).sum()) / (_DRAWS + 1)
            above[index] = (1 + (lowest <= null).sum()) / (_DRAWS + 1)
    return above, below


def verdict_probabilities(
    values: Floats,
    *,
    above: float,
    below: float,
    bounds: tuple[float, float] = UNBOUNDED,
    exact: bool = False,
) -> dict[str, Floats]:
    """One-sided p-values, shape (...), of the three verdicts about a mean; see `tail_probabilities`.

    Returns:
        holds: Small values speak for a mean larger than ``above``.
        reversed: For one smaller than ``below``.
        equivalent: For one between the two.
    """
    over_above, under_above = tail_probabilities(values, above, bounds=bounds, exact=exact)
    over_below, under_below = tail_probabilities(values, below, bounds=bounds, exact=exact)
    return {
        "holds": over_above,
        "reversed": under_below,
        "equivalent": np.maximum(over_below, under_above),
    }


def mean_limits(
    values: Floats, level: float = 0.95, *, bounds: tuple[float, float] = UNBOUNDED, exact: bool = False
) -> tuple[Floats, Floats]:
    """Limits of the mean, each exceeded with probability (1 - ``level``) / 2; see `tail_probabilities`.

    A value lies outside of them if, and only if, its p-value is at most (1 - ``level``) / 2.
    """
    tail = (1.0 - level) / 2.0
    tied = _is_tied(values, bounds) | exact
    low, high = np.full(tied.shape, bounds[0]), np.full(tied.shape, bounds[1])
    if (free := ~tied).any():
        limits = _student_and_hall_limits(values[free], tail)
        low[free], high[free] = (np.clip(one, *bounds) for one in limits)
    rank = int(tail * (_DRAWS + 1) * (1.0 + 1e-12))
    for index in map(tuple, np.argwhere(tied)):
        if np.isfinite(bounds).all() and rank:
            highest = _highest_means(values[index], bounds[1])
            lowest = -_highest_means(-values[index], -bounds[0])
            high[index] = np.partition(highest, _DRAWS - rank)[_DRAWS - rank]
            low[index] = np.partition(lowest, rank - 1)[rank - 1]
    return low, high


def _is_tied(values: Floats, bounds: tuple[float, float]) -> NDArray[np.bool_]:
    """Whether more than half of the values are the same; always so for fewer than two."""
    n = values.shape[-1]
    if n < 2:
        return np.ones(values.shape[:-1], dtype=bool)
    ordered = np.sort(values, axis=-1)
    # A run of more than n / 2 equal values contains two that are n // 2 places apart.
    scale = bounds[1] - bounds[0] if np.isfinite(bounds).all() else 0.0
    rounding = 1e-12 * np.maximum(np.abs(ordered).max(axis=-1, keepdims=True), scale)
    same: NDArray[np.bool_] = (ordered[..., n // 2 :] - ordered[..., : n - n // 2] <= rounding).any(axis=-1)
    return same


def _moments(values: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean, standard error and enlarged skewness of samples."""
    n = values.shape[-1]
    mean = values.mean(axis=-1)
    deviations = values - mean[..., None]
    spread = np.sqrt((deviations**2).mean(axis=-1))
    skewness = (deviations**3).mean(axis=-1) / spread**3
    return mean, spread / np.sqrt(n - 1), skewness * (1.0 + 10.0 / n)


def _student_and_hall(values: Floats, null: float) -> tuple[Floats, Floats]:
    n = values.shape[-1]
    mean, error, skewness = _moments(values)
    t = (mean - null) / error
    third = skewness * t / (3.0 * np.sqrt(n))
    z = t * (1.0 + third + third**2 / 3.0) + skewness / (6.0 * np.sqrt(n))
    log_t, log_p = _exponential_tail(n)
    missed = np.exp(np.interp(np.log(np.maximum(np.abs(t), 1e-300)), log_t, log_p))
    guard = 0.5 * np.minimum(missed, np.sqrt(_GUARDED * missed))
    return (
        np.maximum(special.stdtr(n - 1, -np.minimum(t, z)), guard),
        np.maximum(special.stdtr(n - 1, np.maximum(t, z)), guard),
    )


def _student_and_hall_limits(values: Floats, tail: float) -> tuple[Floats, Floats]:
    n = values.shape[-1]
    mean, error, skewness = _moments(values)
    quantile = -special.stdtrit(n - 1, tail)
    limits = []
    for z in (quantile, -quantile):
        # The inverse of the cubic in _student_and_hall.
        step = z - skewness / (6.0 * np.sqrt(n))
        root = np.cbrt(1.0 + skewness * step / np.sqrt(n))
        limits.append(3.0 * step / (1.0 + root + root**2))
    log_t, log_p = _exponential_tail(n)
    missed = np.log(max(2.0 * tail, 4.0 * tail**2 / _GUARDED))
    widest = max(quantile, np.exp(np.interp(-missed, -log_p, log_t)))
    return mean - np.maximum(limits[0], widest) * error, mean - np.minimum(limits[1], -widest) * error


@functools.lru_cache(maxsize=64)
def _exponential_tail(n: int) -> tuple[Floats, Floats]:
    """Logarithms of t, increasing, and of the probability that the t of n exponential values is below -t.

    Their minimum, the sum of their distances from it, and the shape of these distances are independent. The
    minimum is exponential with mean 1/n, and the sum has a gamma distribution; only the shape is drawn.
    """
    apart = np.random.default_rng(0).exponential(size=(4_000, n))
    apart -= apart.min(axis=1, keepdims=True)
    ratio = apart.std(axis=1, ddof=1) / apart.sum(axis=1)
    ratio = np.quantile(ratio, (np.arange(100) + 0.5) / 100)
    t = np.geomspace(0.01, 1e6, 120)
    # The sum is at most as much as leaves the mean t standard errors below 1, given the minimum.
    nodes, weights = np.polynomial.legendre.leggauss(24)
    minimum, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    most = (1.0 - minimum) / (1.0 / n + t[:, None, None] * ratio[:, None] / np.sqrt(n))
    density = n * np.exp(-n * minimum) * weights
    p = (special.gammainc(n - 1, most) * density).sum(axis=-1).mean(axis=-1)
    return np.log(t), np.log(np.maximum(p, 1e-300))


def _highest_means(values: Floats, bound: float) -> Floats:
    """Draws of the largest mean that fits a sample of values (n,) below ``bound``: shape (draws,)."""
    gaps = np.diff(np.append(np.sort(values), bound))
    found: Floats = bound - _order_statistics(len(values)) @ gaps
    return found


@functools.lru_cache(maxsize=4)
def _order_statistics(n: int) -> Floats:
    """Ordered samples of the uniform distribution, shape (draws, n); always the same."""
    return np.sort(np.random.default_rng(0).random((_DRAWS, n)), axis=1)
