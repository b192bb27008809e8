"""Array helpers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def read_only(values: ArrayLike) -> NDArray[np.float64]:
    """A copy that cannot be written to."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def path_at(
    path: NDArray[np.float64], times: NDArray[np.float64], queries: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Positions (Q, D) of a path (N, D), known at increasing ``times`` (N,), at the times ``queries`` (Q,).

    Interpolates linearly and holds the path beyond both ends.
    """
    return np.stack([np.interp(queries, times, column) for column in path.T], axis=-1)


def as_points(positions: NDArray[np.float64]) -> NDArray[Any]:
    """Positions (..., D) in the form that `lengths` takes: complex (...) if D is 2, else as they are.

    numpy subtracts and measures complex numbers in one pass each.
    """
    if positions.shape[-1] == 2:
        return np.ascontiguousarray(positions).view(np.complex128)[..., 0]
    return np.ascontiguousarray(positions)


def as_point(position: Sequence[float]) -> complex | NDArray[np.float64]:
    """One position (D,) in the form of `as_points`."""
    return complex(*position) if len(position) == 2 else np.array(position)


def lengths(offsets: NDArray[Any]) -> NDArray[np.float64]:
    """Euclidean lengths (...) of differences of `as_points`."""
    if offsets.dtype == np.complex128:
        return np.abs(offsets)  # type: ignore[no-any-return]
    return np.sqrt(np.einsum("...d,...d", offsets, offsets))  # type: ignore[no-any-return]
