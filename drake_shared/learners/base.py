"""What every learner of intentions offers, and the confidence that follows from its variance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@runtime_checkable
class Learner(Protocol):
    """A distribution over trajectories, conditioned on points that were passed.

    Attributes:
        name: Which learner it is, such as "cnmp".
        preset: Which of its presets it was trained by.
        confidence_gain: K of eq. (1), in [1/m^2], positive.
        grid: Shape (N,), the usual query times from 0 to ``duration``, in [s]; read-only.
        duration: T, in [s].
        demonstrations: Shape (m, N, 2), what it was taught, on the grid, in [m]; read-only. None if unknown.
        metadata: What its file says of it.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def preset(self) -> str: ...  # noqa: D102
    @property
    def confidence_gain(self) -> float: ...  # noqa: D102
    @property
    def grid(self) -> Array: ...  # noqa: D102
    @property
    def duration(self) -> float: ...  # noqa: D102
    @property
    def demonstrations(self) -> Array | None: ...  # noqa: D102
    @property
    def metadata(self) -> Mapping[str, Any]: ...  # noqa: D102

    def predict(self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike) -> tuple[Array, Array]:
        """Predicts where the trajectory through the observations is at the query times.

        Args:
            times: Shape (n,), n >= 0, when each observation was made, in [s].
            positions: Shape (n, 2), what was observed, in [m].
            query_times: Shape (Q,), in [s]. Times outside [0, T], here and in ``times``, count as the
                nearest end of it: before the start the robot waits there, after the end it stays.

        Returns:
            Mean, shape (Q, 2), in [m], and variance, shape (Q, 2), in [m^2]; fresh arrays. NaN observed
            gives NaN.
        """
        ...


def check_query(times: ArrayLike, positions: ArrayLike, query_times: ArrayLike) -> tuple[Array, Array, Array]:
    """The arguments of `Learner.predict` as arrays.

    Raises:
        ValueError: They have other shapes.
    """
    seen_times = np.asarray(times, dtype=float)
    seen = np.asarray(positions, dtype=float)
    queries = np.asarray(query_times, dtype=float)
    if seen_times.ndim != 1 or seen.shape != (len(seen_times), 2) or queries.ndim != 1:
        shapes = f"{seen_times.shape}, {seen.shape} and {queries.shape}"
        raise ValueError(f"predict needs shapes (n,), (n, 2) and (Q,), got {shapes}")
    return seen_times, seen, queries


def mean_variance(query_times: ArrayLike, variance: ArrayLike, t: float) -> float:
    """The mean variance of eq. (1) of Amirshirzad et al. 2022: over the queries after t, and over x and y.

    Args:
        query_times: Shape (Q,), increasing, in [s], Q >= 1.
        variance: Shape (Q, 2), in [m^2].
        t: Now, in [s]. At the last query or after it there is nothing ahead, and that query alone counts.

    Returns:
        In [m^2].
    """
    times = np.asarray(query_times)
    # Times counted in steps miss each other by rounding; a query "at" t is not after it.
    first = int(np.searchsorted(times, t + 1e-9, side="right"))
    return float(np.asarray(variance)[min(first, len(times) - 1) :].mean())


def confidence(mean_variance: float, confidence_gain: float) -> float:
    """The confidence factor c_f of eq. (1), in [0, 1]; NaN if the variance is.

    Args:
        mean_variance: In [m^2].
        confidence_gain: K, in [1/m^2].
    """
    scaled = confidence_gain * mean_variance
    return 1.0 if scaled <= 1.0 else 1.0 / scaled
