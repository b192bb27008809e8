"""Adaptive conformal intervals: standard deviations of any learner, scaled online to the errors that occur.

Source: Gibbs and Candes, "Adaptive conformal inference under distribution shift", NeurIPS 2021; used for
assistive teleoperation by arXiv 2406.07767.
"""

from __future__ import annotations

import dataclasses
import math
from bisect import insort

import numpy as np
from scipy.special import ndtri

from drake_shared.common.errors import InputError
from drake_shared.learners.base import Array, Learner, Prediction

_ROUNDING = 1e-9


@dataclasses.dataclass(kw_only=True)
class AdaptiveConformal:
    """A factor on intervals, such that they cover a share of what comes, whatever its distribution.

    The score of an error is the factor by which its interval would just have covered it. The factor is the
    (1 - alpha) quantile of the newest scores, and alpha follows the errors:
    alpha += rate (1 - coverage - miss). In the long run the share of misses is then 1 - coverage, up to
    (1 + rate) / (rate n) after n scores, without any assumption. With alpha at most 0 everything is covered,
    with alpha at least 1 nothing.

    Attributes:
        coverage: Share to cover, from 0 to 1.
        rate: Of the adaptation, positive.
        memory: Number of scores that are kept.
    """

    coverage: float = 0.9
    rate: float = 0.02
    memory: int = 500

    def __post_init__(self) -> None:
        if not 0.0 < self.coverage < 1.0:
            raise InputError("conformal", "coverage", "must be from 0 to 1", self.coverage)
        if not (0.0 < self.rate < math.inf):
            raise InputError("conformal", "rate", "must be positive and finite", self.rate)
        if self.memory < 1:
            raise InputError("conformal", "memory", "must be at least 1", self.memory)
        self._alpha = 1.0 - self.coverage
        self._newest: list[float] = []
        self._sorted: list[float] = []

    @property
    def alpha(self) -> float:
        """The share of misses that the factor aims at now."""
        return self._alpha

    @property
    def factor(self) -> float:
        """On the half-width of the next interval; 1 before the first score, infinite to cover everything."""
        count = len(self._sorted)
        if not count:
            return 1.0
        if self._alpha >= 1.0:
            return 0.0
        # The correction for finite samples: the scores are count + 1 with the one to come.
        rank = math.ceil((1.0 - self._alpha) * (count + 1) - _ROUNDING)
        return math.inf if rank > count else self._sorted[max(rank, 1) - 1]

    @property
    def largest(self) -> float:
        """The largest score that is kept; 1 before the first one."""
        return self._sorted[-1] if self._sorted else 1.0

    def observe(self, score: float, factor: float | None = None) -> bool:
        """Adds a score, and returns whether the interval covered it.

        Args:
            score: Of an error.
            factor: On the interval that was stated; if None, the one of now. A forecast is scored once its
                time has come, and other scores come between.
        """
        covered = score <= (self.factor if factor is None else factor)
        self._alpha += self.rate * ((1.0 - self.coverage) - (not covered))
        self._newest.append(score)
        insort(self._sorted, score)
        if len(self._newest) > self.memory:
            self._sorted.remove(self._newest.pop(0))
        return covered


def score_of(error: Array, variance: Array, coverage: float) -> float:
    """The factor on the central intervals by which those of all coordinates cover an error.

    Args:
        error: Shape (D,), in [m].
        variance: Shape (D,), predicted, in [m^2].
        coverage: Of the interval of one coordinate, from 0 to 1.
    """
    half_width = ndtri(0.5 + 0.5 * coverage) * np.sqrt(variance)
    return float((np.abs(error) / half_width).max())


class ConformalLearner:
    """Another learner with its variances scaled by adaptive conformal intervals. A `Learner`.

    It has a state: one serves one trial. `observe` tells it where the robot is, and scores what was predicted
    for that time.

    Args:
        learner: Any learner.
        ahead: Time between a prediction and its score, in [s].
        conformal: Coverage, rate and memory; it may have seen scores before.
    """

    def __init__(
        self, learner: Learner, *, ahead: float = 1.0, conformal: AdaptiveConformal | None = None
    ) -> None:
        if not (0.0 < ahead < math.inf):
            raise InputError("conformal", "ahead", "must be positive and finite", ahead)
        self._learner = learner
        self._ahead = ahead
        self.conformal = conformal or AdaptiveConformal()
        self._pending: list[tuple[float, Array, Array, float]] = []
        self.name, self.preset = learner.name, learner.preset
        self.confidence_gain, self.metadata = learner.confidence_gain, learner.metadata
        self.grid, self.duration = learner.grid, learner.duration
        self.demonstrations = learner.demonstrations

    def predict(self, times: Array, positions: Array, query_times: Array) -> Prediction:
        """See `Learner.predict`; an infinite factor counts as the largest score that is known."""
        mean, variance = self._learner.predict(times, positions, query_times)
        return mean, variance * self._scale() ** 2

    def observe(self, time: float, position: Array) -> bool | None:
        """Tells where the robot is, and predicts where it will be ``ahead`` later.

        Args:
            time: In [s], increasing.
            position: Shape (D,), in [m].

        Returns:
            Whether the interval that was predicted for this time covered the position; None if there is none.
        """
        covered = None
        while self._pending and self._pending[0][0] <= time + 1e-9:
            _, mean, variance, factor = self._pending.pop(0)
            score = score_of(np.asarray(position) - mean, variance, self.conformal.coverage)
            covered = self.conformal.observe(score, factor)
        at = time + self._ahead
        if at <= self.duration:
            mean, variance = self._learner.predict(
                np.array([time]), np.asarray(position)[None], np.array([at])
            )
            self._pending.append((at, mean[0], variance[0], self.conformal.factor))
        return covered

    def _scale(self) -> float:
        factor = self.conformal.factor
        return max(factor if math.isfinite(factor) else self.conformal.largest, 1e-3)
