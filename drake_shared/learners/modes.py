"""The modes of a predicted mixture."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Modes:
    """The modes of a predicted mixture: one for each route that is still possible.

    Attributes:
        probability: Shape (C,), summing to 1; scores play no part in it.
        mean: Shape (C, Q, D), in [m]; NaN for modes of negligible probability.
        variance: Shape (C, Q, D), in [m^2].
        aim: Index of the mode to assist: the most probable one, weighted by the scores.
    """

    probability: NDArray[np.float64]
    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    aim: int
