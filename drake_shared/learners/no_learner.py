"""The learner of a human who drives alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


class NoLearner:
    """Predicts NaN with infinite variance, so that c_f is 0 and the human drives. A `Learner`.

    Args:
        duration: T, in [s].
    """

    name = "none"
    preset = "none"
    confidence_gain = 1.0
    demonstrations = None
    metadata: Mapping[str, Any] = {"clock": "time"}

    def __init__(self, duration: float) -> None:
        self.duration = duration
        self.grid = np.array([0.0, duration])

    def predict(
        self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean NaN and variance infinite, both of shape (Q, D)."""
        shape = (np.size(query_times), np.shape(positions)[-1])
        return np.full(shape, np.nan), np.full(shape, np.inf)
