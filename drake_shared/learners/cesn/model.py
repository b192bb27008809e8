"""All that a trained context-based echo state network is, as data, and what becomes of a context."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_CODE_GAIN = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class CesnModel:
    """All that a trained context-based echo state network is.

    "Normalised" is counted from ``reference`` and in units of ``scale``.

    Attributes:
        preset: Which preset trained it.
        grid: Shape (N,), in [s].
        reference: Shape (N, 2), the demonstrations' even mean, in [m].
        scale: Their spread, in [m].
        modes: Shape (P + 1, 2, K), at P + 1 even phases of the task the principal modes of the normalised
            demonstrations, each of the size of its standard deviation.
        noise: Standard deviation of positions shown, normalised.
        reach: From the reference, normalised: positions farther away count as so far away.
        states: Shape (P + 1, D), of the reservoir at these phases.
        hidden_weights, hidden_bias: Shapes (2 K, H) and (H,), of the random layer.
        readout: Shape (1 + 2 K + H, 4, D): of a context's features, how the states are read out for the
            normalised mean in x and in y and for the logarithms of its variance.
        log_variance: Shape (2, P + 1), what the latter are counted from.
        sigma_floor: Least standard deviation, normalised.
        sigma_scale: A factor on all standard deviations; 1 is as trained.
        demonstrations: Shape (m, N, 2), in [m].
        weights: Shape (m,), Pd of Alg. 1.
        doubt_reach, doubt_gain: Of `Doubt`, in [m] and [m^2/m^2].
        confidence_gain: K of eq. (1), in [1/m^2].
        metadata: Whatever else its file says.
    """

    preset: str
    grid: Array
    reference: Array
    scale: float
    modes: Array
    noise: float
    reach: float
    states: Array
    hidden_weights: Array
    hidden_bias: Array
    readout: Array
    log_variance: Array
    sigma_floor: float
    demonstrations: Array
    weights: Array
    doubt_reach: float
    doubt_gain: float
    confidence_gain: float
    metadata: Mapping[str, Any]
    sigma_scale: float = 1.0


def within(positions: Array, reach: float) -> Array:
    """Normalised positions (..., 2), those beyond ``reach`` drawn in to it."""
    distance = np.sqrt(np.square(positions).sum(axis=-1, keepdims=True))
    return positions * (reach / np.maximum(distance, reach))


def encode(modes: Array, positions: Array, noise: float) -> Array:
    """The code of a context: what the observations together say of how much of each mode there is.

    As if the amounts of the modes were normal and independent, with variance 1 each, and positions had normal
    noise: then this is their posterior mean, and by how much their variance has shrunk. For a set of
    observations of any size and in any order it is one code of the same size.

    Args:
        modes: Shape (..., n, 2, K), the modes at the time of each observation; where they are zero there is
            no observation.
        positions: Shape (..., n, 2), normalised.
        noise: Standard deviation of positions, normalised.

    Returns:
        Shape (..., 2 K).
    """
    *batch, count, _, size = modes.shape
    rows = modes.reshape(*batch, 2 * count, size) / noise
    across = np.swapaxes(rows, -1, -2)
    covariance = np.linalg.inv(across @ rows + np.eye(size))
    told = across @ (positions.reshape(*batch, 2 * count, 1) / noise)
    mean = (covariance @ told)[..., 0]
    shrunk = 1.0 - np.diagonal(covariance, axis1=-2, axis2=-1)
    return _CODE_GAIN * np.concatenate([mean, shrunk], axis=-1)


def features(code: NDArray[Any], weights: NDArray[Any], bias: NDArray[Any]) -> NDArray[Any]:
    """What is read out of a context: 1, its code (..., 2 K), and the random layer's, (..., 1 + 2 K + H)."""
    one = np.ones((*code.shape[:-1], 1), code.dtype)
    return np.concatenate([one, code, np.tanh(code @ weights + bias)], axis=-1)


def at_times(path: Array, times: NDArray[Any], duration: float) -> Array:
    """``path`` (P + 1, ...) of even times from 0 to ``duration`` at ``times`` (n,) within: shape (n, ...)."""
    steps = times * ((len(path) - 1) / duration)
    before = np.minimum(steps.astype(int), len(path) - 2)
    share = (steps - before).reshape(-1, *[1] * (path.ndim - 1))
    return path[before] * (1.0 - share) + path[before + 1] * share
