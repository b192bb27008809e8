"""The interface of learners, and the confidence that follows from their variance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.elementwise import FLOATS, Elementwise, Real
from drake_shared.learners.modes import Modes

Array = NDArray[np.float64]
Prediction = tuple[Array, Array]
"""Mean, shape (Q, D), in [m], and variance, shape (Q, D), in [m^2]."""


@runtime_checkable
class Learner(Protocol):
    """A distribution over trajectories of a position of size D, conditioned on observed positions.

    D is that of the demonstrations. `drake_shared.learners.check_learner` tests whether an object is one.

    Attributes:
        name: Name under which the learner is registered, such as "cnmp".
        preset: Name of the preset it was trained by.
        confidence_gain: K of eq. (1), in [1/m^2], positive and finite.
        grid: Shape (N,), the usual query times from 0 to ``duration``, in [s], increasing; read-only.
        duration: T, in [s].
        demonstrations: Shape (m, N, D), its training data on the grid, in [m]; read-only. None if unknown.
        metadata: JSON-serializable. These keys have a meaning to others:

            - "clock": What the time of an observation is. "time", the default, is that since the start of the
              trial; "progress" is that of the nearest demonstrated point, which waits for a slow driver.
            - "evidence": What counts as an observation. "pose", the default, or "pose+command", where the
              point to which the human's command leads is a second one.
            - "confidence_calibration": Makes the confidence a probability; see
              `drake_shared.learners.calibrated_confidence`.
            - "scenario": Name of the scenario of the demonstrations.
            - "training": Record of the training; `drake_shared.learners.dataset.data_record` makes its part
              about the data, from which lineage is drawn.
            - "id", "file": Hash of the content and path of the file. `load_learner` sets them, whatever a
              file states.
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

    def predict(self, times: Array, positions: Array, query_times: Array) -> Prediction:
        """Predicts the trajectory through the observations at the query times.

        Args:
            times: Shape (n,), n >= 0, of the observations, in [s].
            positions: Shape (n, D), observed, in [m].
            query_times: Shape (Q,), in [s]. Times outside [0, T], here and in ``times``, count as the
                nearest end of it.

        Returns:
            Mean, shape (Q, D), in [m], and variance, shape (Q, D), in [m^2], positive. New float64 arrays,
            which later calls leave as they are. NaN where an observation is NaN.
        """
        ...


@runtime_checkable
class MultimodalLearner(Learner, Protocol):
    """A learner that also predicts the modes of a mixture."""

    def predict_modes(self, times: Array, positions: Array, query_times: Array) -> tuple[Array, Array, Modes]:
        """Mean and total variance as `predict` returns them, and the modes that they summarize."""
        ...


@runtime_checkable
class PrefixLearner(Learner, Protocol):
    """A learner that predicts from several sets of observations in one call, which is faster."""

    def predict_prefixes(self, times: Array, positions: Array, query_times: Array) -> list[Prediction]:
        """What `predict` returns for the first observation, the first two, and so on to all n."""
        ...


@runtime_checkable
class ScalableLearner(Learner, Protocol):
    """A learner whose variance can be corrected after training."""

    def scaled(self, factor: float, *, confidence_gain: float | None = None) -> Learner:
        """A copy with all standard deviations times ``factor``, and K of its own if given."""
        ...


def check_query(
    times: ArrayLike, positions: ArrayLike, query_times: ArrayLike, size: int
) -> tuple[Array, Array, Array]:
    """Converts the arguments of `Learner.predict` to arrays, for positions of ``size`` D.

    Raises:
        ValueError: They have other shapes.
    """
    seen_times = np.asarray(times, dtype=float)
    seen = np.asarray(positions, dtype=float)
    queries = np.asarray(query_times, dtype=float)
    if seen_times.ndim != 1 or seen.shape != (len(seen_times), size) or queries.ndim != 1:
        shapes = f"{seen_times.shape}, {seen.shape} and {queries.shape}"
        raise ValueError(f"predict needs shapes (n,), (n, {size}) and (Q,), got {shapes}")
    return seen_times, seen, queries


def mean_variance(query_times: ArrayLike, variance: ArrayLike, t: float) -> float:
    """The mean variance of eq. (1) of Amirshirzad et al. 2022: over the queries after t and all coordinates.

    Args:
        query_times: Shape (Q,), increasing, in [s], Q >= 1.
        variance: Shape (Q, D), in [m^2].
        t: Now, in [s]. At the last query or later the variance of that query alone counts.

    Returns:
        In [m^2].
    """
    times = np.asarray(query_times)
    # Times that are multiples of a step differ by rounding; a query "at" t is not after it.
    first = int(np.searchsorted(times, t + 1e-9, side="right"))
    return float(np.asarray(variance)[min(first, len(times) - 1) :].mean())


def confidence(mean_variance: Real, confidence_gain: Real, xp: Elementwise = FLOATS) -> Real:
    """The confidence factor c_f of eq. (1), in [0, 1]; NaN where the variance is.

    Args:
        mean_variance: In [m^2].
        confidence_gain: K, in [1/m^2].
        xp: For numbers or arrays.
    """
    return 1.0 / xp.maximum(confidence_gain * mean_variance, 1.0)
