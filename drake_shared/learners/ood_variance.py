"""What a network cannot know of places it was never shown: distance from all demonstrations is doubt."""

from __future__ import annotations

import math

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
        # As complex numbers, which numpy subtracts and measures in one go each; time first: the
        # demonstrations' positions at one time, and how they go on from there, lie together.
        self._paths = np.ascontiguousarray((demonstrations[:, :, 0] + 1j * demonstrations[:, :, 1]).T)
        self._ways_on = np.diff(self._paths, axis=0)
        self._reach = reach
        self._gain = gain

    def __call__(self, times: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
        """The variance to add, in [m^2], for observations at ``times`` (n,) and ``positions`` (n, 2)."""
        return self.prefixes(times, positions)[-1] if len(times) else 0.0

    def prefixes(self, times: NDArray[np.float64], positions: NDArray[np.float64]) -> list[float]:
        """The variance to add, in [m^2], after the first observation, the first two, and so on to all n."""
        if self._gain == 0.0:
            return [0.0] * len(times)
        total = 0.0
        doubts: list[float] = []
        for time, (x, y) in zip(times.tolist(), positions.tolist(), strict=True):
            total += max(self._distance(time, x, y) - self._reach, 0.0) ** 2
            doubts.append(self._gain * total / (len(doubts) + 1))
        return doubts

    def _distance(self, time: float, x: float, y: float) -> float:
        """How far the nearest demonstration is from (x, y) at ``time``, in [m]."""
        step = min(max(time * self._rate, 0.0), self._last + 1.0)
        if step != step:
            return math.nan
        index = min(int(step), self._last)
        offsets = (step - index) * self._ways_on[index]
        offsets += self._paths[index]
        offsets -= complex(x, y)
        # Demonstrations are few: a list of them has its least sooner than an array.
        return min(np.abs(offsets).tolist())
