"""Notices from the noise of a drive that somebody else than a known person drives, or that person again.

The statistic is a cumulative sum (Page, Continuous inspection schemes, 1954) of the log-likelihood ratio of
the noise found in each step: among the noises of anybody against those of the person, and the other way round
once somebody else drives. Where the noises found are independent draws from those of the driver, the mean
time between false notices is at least the one that is asked for (Lorden 1971).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class DriverChange:
    """The test for n drivers at once, over G pairs of noise and time constant.

    Args:
        person: Shape (G,), the person's probability of each pair; all positive. Anybody has all alike.
        period: Of the control step, in [s].
        memory: Time after which the noise found counts as another observation, in [s].
        false_notices: Least mean time between false notices, in [s].
    """

    def __init__(self, person: Floats, *, period: float, memory: float, false_notices: float) -> None:
        anybody = np.full_like(person, 1.0 / len(person))
        self._priors = person[:, None], anybody[:, None]
        self._ratios = tuple(one / other for one, other in (self._priors[::-1], self._priors))
        self._share = period / memory
        self._limit = math.log(false_notices / memory)

    def prior(self, another: Floats) -> Floats:
        """Probability (G, n) of each pair; ``another`` (n,) is 1 where it is not the person who drives."""
        return np.where(another > 0.0, *self._priors[::-1])

    def step(
        self, cusum: Floats, another: Floats, noise: Floats, gives: NDArray[np.bool_]
    ) -> tuple[Floats, Floats, Floats]:
        """What follows from the noise found in one more step.

        Args:
            cusum: Shape (n,), the sum so far; 0 at the start.
            another: Shape (n,), 1 where somebody else than the person drives; 0 at the start.
            noise: Shape (G, n), probability of each pair given the commands so far.
            gives: Shape (n,), whether each driver gives a command.

        Returns:
            ``cusum`` and ``another`` after the step, and the factors (G, n) by which the probability of each
            pair changes with the prior where a change of the driver was noticed; 1 elsewhere.
        """
        ratio = np.where(another > 0.0, self._ratios[1], self._ratios[0])
        score = np.where(gives, self._share * np.log((noise * ratio).sum(axis=0)), 0.0)
        cusum = np.maximum(cusum + score, 0.0)
        noticed = cusum >= self._limit
        another = np.where(noticed, 1.0 - another, another)
        return np.where(noticed, 0.0, cusum), another, np.where(noticed, ratio, 1.0)
