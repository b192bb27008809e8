"""New demonstrations from among those that go the same way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WANDERING_HARMONICS = 6


def make_blend(
    positions: NDArray[np.float64], *, reach: float, widening: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Which demonstrations go the way of which, so that new ones can be drawn.

    A few demonstrations of a way are a poor picture of how it may be driven, and a network learns them by
    heart. So training draws from a normal density about each demonstration's neighbours instead: with shares
    p (m,), each demonstration's deviation from their mean, times sqrt(p) and an independent normal number, is
    added to their mean. The farther apart two demonstrations ever are the less they share, by the square of
    that distance over ``reach``: two routes share nothing, and a lone demonstration stays as it is.

    Args:
        positions: Shape (m, N, 2), in [m].
        reach: In [m], positive.
        widening: A factor on the deviations.

    Returns:
        Shares, shape (m, m), each row summing to 1; and the factor on the deviations from each row's mean,
        shape (m,), which makes up for there being few, too.
    """
    shares = np.empty((len(positions), len(positions)))
    for index, path in enumerate(positions):
        farthest = np.square(positions - path).sum(axis=-1).max(axis=-1)
        shares[index] = np.exp(-0.5 * farthest / reach**2)
    shares /= shares.sum(axis=1, keepdims=True)
    # Effective number of neighbours, itself included; n / (n - 1) makes a variance of few unbiased.
    count = 1.0 / np.square(shares).sum(axis=1)
    unbiased = np.where(count > 1.5, count / np.maximum(count - 1.0, 0.5), 1.0)
    return shares, widening * np.sqrt(unbiased)


def left_unknown(shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much of how a way may be driven its demonstrations leave open, as a standard deviation, shape (m,).

    Of n demonstrations of a way a share of 1/n of the variance is left.

    Args:
        shares: Shape (m, m), of `make_blend`.
    """
    return np.sqrt(np.square(shares).sum(axis=1))


def wander_basis(steps: int) -> NDArray[np.float64]:
    """Smooth ways to stray from a path, shape (6, N).

    Their sum with normal factors has a variance of 1, on average over time. They are 0 at both ends, where
    all drives of a task meet, and the slow ones are the strong ones.

    Args:
        steps: N, of the path.
    """
    order = np.arange(1, WANDERING_HARMONICS + 1)
    strength = 1.0 / order
    waves = np.sin(np.pi * order[:, None] * np.linspace(0.0, 1.0, steps))
    return waves * (strength / np.sqrt(0.5 * np.square(strength).sum()))[:, None]
