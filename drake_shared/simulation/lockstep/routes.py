"""The curves of routes for many trials, one for each."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drake_shared.scenario.paths import Path

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class RouteTable:
    """The points of several curves in one array.

    Args:
        paths: The curves.
        search: Longest interval of arc lengths in which `TrialRoutes.nearest` searches, in [m].
    """

    def __init__(self, paths: Sequence[Path], *, search: float) -> None:
        sizes = [len(path.frames) for path in paths]
        self.lengths = np.array([path.length for path in paths])
        self.spacings = np.array([path.spacing for path in paths])
        self.first = np.cumsum([0, *sizes[:-1]])
        self.last = np.array(sizes) - 1
        self.frames = np.ascontiguousarray(np.concatenate([np.array(path.frames) for path in paths]).T)
        self.width = math.ceil(search / min(self.spacings)) + 2
        # Every window of the search as a view; the last point is repeated beyond the end.
        self.windows = [
            np.lib.stride_tricks.sliding_window_view(np.pad(axis, (0, self.width), mode="edge"), self.width)
            for axis in self.frames[:2]
        ]


class TrialRoutes:
    """The curve of each of n trials; it takes and returns arrays (n,) where `Path` has numbers.

    Args:
        table: Of the curves.
        which: Shape (n,), index of each trial's curve.
    """

    def __init__(self, table: RouteTable, which: Integers) -> None:
        self.length = table.lengths[which]
        self._table = table
        self._spacing = table.spacings[which]
        self._first = table.first[which]
        self._last = table.last[which]

    def frame(self, arc_length: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """See `Path.frame`."""
        x, y, direction, curvature = self._table.frames[:, self._first + self._index(arc_length)]
        return x, y, direction, curvature

    def nearest(self, x: Floats, y: Floats, *, between: tuple[Floats, Floats]) -> Floats:
        """See `Path.nearest`."""
        table = self._table
        begin, end = self._index(between[0]), self._index(between[1])
        to_x, to_y = (window[self._first + begin] for window in table.windows)
        square = np.square(to_x - x[:, None]) + np.square(to_y - y[:, None])
        square[np.arange(table.width) > (end - begin)[:, None]] = math.inf
        nearest: Floats = (begin + square.argmin(axis=1)) * self._spacing
        return nearest

    def _index(self, arc_length: Floats) -> Integers:
        index = np.rint(arc_length / self._spacing)
        held: Integers = np.minimum(np.maximum(index, 0.0), self._last).astype(np.int64)
        return held
