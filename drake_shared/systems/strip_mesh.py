"""Triangles of a level strip along a curve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def strip_mesh(
    center: Floats, half_width: Floats, known: NDArray[np.bool_] | None = None
) -> tuple[Floats, NDArray[np.int32]]:
    """A strip that is level across its direction.

    Args:
        center: Shape (n, 3), in [m].
        half_width: Shape (n,), in [m].
        known: Shape (n,), where there is a strip; everywhere if None.

    Returns:
        Vertices (3, 2 n), in [m], and triangles (3, m) of their indices.
    """
    tangent = np.gradient(center[:, :2], axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=-1, keepdims=True), 1e-9)
    side = np.zeros_like(center)
    side[:, 0], side[:, 1] = -tangent[:, 1] * half_width, tangent[:, 0] * half_width
    vertices = np.stack([center + side, center - side], axis=1).reshape(-1, 3)
    first = 2 * np.flatnonzero(np.ones(len(center) - 1, bool) if known is None else known[1:] & known[:-1])
    faces = np.concatenate([[first, first + 1, first + 2], [first + 1, first + 3, first + 2]], axis=1)
    return vertices.T, faces.astype(np.int32)
