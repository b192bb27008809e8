"""Predictions of a mixture for many sets of observations at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drake_shared.learners.base import Array
from drake_shared.learners.cnmp.rows import CnmpRows, Index
from drake_shared.learners.mixture.learner import NEGLIGIBLE, MixtureLearner


class MixtureRows:
    """Evaluates a mixture for rows of one or two observations each; see `CnmpRows` for the arguments."""

    def __init__(self, learner: MixtureLearner, times: Array) -> None:
        self._learner = learner
        self._experts = [CnmpRows(expert, times) for expert in learner.experts]
        rate = (len(learner.grid) - 1) / learner.duration
        steps = np.rint(np.minimum(np.maximum(times, 0.0), learner.duration) * rate).astype(int)
        self._centers, self._widths = (np.stack(part, axis=1)[steps] for part in learner._routes)

    def predict(self, index: Index, positions: Array, first: Index) -> tuple[Array, Array, Array]:
        """Mean, variance and the mean of the mode to assist; see `CnmpRows.predict`."""
        probability = self._probability(index, positions)
        weights = probability * self._learner.leanings
        used = probability >= NEGLIGIBLE
        shape = (*index.shape, positions.shape[-1], len(self._learner.grid) - int(first[0]))
        means, variances = np.zeros((len(self._experts), *shape)), np.zeros((len(self._experts), *shape))
        for number, expert in enumerate(self._experts):
            rows = np.flatnonzero(used[..., number].any(axis=1))
            if len(rows):
                mean, variance, _ = expert.predict(index[rows], positions[rows], first[rows])
                later = slice(shape[-1] - mean.shape[-1], None)
                means[number, rows, ..., later], variances[number, rows, ..., later] = mean, variance
        mean = _average(means, np.where(used, weights, 0.0))
        within = variances + np.square(means - mean)
        aim = weights.argmax(axis=-1)
        aimed = np.take_along_axis(means, aim[None, :, :, None, None], axis=0)[0]
        return mean, _average(within, np.where(used, probability, 0.0)), aimed

    def _probability(self, index: Index, positions: Array) -> Array:
        """The probability (n, c, C) of each route after the first observation, and after both."""
        widths = self._widths[index]
        apart = np.square(positions[..., None] - self._centers[index]) / widths + np.log(widths)
        logs = np.log(self._learner.shares) - 0.5 * np.cumsum(apart[..., 0, :] + apart[..., 1, :], axis=1)
        odds: Array = np.exp(logs - logs.max(axis=-1, keepdims=True))
        odds /= odds.sum(axis=-1, keepdims=True)
        return odds


def _average(values: NDArray[np.float64], weights: Array) -> Array:
    """The average of values (C, n, c, 2, Q), weighted by (n, c, C)."""
    total = np.zeros(values.shape[1:])
    for number, value in enumerate(values):
        total += weights[..., number, None, None] * value
    total /= weights.sum(axis=-1)[..., None, None]
    return total
