"""What the network is told of time."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def time_features(times: ArrayLike, duration: float, harmonics: int) -> NDArray[np.float64]:
    """t/T, and sin and cos of k pi t/T for k = 1..harmonics.

    A plain network is slow to learn what changes quickly; Fourier features make it sharp within seconds.

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
