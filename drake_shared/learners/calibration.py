"""The gain K of the confidence, found from the variance along the demonstrations."""

from __future__ import annotations

import math
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.base import Learner, mean_variance
from drake_shared.learners.dataset import resample

LEAST_CONFIDENCE = 0.05
PERCENTILE = 95.0
MAX_CONDITIONS = 3_000

Calibration = Literal["percentile", "largest"]
CALIBRATIONS: tuple[Calibration, ...] = get_args(Calibration)


def calibrate(
    learner: Learner,
    demonstrations: Demonstrations,
    *,
    resolution: float = 0.0,
    calibration: Calibration = "percentile",
) -> float:
    """K of eq. (1) of Amirshirzad et al. 2022, "such that c_f is close to 0 when sigma reaches its maximum".

    Close to 0 is 0.05. The learner predicts from one point of one demonstration at a time, and the maximum is
    that of the mean variance of eq. (1), or its 95th percentile: the maximum itself varies twofold with the
    seed.

    Args:
        learner: Its own K has no effect.
        demonstrations: To observe.
        resolution: Standard deviation in [m] that is negligible, whatever the demonstrations: K is at most
            1/resolution^2. Without it a single demonstration, which leaves no uncertainty, would have a
            confidence of 0.05 everywhere.
        calibration: "percentile", or "largest", the maximum itself, as in the paper.

    Returns:
        K, in [1/m^2].

    Raises:
        InputError: The variance is not positive and finite.
    """
    paths = [resample(item, learner.grid) for item in demonstrations]
    percentile = 100.0 if calibration == "largest" else PERCENTILE
    largest = float(np.percentile(variances_along(learner, paths), percentile))
    if not (math.isfinite(largest) and largest > 0.0):
        source = f"learner {getattr(learner, 'name', type(learner).__name__)!r}"
        raise InputError(source, "variance", "must be positive and finite along demonstrations", largest)
    gain = 1.0 / (LEAST_CONFIDENCE * largest)
    return min(gain, 1.0 / resolution**2) if resolution > 0.0 else gain


def variances_along(learner: Learner, paths: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Mean variance of eq. (1), in [m^2], for each point of each path (N, D) on the learner's grid.

    Of more than 3,000 points about as many, evenly spaced.
    """
    steps = len(learner.grid)
    every = max(1, len(paths) * steps // MAX_CONDITIONS)
    variances = []
    for point in range(0, len(paths) * steps, every):
        path, step = divmod(point, steps)
        queries = learner.grid[min(step + 1, steps - 1) :]
        _, variance = learner.predict(learner.grid[step : step + 1], paths[path][step : step + 1], queries)
        variances.append(mean_variance(queries, variance, learner.grid[step]))
    return np.array(variances)
