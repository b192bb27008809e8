"""The variance that distance from all demonstrations adds (out of distribution)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.arrays import as_point, as_points, lengths


class OodVariance:
    """Adds variance to predictions from observations that are far from every demonstration.

    A network trained on demonstrations is as confident half a metre beside them as on them. So an observation
    at a distance d > ``reach`` from all demonstrations, where they are at its time, adds

        gain (d - reach)^2

    to every variance: nothing on the data, and unbounded away from it. Several observations add the mean.

    Args:
        grid: Shape (N,), evenly spaced from 0, in [s].
        demonstrations: Shape (m, N, D), in [m].
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
        # Time first: the demonstrations' positions at one time, and their steps from there, are contiguous.
        self._points = as_points(demonstrations.swapaxes(0, 1))
        self._steps = np.diff(self._points, axis=0)
        self._reach = reach
        self._gain = gain
        # A clock of progress shows times of the grid alone.
        self._on_grid = {time: self._points_at(time) for time in grid.tolist()}

    def __call__(self, times: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
        """The variance to add, in [m^2], for n >= 1 observations: ``times`` (n,) and ``positions`` (n, D)."""
        return self.prefixes(times, positions)[-1]

    def prefixes(self, times: NDArray[np.float64], positions: NDArray[np.float64]) -> list[float]:
        """The variance to add, in [m^2], after the first observation, the first two, and so on to all n."""
        if self._gain == 0.0:
            return [0.0] * len(times)
        total = 0.0
        added: list[float] = []
        for time, position in zip(times.tolist(), positions.tolist(), strict=True):
            total += max(self._distance(time, position) - self._reach, 0.0) ** 2
            added.append(self._gain * total / (len(added) + 1))
        return added

    def table(self, times: NDArray[np.float64]) -> OodVarianceTable:
        """The same variance for many observations at once, whose times are among ``times`` (P,)."""
        steps = np.minimum(np.maximum(times * self._rate, 0.0), self._last + 1.0)
        index = np.minimum(steps.astype(int), self._last)
        share = (steps - index).reshape(-1, *[1] * (self._points.ndim - 1))
        return OodVarianceTable(
            share * self._steps[index] + self._points[index], reach=self._reach, gain=self._gain
        )

    def _distance(self, time: float, position: list[float]) -> float:
        """Distance of a position from the nearest demonstration at ``time``, in [m]."""
        points = self._on_grid.get(time)
        if points is None:
            if math.isnan(time):
                return math.nan
            points = self._points_at(time)
        # Demonstrations are few: a list of them has its minimum sooner than an array.
        distances: list[float] = lengths(points - as_point(position)).tolist()
        return min(distances)

    def _points_at(self, time: float) -> NDArray[Any]:
        """Where the demonstrations are at ``time``: shape (m,), of `as_points`."""
        step = min(max(time * self._rate, 0.0), self._last + 1.0)
        index = min(int(step), self._last)
        points: NDArray[Any] = (step - index) * self._steps[index] + self._points[index]
        return points


class OodVarianceTable:
    """`OodVariance` for many observations at once; made by `OodVariance.table`.

    Args:
        points: Shape (P, m), of `as_points`: where the demonstrations are at each time.
        reach, gain: See `OodVariance`.
    """

    def __init__(self, points: NDArray[np.complex128], *, reach: float, gain: float) -> None:
        self._points = points
        self._reach = reach
        self._gain = gain

    def __call__(self, index: NDArray[np.int64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """The variance to add, in [m^2], after the first observation of each row, the first two, and so on.

        Args:
            index: Shape (n, c), of the times.
            positions: Shape (n, c, 2), in [m].

        Returns:
            Shape (n, c).
        """
        offsets = self._points[index] - as_points(positions)[..., None]
        beyond = np.maximum(lengths(offsets).min(axis=-1) - self._reach, 0.0)
        added: NDArray[np.float64] = self._gain * np.cumsum(beyond**2, axis=-1)
        added /= np.arange(1, index.shape[-1] + 1)
        return added
