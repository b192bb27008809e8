"""Replaces a measured pose by NaN when it is too old."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem


class PoseWatchdog(LeafSystem):
    """Passes on a measured pose while it is fresh, and NaN when it is older than a timeout.

    .. pydrake_system::

        name: PoseWatchdog
        input_ports:
        - pose
        - pose_age
        output_ports:
        - checked_pose
        - fresh

    A localisation that stops sending leaves its last pose behind, which looks like a robot at rest. With NaN
    in its place the :class:`IntentionEstimator` outputs the confidence 0, so that the human drives.

    Inputs:
        pose (n): The measured pose.
        pose_age (1): Time since it was measured, in [s].

    Outputs (both with direct feedthrough):
        checked_pose (n): The pose, or NaN if its age exceeds ``timeout`` or is NaN.
        fresh (1): 1 if the pose is passed on, else 0.

    Args:
        timeout: Largest age of a pose that is passed on, in [s].
        size: Number of elements n.

    Raises:
        ValueError: ``timeout`` is not positive and finite.
    """

    def __init__(self, *, timeout: float, size: int = 3) -> None:
        super().__init__()
        self.set_name("pose_watchdog")
        if not (math.isfinite(timeout) and timeout > 0):
            raise ValueError(f"timeout must be positive and finite, got {timeout}")
        self._timeout = timeout
        self._size = size
        self._pose_port = self.DeclareVectorInputPort("pose", size)
        self._age_port = self.DeclareVectorInputPort("pose_age", 1)
        inputs = {self.all_input_ports_ticket()}
        self.DeclareVectorOutputPort("checked_pose", size, self._calc_checked_pose, inputs)
        self.DeclareVectorOutputPort("fresh", 1, self._calc_fresh, inputs)

    def _is_fresh(self, context: Context) -> bool:
        return bool(self._age_port.Eval(context)[0] <= self._timeout)

    def _calc_checked_pose(self, context: Context, output: BasicVector) -> None:
        fresh = self._is_fresh(context)
        output.SetFromVector(self._pose_port.Eval(context) if fresh else np.full(self._size, math.nan))

    def _calc_fresh(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self._is_fresh(context))
