"""How far along the demonstrations a robot is: a clock that waits for a driver who dawdles."""

from __future__ import annotations

import numpy as np


class ProgressClock:
    """The time of the nearest demonstrated point, searched forward from the one reached before.

    Args:
        times: Shape (N,), of the grid, in [s], increasing.
        demonstrations: Shape (m, N, 2), positions on that grid, in [m].
        horizon: How far ahead the search goes at once, in [s].
        tolerance: Among points that are nearly as near as the nearest, in [m], the latest counts: where
            demonstrations linger (at their start, say) the clock does not wait for the last millimetre.
    """

    def __init__(
        self,
        times: np.ndarray,
        demonstrations: np.ndarray,
        *,
        horizon: float = 1.0,
        tolerance: float = 0.03,
    ) -> None:
        self._times = np.asarray(times, dtype=float)
        # As complex numbers, which numpy subtracts and measures in one go each; time first, so that a window
        # of the search is one block of memory.
        self._paths = np.ascontiguousarray((demonstrations[:, :, 0] + 1j * demonstrations[:, :, 1]).T)
        self._horizon = horizon
        self._tolerance = tolerance

    def advance(self, reached: float, x: float, y: float) -> float:
        """The time now, in [s], of a robot at (``x``, ``y``) in [m] that had reached the time ``reached``."""
        first = int(self._times.searchsorted(reached))
        last = max(int(self._times.searchsorted(reached + self._horizon, side="right")), first + 1)
        distances = np.abs(self._paths[first:last] - complex(x, y)).min(axis=1).tolist()
        near = min(distances) + self._tolerance
        close = [index for index, distance in enumerate(distances) if distance <= near]
        if not close:  # The position is no number.
            return reached
        return max(reached, float(self._times[first + int(close[-1])]))
