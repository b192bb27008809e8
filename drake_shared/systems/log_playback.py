"""Source of the values that a log recorded, over time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common.value import Value
from pydrake.geometry import FrameId, FramePoseVector
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_shared.robots.pose import pose_to_transform


class LogPlayback(LeafSystem):
    """Outputs the rows of a log, each from its time to the next.

    .. pydrake_system::

        name: LogPlayback
        output_ports:
        - (one for each key of rows)
        - geometry_pose

    Outputs:
        One vector port for each key of ``rows``.
        geometry_pose: FramePoseVector that places ``frame`` at the row of "pose", [x, y, yaw] in
            [m, m, rad], world frame. Only with ``frame``.

    Args:
        times: Shape (n,), in [s], increasing from 0.
        rows: Name of each vector port, and its values, shape (n, size) or (n,).
        frame: The robot's frame in a SceneGraph.
    """

    def __init__(
        self, *, times: ArrayLike, rows: Mapping[str, ArrayLike], frame: FrameId | None = None
    ) -> None:
        super().__init__()
        self.set_name("log_playback")
        self._times = np.asarray(times, dtype=float)
        self._rows = {
            name: np.reshape(np.asarray(values, dtype=float), (len(self._times), -1))
            for name, values in rows.items()
        }
        self._frame = frame
        for name, values in self._rows.items():
            self.DeclareVectorOutputPort(name, values.shape[1], self._calc(name), {self.time_ticket()})
        if frame is not None:
            self.DeclareAbstractOutputPort(
                "geometry_pose",
                lambda: Value(FramePoseVector()),
                self._calc_geometry_pose,
                {self.time_ticket()},
            )

    def _row(self, context: Context) -> int:
        # Times of steps are sums of rounded numbers.
        return max(int(self._times.searchsorted(context.get_time() + 1e-9, side="right")) - 1, 0)

    def _calc(self, name: str) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output.set_value(self._rows[name][self._row(context)])

        return calc

    def _calc_geometry_pose(self, context: Context, output: Any) -> None:
        poses = FramePoseVector()
        poses.set_value(self._frame, pose_to_transform(self._rows["pose"][self._row(context)].tolist()))
        output.set_value(poses)
