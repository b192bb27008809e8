"""Predicted displacement of an obstacle on a known path while the robot drives and brakes.

Points of the plane are complex numbers, x + iy in [m], world frame; times are in [s] from now.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.arbitration.safety.braking_paths import BrakingPaths

ObstaclePath = tuple[NDArray[np.float64], NDArray[np.complex128]]
"""Waypoints of a moving obstacle: times (n,) in [s] from the start of a trial, and positions (n,) in [m]."""


class ObstacleMotion:
    """Displacement of a moving obstacle from its present position.

    Args:
        times: Times of the waypoints, in [s] from now; the obstacle is at rest before the first and after the
            last.
        positions: The waypoints, complex, in [m]; motion between them is straight and uniform.
        period: How long the plant may treat the obstacle as static, in [s].
        horizon: Prediction horizon, in [s].

    Attributes:
        horizon: As given.
        largest_displacement: Within the horizon, in [m].
    """

    def __init__(
        self,
        times: NDArray[np.float64],
        positions: NDArray[np.complex128],
        *,
        period: float,
        horizon: float,
    ) -> None:
        self._times, self._positions = times, positions
        self._present = np.interp(0.0, times, positions)
        self._waypoint_times = [time for time in times.tolist() if 0.0 < time < horizon]
        self._period = period
        self.horizon = horizon
        self._stop_time = math.inf
        self._cached: tuple[BrakingPaths, NDArray[np.complex128]] | None = None
        self.largest_displacement = float(np.abs(self.displacement([*self._waypoint_times, horizon])).max())

    def displacement(self, times: ArrayLike) -> NDArray[np.complex128]:
        """Displacements at ``times``, complex, in [m]; the shape is that of ``times``."""
        moved = np.interp(np.minimum(times, self._stop_time), self._times, self._positions) - self._present
        return np.asarray(moved)

    def displacements_along(self, paths: BrakingPaths) -> NDArray[np.complex128]:
        """Displacements to check at the nodes of ``paths``: shape (q, m, k + 1), complex, in [m].

        For each node these are the displacement when the robot is there, the one a period earlier, and the
        one at each waypoint that the obstacle passes while the robot is on an adjacent piece. Along any
        direction, the obstacle's displacement on a piece is at most the linear interpolation between the
        largest of these at both ends. The last node lasts until the horizon, since the robot stays at rest.
        """
        if self._cached is None or self._cached[0] is not paths:
            until = paths.times()
            since = np.maximum(until - self._period, 0.0)
            until[:, -1] = self.horizon
            times = [since, until]
            for waypoint_time in self._waypoint_times:
                begin, end = since.copy(), until.copy()
                begin[:, 1:], end[:, :-1] = since[:, :-1], until[:, 1:]
                on_piece = (begin <= waypoint_time) & (waypoint_time <= end)
                times.append(np.where(on_piece, waypoint_time, until))
            self._cached = paths, self.displacement(np.stack(times))
        return self._cached[1]

    def stop_at(self, time: float) -> None:
        """Treats the obstacle as at rest from ``time`` on, in [s]."""
        self._stop_time, self._cached = time, None
