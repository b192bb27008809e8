"""A log as a system: what was recorded, at the time at which it was."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import FrameId, FramePoseVector
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.framework import BasicVector, Context, LeafSystem


class LogPlayback(LeafSystem):
    """Gives out the rows of a log, each from its time to the next.

    .. pydrake_system::

        name: LogPlayback
        output_ports:
        - pose
        - geometry_pose
        - human_weight
        - human_command
        - autonomous_command
        - shared_command

    Outputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame.
        geometry_pose: FramePoseVector that places ``frame``.
        human_weight (1): w.
        human_command, autonomous_command, shared_command (2): Wheel speeds [left, right] in [rad/s].

    Args:
        times: Shape (n,), in [s], increasing from 0.
        rows: Each vector port's name to its values, shape (n, size).
        frame: The robot's frame in a SceneGraph.
    """

    SIZES: ClassVar[dict[str, int]] = {
        "pose": 3,
        "human_weight": 1,
        "human_command": 2,
        "autonomous_command": 2,
        "shared_command": 2,
    }

    def __init__(self, *, times: np.ndarray, rows: dict[str, np.ndarray], frame: FrameId) -> None:
        super().__init__()
        self._times = np.asarray(times, dtype=float)
        self._rows = {
            name: np.reshape(rows[name], (len(self._times), size)) for name, size in self.SIZES.items()
        }
        self._frame = frame
        for name, size in self.SIZES.items():
            self.DeclareVectorOutputPort(name, size, self._calc(name), {self.time_ticket()})
        self.DeclareAbstractOutputPort(
            "geometry_pose", lambda: Value(FramePoseVector()), self._calc_geometry_pose, {self.time_ticket()}
        )

    def _row(self, context: Context) -> int:
        # Times counted in steps miss each other by rounding.
        return max(int(self._times.searchsorted(context.get_time() + 1e-9, side="right")) - 1, 0)

    def _calc(self, name: str) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output.set_value(self._rows[name][self._row(context)])

        return calc

    def _calc_geometry_pose(self, context: Context, output: Value) -> None:
        x, y, yaw = self._rows["pose"][self._row(context)]
        poses = FramePoseVector()
        poses.set_value(self._frame, RigidTransform(RollPitchYaw(0, 0, yaw), [x, y, 0]))
        output.set_value(poses)
