"""Where an obstacle on a given path will be while a robot drives and brakes.

Points of the plane are complex numbers here, x + iy in [m], world frame; times are in [s] from now.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from drake_shared.arbitration.safety.stopping import StoppingPaths

# Of a moving obstacle: times in [s] from the start of a trial and places, complex, in [m].
Way = tuple[np.ndarray, np.ndarray]


class Drift:
    """Where a moving obstacle will be, from where it is now.

    Args:
        times: Of the points of its path, in [s] from now; it is at rest before and after.
        places: These points, complex, in [m]; straight and even between them.
        period: For how long the plant may take the obstacle to stand, in [s].
        horizon: How far to look ahead, in [s].

    Attributes:
        horizon: As given.
        farthest: How far away from here it comes by then, in [m].
    """

    def __init__(self, times: np.ndarray, places: np.ndarray, *, period: float, horizon: float) -> None:
        self._times, self._places = times, places
        self._here = np.interp(0.0, times, places)
        self._turns = [turn for turn in times.tolist() if 0.0 < turn < horizon]
        self._period = period
        self.horizon = horizon
        self._until = math.inf
        self._last: tuple[StoppingPaths, np.ndarray] | None = None
        self.farthest = float(np.abs(self.at([*self._turns, horizon])).max())

    def around(self, paths: StoppingPaths) -> np.ndarray:
        """The displacements that count at the points of ``paths``: shape (q, m, k + 1), complex, in [m].

        Along any direction the obstacle is, on a piece, no farther than straight between the farthest of
        these at its ends: where the obstacle is then, where it was a period ago, and where it turns while the
        robot is on a piece that meets there. A robot that has come to rest stays until the horizon.
        """
        if self._last is None or self._last[0] is not paths:
            until = paths.times()
            late = np.maximum(until - self._period, 0.0)
            until[:, -1] = self.horizon
            counted = [late, until]
            for turn in self._turns:
                begin, end = late.copy(), until.copy()
                begin[:, 1:], end[:, :-1] = late[:, :-1], until[:, 1:]
                counted.append(np.where((begin <= turn) & (turn <= end), turn, until))
            self._last = paths, self.at(counted)
        return self._last[1]

    def stop(self, time: float) -> None:
        """Lets the obstacle count as standing from that time on, to which it comes evenly on a piece."""
        self._until, self._last = time, None

    def at(self, times: ArrayLike) -> np.ndarray:
        """The displacement at each of ``times``, complex, in [m]."""
        return np.interp(np.minimum(times, self._until), self._times, self._places) - self._here
