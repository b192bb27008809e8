"""What several rooms do with arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def read_only(values: ArrayLike) -> NDArray[np.float64]:
    """A copy that cannot be written to."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def path_at(
    path: NDArray[np.float64], times: NDArray[np.float64], asked: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Positions (Q, 2) of a path (N, 2), known at increasing ``times`` (N,), at the times ``asked`` (Q,).

    They are linear in between, and held beyond both ends.
    """
    return np.stack([np.interp(asked, times, path[:, axis]) for axis in (0, 1)], axis=-1)
