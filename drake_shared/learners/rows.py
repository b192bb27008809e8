"""Predictions for many sets of observations at once, by those learners that can."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drake_shared.learners.base import Array, Learner
from drake_shared.learners.cesn.learner import CesnLearner
from drake_shared.learners.cesn.rows import CesnRows
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.rows import CnmpRows
from drake_shared.learners.ensemble.learner import EnsembleLearner
from drake_shared.learners.ensemble.rows import EnsembleRows
from drake_shared.learners.mixture.learner import MixtureLearner
from drake_shared.learners.mixture.rows import MixtureRows


class RowPredictor(Protocol):
    """Predicts for rows of one or two observations each."""

    def predict(
        self, index: NDArray[np.int64], positions: Array, first: NDArray[np.int64]
    ) -> tuple[Array, Array, Array]:
        """See `drake_shared.learners.cnmp.rows.CnmpRows.predict`."""
        ...


_ROWS: Mapping[type, Callable[[Any, Array], RowPredictor]] = {
    CnmpLearner: CnmpRows,
    MixtureLearner: MixtureRows,
    EnsembleLearner: EnsembleRows,
    CesnLearner: CesnRows,
}


def predicts_rows(learner: Learner) -> bool:
    """Whether `make_rows` has a predictor for ``learner``."""
    taught = learner.demonstrations
    return type(learner) in _ROWS and taught is not None and taught.shape[-1] == 2


def make_rows(learner: Learner, times: Array) -> RowPredictor:
    """The predictor of a learner for which `predicts_rows` is true.

    Args:
        learner: Of positions of size 2.
        times: Shape (P,), the times that observations may have, in [s].
    """
    return _ROWS[type(learner)](learner, times)
