"""How far along the demonstrations a robot is: a clock that waits for a driver who dawdles."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

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
        # One time is looked up faster in a list than in an array.
        self._times: list[float] = np.asarray(times, dtype=float).tolist()
        # As complex numbers, which numpy subtracts and measures in one go each; time first, so that a window
        # of the search is one block of memory.
        self._paths = np.ascontiguousarray((demonstrations[:, :, 0] + 1j * demonstrations[:, :, 1]).T)
        self._horizon = horizon
        self._tolerance = tolerance

    def advance(self, reached: float, x: float, y: float) -> float:
        """The time now, in [s], of a robot at (``x``, ``y``) in [m] that had reached the time ``reached``."""
        first = bisect_left(self._times, reached)
        last = max(bisect_right(self._times, reached + self._horizon), first + 1)
        distances = np.abs(self._paths[first:last] - complex(x, y)).min(axis=1).tolist()
        near = min(distances) + self._tolerance
        for index in reversed(range(len(distances))):
            if distances[index] <= near:
                return max(reached, self._times[first + index])
        return reached  # The position is no number.
