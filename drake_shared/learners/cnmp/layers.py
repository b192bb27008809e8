"""The parts of the network other than matrix products, in numpy."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from itertools import accumulate
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float32]


def time_features(times: ArrayLike, duration: float, harmonics: int) -> NDArray[np.float64]:
    """t/T, and sin and cos of k pi t/T for k = 1..harmonics.

    With these Fourier features a network learns within seconds what changes quickly in time.

    Args:
        times: Shape (n,), in [s]; those outside [0, T] count as the nearest end.
        duration: T, in [s].
        harmonics: 0 gives raw time alone, scaled to 0..1.

    Returns:
        Shape (n, 1 + 2 harmonics).
    """
    progress = np.clip(np.asarray(times, dtype=float) / duration, 0.0, 1.0)
    angles = progress[:, None] * (np.pi * np.arange(1, harmonics + 1))
    return np.concatenate([progress[:, None], np.sin(angles), np.cos(angles)], axis=1)


def softplus(values: Floats) -> Floats:
    """log(1 + exp(v)); a new array."""
    if values.size and values.item(values.argmax()) > 80.0:
        return np.logaddexp(values, np.float32(0.0))
    # As exact in float32 and twice as fast, but it would overflow.
    result = np.exp(values)
    return np.log1p(result, out=result)


def aggregate(codes: Floats, aggregation: str) -> Floats:
    """One code (C,) for all observations, from their codes (n, C), n >= 1.

    "mean" is their mean. "bayesian" takes half of a code as an observation of a latent variable and half as
    its precision (Volpp et al. 2021): the result is the posterior mean and variance of that variable, from a
    prior of mean 0 and variance 1.
    """
    (code,) = aggregate_each([codes], aggregation)
    return cast(Floats, code)


@functools.lru_cache(maxsize=64)
def _starts(*sizes: int) -> NDArray[np.int64]:
    """The first row of each of several groups that follow each other."""
    return np.array([0, *accumulate(sizes[:-1])])


def aggregate_each(groups: Sequence[Floats], aggregation: str) -> Floats:
    """`aggregate` of each of k groups, shape (k, C)."""
    if aggregation == "mean":
        return np.array([group.sum(axis=0) / len(group) for group in groups])
    codes = np.concatenate(groups)
    half = codes.shape[1] // 2
    precision = softplus(codes[:, half:])
    weighted = precision * codes[:, :half]
    if len(codes) > len(groups):
        starts = _starts(*map(len, groups))
        precision, weighted = np.add.reduceat(precision, starts), np.add.reduceat(weighted, starts)
    precision += 1.0
    result = np.empty((len(groups), 2 * half), np.float32)
    np.divide(weighted, precision, out=result[:, :half])
    np.reciprocal(precision, out=result[:, half:])
    return result
