"""The gain K of the confidence, found from what the learner says along the demonstrations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.base import Learner, mean_variance
from drake_shared.learners.dataset import resample

LEAST_CONFIDENCE = 0.05
PERCENTILE = 95.0
MOST_CONDITIONS = 3_000


def calibrate(learner: Learner, demonstrations: Demonstrations, *, resolution: float = 0.0) -> float:
    """K of eq. (1) of Amirshirzad et al. 2022, "such that c_f is close to 0 when sigma reaches its maximum".

    Close to 0 is 0.05, and the maximum is the 95th percentile of the mean variance met when the learner is
    shown one point of one demonstration at a time: the very largest varies twofold with the seed.

    Args:
        learner: Its own K plays no part.
        demonstrations: What to show.
        resolution: Standard deviation in [m] that leaves no doubt, whatever the demonstrations: K is at most
            1/resolution^2. Without it one demonstration, which leaves nothing to doubt, would have a
            confidence of 0.05 everywhere.

    Returns:
        K, in [1/m^2].
    """
    paths = [resample(item, learner.grid) for item in demonstrations]
    variances = variances_along(learner, paths)
    gain = 1.0 / (LEAST_CONFIDENCE * float(np.percentile(variances, PERCENTILE)))
    return min(gain, 1.0 / resolution**2) if resolution > 0.0 else gain


def variances_along(learner: Learner, paths: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Mean variance of eq. (1), in [m^2], for each point of each path (N, 2) on the learner's grid.

    Where there are more than 3,000 points, about as many of them, evenly.
    """
    steps = len(learner.grid)
    every = max(1, len(paths) * steps // MOST_CONDITIONS)
    variances = []
    for point in range(0, len(paths) * steps, every):
        path, step = divmod(point, steps)
        time = learner.grid[step]
        queries = learner.grid[min(step + 1, steps - 1) :]
        _, variance = learner.predict([time], paths[path][step : step + 1], queries)
        variances.append(mean_variance(queries, variance, time))
    return np.array(variances)
