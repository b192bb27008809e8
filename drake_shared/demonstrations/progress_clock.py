"""The time of the nearest demonstrated point: a clock that follows the robot's progress."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.arrays import as_point, as_points, lengths

TOLERANCE = 0.03
"""Demonstrated points whose distances differ by less are equally near, in [m] for the Pioneer P3-DX."""


class ProgressClock:
    """Measures progress along demonstrations as the time of their nearest point. It never runs back.

    Args:
        times: Shape (N,), of the grid, in [s], increasing.
        demonstrations: Shape (m, N, D), positions on that grid, in [m].
        horizon: How far from the time reached the search extends, in [s], forward and back.
        tolerance: Of points whose distance is within this of the least, in [m], the latest counts: where
            demonstrations linger (at their start, for example) the clock does not wait for the last
            millimetre.
    """

    def __init__(
        self,
        times: ArrayLike,
        demonstrations: NDArray[np.float64],
        *,
        horizon: float = 1.0,
        tolerance: float = TOLERANCE,
    ) -> None:
        # One time is looked up faster in a list than in an array.
        self._times: list[float] = np.asarray(times, dtype=float).tolist()
        # Time first, so that a window of the search is one block of memory.
        self.points = as_points(demonstrations.swapaxes(0, 1))
        """Shape (N, m): the demonstrations, of `as_points`."""
        self._horizon = horizon
        self.tolerance = tolerance
        """As given, in [m]."""
        # The time reached is one of the grid, but at the start of a trial it may be any.
        self._windows = {time: self.window(time) for time in self._times}

    def window(self, reached: float) -> tuple[int, int]:
        """The points searched from the time ``reached``, in [s]: first index, and last one plus 1."""
        first = bisect_left(self._times, reached - self._horizon)
        return first, max(bisect_right(self._times, reached + self._horizon), first + 1)

    def advance(self, reached: float, *position: float) -> float:
        """The time now, in [s].

        Args:
            reached: The time that the robot had reached before, in [s].
            position: D coordinates of the robot, in [m]. If one is NaN, the time stays as it was.
        """
        # Points behind count too: otherwise a clock ahead of the robot takes the point it has reached for the
        # nearest, gains the tolerance at every step, and runs away from slow demonstrations.
        first, last = self._windows.get(reached) or self.window(reached)
        offsets = self.points[first:last] - as_point(position)
        # The method min would call it from Python.
        distances = np.minimum.reduce(lengths(offsets), axis=1).tolist()
        limit = min(distances) + self.tolerance
        for index in reversed(range(len(distances))):
            if distances[index] <= limit:
                return max(reached, self._times[first + index])
        return reached
