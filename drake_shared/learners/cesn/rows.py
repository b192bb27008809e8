"""Predictions of an echo state network for many sets of observations at once."""

from __future__ import annotations

import itertools
import math

import numpy as np

from drake_shared.learners.base import Array
from drake_shared.learners.cesn.context import at_times, encode, features, within
from drake_shared.learners.cesn.learner import CesnLearner
from drake_shared.learners.cnmp.rows import Index


class CesnRows:
    """Evaluates an echo state network for rows of one or two observations each.

    Products have the shapes of the learner's own; see `CnmpRows` for the reason and the arguments.
    """

    def __init__(self, learner: CesnLearner, times: Array) -> None:
        self._learner = learner
        clipped = np.minimum(np.maximum(times, 0.0), learner.duration)
        self._reference = at_times(learner.reference, clipped, learner.duration)
        self._modes = at_times(learner.modes, clipped, learner.duration)
        self._ood_variance = learner._ood_variance.table(clipped)

    def predict(self, index: Index, positions: Array, first: Index) -> tuple[Array, Array, Array]:
        """See `CnmpRows.predict`."""
        learner, size, start = self._learner, positions.shape[-1], int(first[0])
        hidden_weights, hidden_bias, readout, states, log_variance = learner._prepared
        offsets = within((positions - self._reference[index]) / learner.scale, learner.reach)
        modes = self._modes[index]
        codes = [
            encode(modes[:, :count], offsets[:, :count], learner.noise).astype(np.float32)
            for count in range(1, index.shape[1] + 1)
        ]
        # One row at a time in each product.
        code = np.stack(codes, axis=1)[:, :, None]
        rows = features(code, hidden_weights, hidden_bias) @ readout
        rows = rows.reshape(*index.shape, 2 * size, -1)
        raw = np.zeros((*index.shape, 2 * size, states.shape[1] - start), np.float32)
        edges = [0, *(np.flatnonzero(np.diff(first)) + 1).tolist(), len(first)]
        for begin, end in itertools.pairwise(edges):
            own = int(first[begin])
            raw[begin:end, ..., own - start :] = rows[begin:end] @ states[:, own:]
        mean: Array = raw[:, :, :size] * learner.scale + learner.reference.T[:, start:]
        logs = raw[:, :, size:] + log_variance[:, start:]
        logs = np.clip(logs, 2.0 * math.log(learner.sigma_floor), 2.0 * math.log(learner.reach))
        variance: Array = np.exp(logs + 2.0 * math.log(learner.scale * learner.sigma_scale))
        variance += self._ood_variance(index, positions)[..., None, None]
        return mean, variance, mean
