"""What a user would otherwise learn routes with: a ProMP and a Gaussian process."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Predict = Callable[[int, NDArray[np.float64]], NDArray[np.float64]]
"""Takes the step of an observation and its position (2,), gives the expected positions (N, 2), in [m]."""


def fit_promp(positions: NDArray[np.float64], *, noise: float, weights: int = 25) -> Predict:
    """A ProMP (``movement_primitives`` on PyPI) that knows how noisy observations are.

    Args:
        positions: Demonstrations on one grid, shape (m, N, 2), in [m].
        noise: Standard deviation of an observed position, in [m].
        weights: Basis functions for each of x and y.
    """
    from movement_primitives.promp import ProMP

    count, steps = positions.shape[:2]
    times = np.linspace(0.0, 1.0, steps)
    promp: Any = ProMP(n_dims=2, n_weights_per_dim=weights)
    promp.imitate(np.repeat(times[None], count, axis=0), positions)
    covariance = noise**2 * np.eye(2)

    def predict(step: int, position: NDArray[np.float64]) -> NDArray[np.float64]:
        conditioned = promp.condition_position(position, covariance, t=times[step], t_max=1.0)
        return conditioned.mean_trajectory(times)

    return predict


def fit_gaussian_process(positions: NDArray[np.float64], *, noise: float, points: int, seed: int) -> Predict:
    """A Gaussian process (scikit-learn): from an observation's time and place, and a query time, to a place.

    Its cost grows with the cube of the number of points, so only some of all pairs of times are shown to it,
    the observed place moved by noise.

    Args:
        positions: Demonstrations on one grid, shape (m, N, 2), in [m].
        noise: Standard deviation of an observed position, in [m].
        points: How many pairs of times it is shown.
        seed: Decides which.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    count, steps = positions.shape[:2]
    times = np.linspace(0.0, 1.0, steps)
    extent = float(np.ptp(positions.reshape(-1, 2), axis=0).max())
    random = np.random.default_rng(seed)
    which = random.integers(count, size=points)
    seen, asked = random.integers(steps, size=(2, points))
    observed = positions[which, seen] + noise * random.standard_normal((points, 2))
    lengths = [0.15, 0.2 * extent, 0.2 * extent, 0.15]
    bounds = [(0.05, 10.0), (0.05 * extent, 10.0 * extent), (0.05 * extent, 10.0 * extent), (0.05, 10.0)]
    kernel = ConstantKernel(1.0) * RBF(lengths, bounds) + WhiteKernel(1e-2)
    process = GaussianProcessRegressor(kernel, normalize_y=True)
    with warnings.catch_warnings():
        # That a length is at its bound says that this input does not matter.
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit(np.column_stack([times[seen], observed, times[asked]]), positions[which, asked])

    def predict(step: int, position: NDArray[np.float64]) -> NDArray[np.float64]:
        shown = np.tile([times[step], *position], (steps, 1))
        return process.predict(np.column_stack([shown, times]))

    return predict
