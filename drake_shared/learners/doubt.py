"""What a network cannot know of places it was never shown: distance from all demonstrations is doubt."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class Doubt:
    """The variance that being away from every demonstration adds.

    A network trained on demonstrations is as sure half a metre beside them as on them. So an observation that
    is further than ``reach`` from all demonstrations, where they are at its time, adds

        gain (d - reach)^2

    to every variance: nothing on the data, and without bound away from it. Several observations add the mean.

    Args:
        grid: Shape (N,), evenly spaced from 0, in [s].
        demonstrations: Shape (m, N, 2), in [m].
        reach: In [m], positive.
        gain: In [m^2] per [m^2]; 0 or more.
    """

    def __init__(
        self,
        *,
        grid: NDArray[np.float64],
        demonstrations: NDArray[np.float64],
        reach: float,
        gain: float,
    ) -> None:
        self._rate = (len(grid) - 1) / float(grid[-1])
        self._last = len(grid) - 2
        # Time first: the demonstrations' positions at one time lie together.
        self._paths = np.ascontiguousarray(demonstrations.transpose(1, 2, 0))
        self._reach = reach
        self._gain = gain

    def __call__(self, times: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
        """The variance to add, in [m^2], for observations at ``times`` (n,) and ``positions`` (n, 2)."""
        if self._gain == 0.0:
            return 0.0
        total = 0.0
        for time, position in zip(times.tolist(), positions.tolist(), strict=True):
            step = min(max(time * self._rate, 0.0), self._last + 1.0)
            if step != step:
                return float("nan")
            index = min(int(step), self._last)
            before, after = self._paths[index], self._paths[index + 1]
            offset = before + (step - index) * (after - before)
            offset[0] -= position[0]
            offset[1] -= position[1]
            offset *= offset
            distance = float(np.sqrt((offset[0] + offset[1]).min()))
            total += max(distance - self._reach, 0.0) ** 2
        return self._gain * total / max(len(times), 1)
