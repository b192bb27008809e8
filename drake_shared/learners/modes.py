"""The ways that are still possible, kept apart."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Modes:
    """The ways that are still possible.

    Attributes:
        probability: Shape (C,), summing to 1; scores play no part in it.
        mean: Shape (C, Q, 2), in [m]; NaN for ways that are out of the question.
        variance: Shape (C, Q, 2), in [m^2].
        aim: Index of the way to help with: the likeliest, and among equals the better one.
    """

    probability: NDArray[np.float64]
    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    aim: int

    def by_probability(self) -> list[tuple[float, NDArray[np.float64]]]:
        """Probability and mean (Q, 2), in [m], of each way, the likeliest first."""
        order = np.argsort(-self.probability)
        return [(float(self.probability[index]), self.mean[index]) for index in order]
