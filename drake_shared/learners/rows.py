"""Predictions for many sets of observations at once, by those learners that can."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drake_shared.learners.base import Array, Learner
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.rows import CnmpRows


class RowPredictor(Protocol):
    """Predicts for rows of one or two observations each."""

    def predict(
        self, index: NDArray[np.int64], positions: Array, first: NDArray[np.int64]
    ) -> tuple[Array, Array]:
        """See `drake_shared.learners.cnmp.rows.CnmpRows.predict`."""
        ...


def predicts_rows(learner: Learner) -> bool:
    """Whether `make_rows` has a predictor for ``learner``."""
    return type(learner) is CnmpLearner and learner.position_size == 2


def make_rows(learner: Learner, times: Array) -> RowPredictor:
    """The predictor of a learner for which `predicts_rows`.

    Args:
        learner: Of positions of size 2.
        times: Shape (P,), the times that observations may have, in [s].
    """
    assert isinstance(learner, CnmpLearner)
    return CnmpRows(learner, times)
