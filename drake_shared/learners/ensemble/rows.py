"""Predictions of an ensemble for many sets of observations at once."""

from __future__ import annotations

import numpy as np

from drake_shared.learners.base import Array
from drake_shared.learners.cnmp.rows import CnmpRows, Index
from drake_shared.learners.ensemble.learner import EnsembleLearner


class EnsembleRows:
    """Evaluates an ensemble for rows of one or two observations each; see `CnmpRows` for the arguments."""

    def __init__(self, learner: EnsembleLearner, times: Array) -> None:
        self._members = [CnmpRows(member, times) for member in learner.members]

    def predict(self, index: Index, positions: Array, first: Index) -> tuple[Array, Array, Array]:
        """See `CnmpRows.predict`."""
        predictions = [member.predict(index, positions, first)[:2] for member in self._members]
        means = np.stack([mean for mean, _ in predictions])
        within = np.mean([variance for _, variance in predictions], axis=0)
        mean: Array = means.mean(axis=0)
        return mean, within + means.var(axis=0), mean
