"""Planar poses as Drake's transforms."""

from __future__ import annotations

from collections.abc import Sequence

from pydrake.math import RigidTransform, RollPitchYaw


def pose_to_transform(pose: Sequence[float]) -> RigidTransform:
    """X_WB of a robot on the floor at ``pose``, [x, y, yaw] in [m, m, rad], world frame."""
    x, y, yaw = pose
    return RigidTransform(RollPitchYaw(0.0, 0.0, yaw), [x, y, 0.0])
