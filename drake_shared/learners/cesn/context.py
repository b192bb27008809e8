"""Encoding a context, a set of observations, for the readout of the echo state network."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_CODE_GAIN = 2.0


def within(positions: Array, reach: float) -> Array:
    """Normalized positions (..., D), those farther than ``reach`` moved in to that distance."""
    distance = np.sqrt(np.square(positions).sum(axis=-1, keepdims=True))
    moved: Array = positions * (reach / np.maximum(distance, reach))
    return moved


def encode(modes: Array, positions: Array, noise: float) -> Array:
    """The code of a context: the posterior of the amounts of each mode, given the observations.

    The amounts have independent standard normal priors, and positions have normal noise. The code is their
    posterior mean and the decrease of their variance. It has one size for any number of observations and does
    not depend on their order.

    Args:
        modes: Shape (..., n, D, K), the modes at the time of each observation; zero for none.
        positions: Shape (..., n, D), normalized.
        noise: Standard deviation of positions, normalized.

    Returns:
        Shape (..., 2 K).
    """
    *batch, count, axes, size = modes.shape
    rows = modes.reshape(*batch, axes * count, size) / noise
    across = np.swapaxes(rows, -1, -2)
    covariance = np.linalg.inv(across @ rows + np.eye(size))
    observed = across @ (positions.reshape(*batch, axes * count, 1) / noise)
    mean = (covariance @ observed)[..., 0]
    decrease = 1.0 - np.diagonal(covariance, axis1=-2, axis2=-1)
    return _CODE_GAIN * np.concatenate([mean, decrease], axis=-1)


def features(code: NDArray[Any], weights: NDArray[Any], bias: NDArray[Any]) -> NDArray[Any]:
    """Features of a context: 1, its code (..., 2 K), and a random layer of it, (..., 1 + 2 K + H)."""
    one = np.ones((*code.shape[:-1], 1), code.dtype)
    return np.concatenate([one, code, np.tanh(code @ weights + bias)], axis=-1)


def at_times(path: Array, times: NDArray[Any], duration: float) -> Array:
    """Interpolates ``path`` (P + 1, ...), at even times from 0 to ``duration``, at ``times`` (n,) within."""
    steps = times * ((len(path) - 1) / duration)
    before = np.minimum(steps.astype(int), len(path) - 2)
    share = (steps - before).reshape(-1, *[1] * (path.ndim - 1))
    between: Array = path[before] * (1.0 - share) + path[before + 1] * share
    return between
