"""The conditional neural movement primitive as a predictor, in numpy alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.learners.doubt import Doubt
from drake_shared.learners.features import time_features

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


class CnmpLearner:
    """Predicts trajectories as the CNMP of sec. III.A of Amirshirzad et al. 2022 does. A `Learner`.

    Each observation is encoded, the codes are averaged, and the decoder turns the average and a query time
    into a mean and a standard deviation. Without observations the prediction is the demonstrations' own
    weighted mean and variance.

    What does not depend on the observations is computed once: for queries on the grid, or its later part, the
    decoder's first layer only adds the code's part to the time's. Not for several threads at once.

    Args:
        model: The trained network and what goes with it.
    """

    name = "cnmp"

    def __init__(self, model: CnmpModel) -> None:
        self.model = model
        self.preset = model.preset
        self.confidence_gain = model.confidence_gain
        self.duration = float(model.grid[-1])
        self.grid = _read_only(model.grid)
        self.demonstrations: NDArray[np.float64] | None = _read_only(model.demonstrations)
        self.metadata = dict(model.metadata)
        self._doubt = Doubt(
            grid=self.grid,
            demonstrations=self.demonstrations,
            reach=model.doubt_reach,
            gain=model.doubt_gain,
        )
        self._reference = _read_only(model.reference)
        code_size = model.encoder[-1][0].shape[1]
        first, bias = model.decoder[0]
        self._code_weights = np.ascontiguousarray(first[:code_size])
        self._time_weights = np.ascontiguousarray(first[code_size:])
        self._time_bias = bias
        self._grid_hidden = self._time_part(self.grid)
        self._buffers = [np.empty((len(self.grid), b.size), np.float32) for _, b in model.decoder]
        self._prior = self._moments()

    def predict(
        self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean (Q, 2) in [m] and variance (Q, 2) in [m^2] at ``query_times`` (Q,); see `Learner.predict`."""
        observed_times = np.asarray(times, dtype=float)
        observed = np.asarray(positions, dtype=float)
        queries = np.asarray(query_times, dtype=float)
        if observed_times.ndim != 1 or observed.shape != (len(observed_times), 2) or queries.ndim != 1:
            shapes = f"{observed_times.shape}, {observed.shape} and {queries.shape}"
            raise ValueError(f"predict needs shapes (n,), (n, 2) and (Q,), got {shapes}")
        on_grid = len(queries) <= len(self.grid) and np.array_equal(
            queries, self.grid[len(self.grid) - len(queries) :]
        )
        if not len(observed_times):
            mean, variance = self._prior
            if on_grid:
                start = len(self.grid) - len(queries)
                return mean[start:].copy(), variance[start:].copy()
            return self._interpolate(mean, queries), self._interpolate(variance, queries)
        code = self._encode(observed_times, observed)
        if on_grid:
            start = len(self.grid) - len(queries)
            hidden, reference = self._grid_hidden[start:], self._reference[start:]
            buffers = [buffer[start:] for buffer in self._buffers]
        else:
            hidden, reference = self._time_part(queries), self._interpolate(self._reference, queries)
            buffers = [np.empty((len(queries), b.size), np.float32) for _, b in self.model.decoder]
        raw = self._decode(code, hidden, buffers)
        mean = raw[:, :2] * self.model.scale + reference
        # log(1 + exp(s)) is the softplus of torch.
        sigma = np.logaddexp(raw[:, 2:], np.float32(0.0)) * self.model.scale + self.model.sigma_floor
        variance = sigma * sigma
        variance += self._doubt(observed_times, observed)
        return mean, variance

    def _encode(self, times: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float32]:
        features = time_features(times, self.duration, self.model.harmonics)
        offsets = (positions - self._interpolate(self._reference, times)) / self.model.scale
        hidden = np.concatenate([features, offsets], axis=1).astype(np.float32)
        *inner, (weights, bias) = self.model.encoder
        for inner_weights, inner_bias in inner:
            hidden = hidden @ inner_weights
            hidden += inner_bias
            np.maximum(hidden, 0.0, out=hidden)
        hidden = hidden @ weights
        hidden += bias
        return aggregate(hidden, self.model.aggregation)

    def _decode(
        self, code: NDArray[np.float32], hidden: NDArray[np.float32], buffers: list[NDArray[np.float32]]
    ) -> NDArray[np.float64]:
        np.add(hidden, code @ self._code_weights, out=buffers[0])
        for index, (weights, bias) in enumerate(self.model.decoder[1:], start=1):
            np.maximum(buffers[index - 1], 0.0, out=buffers[index - 1])
            np.matmul(buffers[index - 1], weights, out=buffers[index])
            buffers[index] += bias
        return buffers[-1].astype(np.float64)

    def _time_part(self, times: NDArray[np.float64]) -> NDArray[np.float32]:
        features = time_features(times, self.duration, self.model.harmonics).astype(np.float32)
        return features @ self._time_weights + self._time_bias

    def _interpolate(self, path: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
        """``path`` (N, 2) of the grid at ``times`` (n,), held beyond its ends."""
        return np.stack([np.interp(times, self.grid, path[:, axis]) for axis in (0, 1)], axis=-1)

    def _moments(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean and variance (N, 2) of the demonstrations themselves."""
        weights = self.model.weights[:, None, None]
        mean = (weights * self.model.demonstrations).sum(axis=0)
        # What a driver may want is not what is desirable: the spread is that of all demonstrations alike.
        variance = np.square(self.model.demonstrations - mean).mean(axis=0)
        return mean, variance + self.model.sigma_floor**2


def aggregate(codes: NDArray[np.float32], aggregation: str) -> NDArray[np.float32]:
    """One code (C,) for all observations, from theirs (n, C).

    It is their mean, or the posterior of a latent variable; see `drake_shared.learners.network.aggregate`.
    """
    if aggregation == "mean":
        return codes.mean(axis=0)
    half = codes.shape[1] // 2
    precision = np.logaddexp(codes[:, half:], np.float32(0.0))
    variance = 1.0 / (1.0 + precision.sum(axis=0))
    return np.concatenate([variance * (precision * codes[:, :half]).sum(axis=0), variance])


def _read_only(values: NDArray[np.float64]) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
