"""Gaps between a robot's body and the obstacles along the ways that it may take, bounded from below.

Points of the plane are complex numbers here, x + iy in [m], world frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from pydrake.geometry import GeometryId, SignedDistanceToPoint

from drake_shared.arbitration.safety.drift import Drift
from drake_shared.arbitration.safety.stopping import PIECES, StoppingPaths
from drake_shared.robots.motion import Pose

# Signed distances to the obstacles near (x, y), up to a distance.
Nearby = Callable[[float, float, float], list[SignedDistanceToPoint]]

# By how much a clearance that is kept may be missed, in [m]: rounding is no danger.
TOLERANCE = 1e-6
# How often the obstacles are looked at from along a path.
_LOOKS = 8


class _Plane(NamedTuple):
    """A half-plane that holds obstacle ``which`` and moves with it."""

    which: int
    normal: np.ndarray
    offset: float
    drift: Drift | None

    def gaps(self, paths: StoppingPaths) -> np.ndarray:
        """At the points of ``paths`` and how they change on the pieces: (m, 3 k + 1), in [m]."""
        projected = paths.along @ self.normal
        projected[:, : PIECES + 1] += self.offset
        if self.drift is not None:
            projected -= _advance(paths, self.normal, self.drift)
        return projected

    def lift(self, projected: np.ndarray, paths: StoppingPaths) -> None:
        """Counts where it is the higher bound."""
        other = self.gaps(paths)
        known = projected[..., self.which]
        higher = other[:, : PIECES + 1] > known[:, : PIECES + 1]
        np.copyto(known, other, where=np.concatenate([higher, higher[:, :-1], higher[:, 1:]], axis=1))


class Gaps:
    """Lower bounds of the gaps between the body and the obstacles along paths.

    A convex obstacle is no nearer than the half-plane that touches it where it is nearest to some point, so
    each look from a point bounds the gap at all others, and the highest bound counts. The half-planes of an
    obstacle that moves go with it.

    Args:
        nearby: Finds convex obstacles where they are now.
        body: Radius of the body, in [m].
        start: x, y in [m] and yaw in [rad] now.
        reach: How near to the start, from body to obstacle, a gap must be to count, in [m].
        drifts: Of the obstacles that move.

    Attributes:
        count: Of the obstacles within reach, n.
    """

    def __init__(
        self,
        nearby: Nearby,
        body: float,
        start: Pose,
        reach: float,
        drifts: Mapping[GeometryId, Drift],
    ) -> None:
        self._nearby = nearby
        self._body = body
        self._reach = reach
        self._found = nearby(start[0], start[1], reach + body)
        self.count = len(self._found)
        if self.count:
            normals = np.array([item.grad_W for item in self._found])[:, :2]
            distances = np.array([item.distance for item in self._found])
            self._normals = normals.T
            self._offsets = distances - body - normals @ start[:2]
            self._more: list[_Plane] = []
        names = [item.id_G for item in self._found] if drifts else []
        self._drifts = {index: drifts[name] for index, name in enumerate(names) if name in drifts}

    def at_start(self) -> float:
        """The least gap to what stands, where the robot is, in [m]; infinite if nothing does."""
        standing = (item.distance for index, item in enumerate(self._found) if index not in self._drifts)
        return min(standing, default=math.inf) - self._body

    def least(self, paths: StoppingPaths) -> np.ndarray:
        """Lower bounds of the gaps along each of ``paths``, as far as is known: shape (m, n), in [m]."""
        return _bounds(self._projected(paths)).min(axis=1)

    def keep(self, paths: StoppingPaths, required: np.ndarray) -> np.ndarray | None:
        """Looks along the first of ``paths`` until it is known whether it keeps the gaps ``required`` (n,).

        Returns:
            None if it does, else the least gaps known along it: shape (n,), in [m].
        """
        projected = self._projected(paths)
        looked: tuple[int, int] | None = None
        ahead = 1
        for _ in range(_LOOKS):
            gaps = _bounds(projected)
            low = gaps[0] < required
            first, index = divmod(int(low.argmax()), self.count)
            if not low[first, index]:
                return None
            # From the end of the piece, and if that will not do from its begin.
            ahead = 1 if looked != (first, index) else ahead - 1
            looked = first, index
            if ahead < 0:
                break
            known = len(self._more)
            gap = min(self._look(place, index) for place in self._places(paths, first + ahead, index))
            for plane in self._more[known:]:
                plane.lift(projected, paths)
            if gap < required[index]:
                break
        return _bounds(projected)[0].min(axis=0)

    def kept_by(self, paths: StoppingPaths, clearance: float) -> np.ndarray:
        """The gap to each obstacle that the first of ``paths`` keeps, at most ``clearance``: (n,), in [m].

        A moving obstacle that meets the robot even on this path counts as one that stops as it does.
        """
        kept = np.full(self.count, clearance)
        if self.keep(paths, kept - TOLERANCE) is None:
            return kept
        for index in np.flatnonzero(self.least(paths)[0] < clearance).tolist():
            if index in self._drifts:
                kept[index] = self._kept_by_moving(paths, index, clearance)
            else:
                points = np.unique(paths.points[0]).tolist()
                kept[index] = min(clearance, *(self._look(point, index) for point in points))
        return kept

    def _kept_by_moving(self, paths: StoppingPaths, index: int, clearance: float) -> float:
        drift = self._drifts[index]
        way = dict(zip(paths.times()[0].tolist(), paths.points[0].tolist(), strict=True))
        rest = max(way)
        way |= dict.fromkeys(np.linspace(rest, drift.horizon, PIECES).tolist(), way[rest])
        kept, before, since = clearance, math.inf, 0.0
        for time, point in way.items():
            gap = self._look(point - drift.at(time), index)
            if gap < 0.0 <= before:
                # The gap in between is taken as straight in time.
                drift.stop(time - (time - since) * gap / (gap - before))
                gap = self._look(point - drift.at(time), index)
            kept, before, since = min(kept, gap), gap, time
        return kept

    def _projected(self, paths: StoppingPaths) -> np.ndarray:
        """Gaps at the points of ``paths`` and how they change on the pieces: (m, 3 k + 1, n), in [m]."""
        projected = paths.along @ self._normals
        projected[:, : PIECES + 1] += self._offsets
        for index, drift in self._drifts.items():
            projected[..., index] -= _advance(paths, self._normals[:, index], drift)
        for plane in self._more:
            plane.lift(projected, paths)
        return projected

    def _places(self, paths: StoppingPaths, node: int, index: int) -> list[complex]:
        """Where a point of the first path is as seen from an obstacle, were it still where it is now."""
        point = complex(paths.points[0, node])
        if index not in self._drifts:
            return [point]
        moved = self._drifts[index].around(paths)[:, 0, node]
        return [point - displacement for displacement in set(moved.tolist())]

    def _look(self, point: complex, index: int) -> float:
        """The gap to obstacle ``index`` with the body at ``point``, in [m]; what is seen from there stays."""
        name = self._found[index].id_G
        for item in self._nearby(point.real, point.imag, 2 * self._reach + self._body):
            if item.id_G == name:
                normal, gap = item.grad_W[:2], item.distance - self._body
                offset = gap - normal[0] * point.real - normal[1] * point.imag
                self._more.append(_Plane(index, normal, offset, self._drifts.get(index)))
                return gap
        return math.inf


def _advance(paths: StoppingPaths, normal: np.ndarray, drift: Drift) -> np.ndarray:
    """What a moving obstacle takes of a gap at the points, and how that changes: (m, 3 k + 1), in [m]."""
    moved = drift.around(paths)
    nearer = (moved.real * normal[0] + moved.imag * normal[1]).max(axis=0)
    change = np.diff(nearer, axis=1)
    return np.concatenate([nearer, -change, change], axis=1)


def _bounds(projected: np.ndarray) -> np.ndarray:
    gap = projected[:, : PIECES + 1]
    nearing = projected[:, PIECES + 1 : 2 * PIECES + 1]
    leaving = projected[:, 2 * PIECES + 1 :]
    # A piece that first nears an obstacle and then leaves it comes no nearer than both tangents.
    dip = np.maximum(np.minimum(nearing, leaving), 0.0)
    return np.minimum(gap[:, :-1], gap[:, 1:]) - dip
