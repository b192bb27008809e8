"""All that a trained CNMP is, as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Weights (inputs, outputs) and biases (outputs,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CnmpModel:
    """All that a trained CNMP is.

    Attributes:
        preset: Which preset trained it.
        encoder: From time features and a normalised position to a code (C,).
        aggregation: Of several codes, "mean" or "bayesian"; see `aggregate`.
        decoder: From the code, then time features, to mean and raw spread (4,), normalised.
        harmonics: Fourier features of time.
        grid: Shape (N,), in [s].
        reference: Shape (N, 2), what positions are counted from, in [m].
        scale: What they are counted in, in [m].
        sigma_floor: Least standard deviation, in [m].
        sigma_scale: A factor on all standard deviations, found on held-out data; 1 is as trained.
        demonstrations: Shape (m, N, 2), in [m].
        weights: Shape (m,), how likely each was drawn.
        doubt_reach, doubt_gain: Of `Doubt`, in [m] and [m^2/m^2].
        confidence_gain: K of eq. (1), in [1/m^2].
        metadata: Whatever else its file says.
    """

    preset: str
    encoder: Sequence[Layer]
    aggregation: str
    decoder: Sequence[Layer]
    harmonics: int
    grid: NDArray[np.float64]
    reference: NDArray[np.float64]
    scale: float
    sigma_floor: float
    demonstrations: NDArray[np.float64]
    weights: NDArray[np.float64]
    doubt_reach: float
    doubt_gain: float
    confidence_gain: float
    metadata: Mapping[str, Any]
    sigma_scale: float = 1.0
