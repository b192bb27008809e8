"""Array helpers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def read_only(values: ArrayLike) -> NDArray[np.float64]:
    """A read-only copy."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def path_at(
    path: NDArray[np.float64], times: NDArray[np.float64], query_times: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Interpolates a path linearly; beyond its ends the first and last positions hold.

    Args:
        path: Positions, shape (N, D).
        times: Times of the positions, shape (N,), increasing.
        query_times: Shape (Q,).

    Returns:
        Positions at the query times, shape (Q, D).
    """
    return np.stack([np.interp(query_times, times, path[:, axis]) for axis in range(path.shape[1])], axis=-1)
