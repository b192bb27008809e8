"""What torch's network computes between its matrix products, in numpy float32."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray


def softplus(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """log(1 + exp(v)); fresh."""
    if values.size and values.item(values.argmax()) > 80.0:
        return np.logaddexp(values, np.float32(0.0))
    # As exact in float32, and twice as fast; but it would overflow.
    result = np.exp(values)
    return np.log1p(result, out=result)


def aggregate(codes: NDArray[np.float32], aggregation: str) -> NDArray[np.float32]:
    """One code (C,) for all observations, from theirs (n, C).

    It is their mean, or the posterior of a latent variable; see
    `drake_shared.learners.cnmp.network.aggregate`.
    """
    return aggregate_each([codes], aggregation)[0]


def aggregate_each(groups: Sequence[NDArray[np.float32]], aggregation: str) -> NDArray[np.float32]:
    """One code each (k, C) for k groups of observations, from theirs (n, C), n >= 1; see `aggregate`."""
    if aggregation == "mean":
        return np.array([group.sum(axis=0) / len(group) for group in groups])
    codes = np.concatenate(groups)
    half = codes.shape[1] // 2
    precision = softplus(codes[:, half:])
    said = precision * codes[:, :half]
    if len(codes) > len(groups):
        begins = np.array([0, *accumulate(len(group) for group in groups[:-1])])
        precision, said = np.add.reduceat(precision, begins), np.add.reduceat(said, begins)
    precision += 1.0
    result = np.empty((len(groups), 2 * half), np.float32)
    np.divide(said, precision, out=result[:, :half])
    np.reciprocal(precision, out=result[:, half:])
    return result
