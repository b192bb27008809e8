"""What torch's network computes between its matrix products, in numpy float32."""

from __future__ import annotations

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

    It is their mean, or the posterior of a latent variable; see `drake_shared.learners.network.aggregate`.
    """
    if aggregation == "mean":
        return codes.sum(axis=0) / len(codes)
    half = codes.shape[1] // 2
    precision = softplus(codes[:, half:])
    said = precision * codes[:, :half]
    if len(codes) > 1:
        precision, said = precision.sum(axis=0, keepdims=True), said.sum(axis=0, keepdims=True)
    precision += 1.0
    return np.concatenate([said[0] / precision[0], 1.0 / precision[0]])
