"""Data augmentation: new demonstrations from those of one route."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

HARMONICS = 6


def make_neighborhoods(
    positions: NDArray[np.float64], *, reach: float, widening: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights of each demonstration's neighbours, from which new demonstrations are sampled.

    A few demonstrations of a route represent poorly how it may be driven, and a network memorizes them. So
    training samples from a normal density about each demonstration's neighbours instead: with weights p (m,),
    each demonstration's deviation from their mean, times sqrt(p) and an independent normal number, is added
    to their mean. The weight of a neighbour falls with the square of its largest distance over ``reach``, so
    that two routes do not mix and a lone demonstration stays as it is.

    Args:
        positions: Shape (m, N, D), in [m].
        reach: In [m], positive.
        widening: A factor on the deviations.

    Returns:
        Weights, shape (m, m), each row summing to 1; and the factor on the deviations from each row's mean,
        shape (m,), which includes the correction for few samples.
    """
    weights = np.empty((len(positions), len(positions)))
    for index, path in enumerate(positions):
        farthest = np.square(positions - path).sum(axis=-1).max(axis=-1)
        weights[index] = np.exp(-0.5 * farthest / reach**2)
    weights /= weights.sum(axis=1, keepdims=True)
    # Effective number of neighbours, itself included; n / (n - 1) makes a variance of few unbiased.
    count = 1.0 / np.square(weights).sum(axis=1)
    unbiased = np.where(count > 1.5, count / np.maximum(count - 1.0, 0.5), 1.0)
    return weights, widening * np.sqrt(unbiased)


def unexplained(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """The standard deviation of a route that its demonstrations leave unknown, relative to the whole.

    Of n demonstrations of a route a share of 1/n of the variance is left.

    Args:
        weights: Shape (m, m), of `make_neighborhoods`.

    Returns:
        Shape (m,).
    """
    relative: NDArray[np.float64] = np.sqrt(np.square(weights).sum(axis=1))
    return relative


def low_frequency_basis(steps: int) -> NDArray[np.float64]:
    """Sines whose sum with standard normal factors is low-frequency noise, shape (6, N).

    Its variance is 1 on average over time, falls with frequency, and is 0 at both ends, where all paths of a
    task meet.

    Args:
        steps: N, of the path.
    """
    order = np.arange(1, HARMONICS + 1)
    strength = 1.0 / order
    waves = np.sin(np.pi * order[:, None] * np.linspace(0.0, 1.0, steps))
    basis: NDArray[np.float64] = waves * (strength / np.sqrt(0.5 * np.square(strength).sum()))[:, None]
    return basis
