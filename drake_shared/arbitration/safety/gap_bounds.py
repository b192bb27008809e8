"""Lower bounds of the gaps between a robot's body and convex obstacles along paths.

Points of the plane are complex numbers, x + iy in [m], world frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import GeometryId, SignedDistanceToPoint

from drake_shared.arbitration.safety.braking_paths import PIECES, BrakingPaths
from drake_shared.arbitration.safety.obstacle_motion import ObstacleMotion
from drake_shared.robots.motion import Pose

Floats = NDArray[np.float64]
DistanceQuery = Callable[[float, float, float], list[SignedDistanceToPoint]]
"""Signed distances from a point (x, y) to the obstacles within a distance; all in [m]."""

TOLERANCE = 1e-6
"""Largest violation of a required gap that counts as rounding, in [m]."""
_MAX_QUERIES = 8


class _HalfPlane(NamedTuple):
    """A half-plane that contains an obstacle and moves with it."""

    obstacle: int
    normal: Floats
    offset: float
    motion: ObstacleMotion | None

    def project(self, paths: BrakingPaths) -> Floats:
        """Gaps at the nodes of ``paths`` and their changes on the pieces: shape (m, 3 k + 1), in [m]."""
        projected: Floats = paths.points_and_tangents @ self.normal
        projected[:, : PIECES + 1] += self.offset
        if self.motion is not None:
            projected -= _project_motion(paths, self.normal, self.motion)
        return projected

    def tighten(self, projected: Floats, paths: BrakingPaths) -> None:
        """Replaces the bounds in ``projected`` (m, 3 k + 1, n) where this half-plane gives higher ones."""
        candidate = self.project(paths)
        known = projected[..., self.obstacle]
        higher = candidate[:, : PIECES + 1] > known[:, : PIECES + 1]
        where = np.concatenate([higher, higher[:, :-1], higher[:, 1:]], axis=1)
        np.copyto(known, candidate, where=where)


class GapBounds:
    """Lower bounds of the gaps between the body and the obstacles along paths.

    A convex obstacle lies in the half-plane that touches it at the point nearest to a query point. So each
    distance query bounds the gap at all other points from below, and the highest bound of all queries is
    used. The half-planes of a moving obstacle move with it.

    Args:
        query: Measures distances to the obstacles at their present positions.
        body_radius: Of the robot, in [m].
        start: Present pose: x, y in [m] and yaw in [rad].
        reach: Obstacles with a larger gap to the body at ``start`` are ignored, in [m].
        motions: Of the moving obstacles.

    Attributes:
        count: Number n of obstacles within reach.
    """

    def __init__(
        self,
        query: DistanceQuery,
        body_radius: float,
        start: Pose,
        reach: float,
        motions: Mapping[GeometryId, ObstacleMotion],
    ) -> None:
        self._query = query
        self._body_radius = body_radius
        self._reach = reach
        self._found = query(start[0], start[1], reach + body_radius)
        self.count = len(self._found)
        self._extra: list[_HalfPlane] = []
        self._motions: dict[int, ObstacleMotion] = {}
        if self.count:
            normals = np.array([item.grad_W for item in self._found])[:, :2]
            distances = np.array([item.distance for item in self._found])
            self._normals = normals.T
            self._offsets = distances - body_radius - normals @ start[:2]
        if motions:
            ids = enumerate(item.id_G for item in self._found)
            self._motions = {index: motions[name] for index, name in ids if name in motions}

    def at_start(self) -> float:
        """Least gap to a static obstacle at the start, in [m]; infinite if there is none within reach."""
        static = (item.distance for index, item in enumerate(self._found) if index not in self._motions)
        return min(static, default=math.inf) - self._body_radius

    def least(self, paths: BrakingPaths) -> Floats:
        """Lower bounds of the least gaps along each path: shape (m, n), in [m]."""
        bounds: Floats = _piece_bounds(self._project(paths)).min(axis=1)
        return bounds

    def find_violation(self, paths: BrakingPaths, required: Floats) -> Floats | None:
        """Checks the first path, with further queries where the bounds are too loose to decide.

        Args:
            paths: The first one is checked.
            required: Gap required of each obstacle: shape (n,), in [m].

        Returns:
            None if the path keeps the required gaps, else the bounds of its least gaps: shape (n,), in [m].
        """
        projected = self._project(paths)
        queried: set[tuple[int, int]] = set()
        for _ in range(_MAX_QUERIES):
            violated = _piece_bounds(projected)[0] < required
            piece, obstacle = divmod(int(violated.argmax()), self.count)
            if not violated[piece, obstacle]:
                return None
            # Query from the end of the piece; if the piece is still violated, from its begin.
            left = {(piece + 1, obstacle), (piece, obstacle)} - queried
            if not left:
                break
            node = max(left)
            queried.add(node)
            known = len(self._extra)
            points = self._relative_points(paths, *node)
            gap = min(self._measure(point, obstacle) for point in points)
            for plane in self._extra[known:]:
                plane.tighten(projected, paths)
            if gap < required[obstacle]:
                break
        bounds: Floats = _piece_bounds(projected)[0].min(axis=0)
        return bounds

    def gaps_kept(self, paths: BrakingPaths, clearance: float) -> Floats:
        """Gap to each obstacle that the first path keeps, at most ``clearance``: shape (n,), in [m].

        A moving obstacle that hits the robot even on this path is treated as stopping at the contact.
        """
        kept = np.full(self.count, clearance)
        if self.find_violation(paths, kept - TOLERANCE) is None:
            return kept
        for index in np.flatnonzero(self.least(paths)[0] < clearance).tolist():
            if index in self._motions:
                kept[index] = self._gap_kept_to_moving(paths, index, clearance)
            else:
                points = np.unique(paths.points[0]).tolist()
                kept[index] = min(clearance, *(self._measure(point, index) for point in points))
        return kept

    def _gap_kept_to_moving(self, paths: BrakingPaths, index: int, clearance: float) -> float:
        motion = self._motions[index]
        points = dict(zip(paths.times()[0].tolist(), paths.points[0].tolist(), strict=True))
        rest = max(points)
        points |= dict.fromkeys(np.linspace(rest, motion.horizon, PIECES).tolist(), points[rest])
        kept, last_gap, last_time = clearance, math.inf, 0.0
        for time, point in points.items():
            gap = self._measure(point - complex(motion.displacement(time)), index)
            if gap < 0.0 <= last_gap:
                # The time of contact, by linear interpolation of the gap.
                motion.stop_at(time - (time - last_time) * gap / (gap - last_gap))
                gap = self._measure(point - complex(motion.displacement(time)), index)
            kept, last_gap, last_time = min(kept, gap), gap, time
        return kept

    def _project(self, paths: BrakingPaths) -> Floats:
        """Bounds at the nodes of ``paths`` and their changes on the pieces: shape (m, 3 k + 1, n), in [m]."""
        projected: Floats = paths.points_and_tangents @ self._normals
        projected[:, : PIECES + 1] += self._offsets
        for index, motion in self._motions.items():
            projected[..., index] -= _project_motion(paths, self._normals[:, index], motion)
        for plane in self._extra:
            plane.tighten(projected, paths)
        return projected

    def _relative_points(self, paths: BrakingPaths, node: int, index: int) -> list[complex]:
        """A node of the first path relative to an obstacle, added to the obstacle's present position."""
        point = complex(paths.points[0, node])
        if index not in self._motions:
            return [point]
        displacements = self._motions[index].displacements_along(paths)[:, 0, node]
        return [point - displacement for displacement in set(displacements.tolist())]

    def _measure(self, point: complex, index: int) -> float:
        """Gap to an obstacle with the body at ``point``, in [m]; keeps the half-plane seen from there."""
        name = self._found[index].id_G
        for item in self._query(point.real, point.imag, 2 * self._reach + self._body_radius):
            if item.id_G == name:
                normal, gap = item.grad_W[:2], item.distance - self._body_radius
                offset = gap - normal[0] * point.real - normal[1] * point.imag
                self._extra.append(_HalfPlane(index, normal, offset, self._motions.get(index)))
                return float(gap)
        return math.inf


def _project_motion(paths: BrakingPaths, normal: Floats, motion: ObstacleMotion) -> Floats:
    """Decrease of the gap by the obstacle's motion at the nodes, and its changes: (m, 3 k + 1), in [m]."""
    moved = motion.displacements_along(paths)
    nearer = (moved.real * normal[0] + moved.imag * normal[1]).max(axis=0)
    change = np.diff(nearer, axis=1)
    return np.concatenate([nearer, -change, change], axis=1)


def _piece_bounds(projected: Floats) -> Floats:
    """Lower bounds of the gaps on each piece: shape (m, k, n), in [m]."""
    gap = projected[:, : PIECES + 1]
    approaching = projected[:, PIECES + 1 : 2 * PIECES + 1]
    leaving = projected[:, 2 * PIECES + 1 :]
    # On a piece that first approaches and then leaves, the gap stays above both tangents.
    dip = np.maximum(np.minimum(approaching, leaving), 0.0)
    bounds: Floats = np.minimum(gap[:, :-1], gap[:, 1:]) - dip
    return bounds
