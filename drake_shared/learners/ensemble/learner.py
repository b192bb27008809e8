"""An ensemble of CNMPs as a predictor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from drake_shared.learners.base import Array, Prediction
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.fields import Parts
from drake_shared.learners.stored import StoredLearner


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class EnsembleLearner(StoredLearner):
    """Several CNMPs, trained alike from different seeds (Lakshminarayanan et al. 2017). A `Learner`.

    The mean is the mean of theirs; the variance is the mean of theirs plus the variance of their means, which
    is large where demonstrations leave the prediction open.

    Attributes:
        members: At least one, on one grid.
    """

    name: ClassVar[str] = "ensemble"
    members: Annotated[tuple[CnmpLearner, ...], Parts(CnmpLearner)]

    @property
    def grid(self) -> Array:
        """Shape (N,), in [s]."""
        return self.members[0].grid

    @property
    def duration(self) -> float:
        """T, in [s]."""
        return self.members[0].duration

    @property
    def demonstrations(self) -> Array:
        """Shape (m, N, D), in [m]."""
        return self.members[0].demonstrations

    def predict(self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike) -> Prediction:
        """Mean (Q, D) in [m] and variance (Q, D) in [m^2] at ``query_times`` (Q,); see `Learner.predict`."""
        predictions = [member.predict(times, positions, query_times) for member in self.members]
        means = np.stack([mean for mean, _ in predictions])
        within = np.mean([variance for _, variance in predictions], axis=0)
        return means.mean(axis=0), within + means.var(axis=0)

    def scaled(self, factor: float, *, confidence_gain: float | None = None) -> EnsembleLearner:
        """A copy with the standard deviations of each member times ``factor``, and K of its own if given."""
        return replace(
            self,
            members=tuple(member.scaled(factor) for member in self.members),
            confidence_gain=self.confidence_gain if confidence_gain is None else confidence_gain,
        )
