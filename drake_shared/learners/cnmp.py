"""The conditional neural movement primitive as a predictor, in numpy alone."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.arithmetic import aggregate, softplus
from drake_shared.learners.cnmp_file import cnmp_from_file, cnmp_to_file
from drake_shared.learners.cnmp_model import CnmpModel
from drake_shared.learners.doubt import Doubt
from drake_shared.learners.features import time_features


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
        # One observation is looked up faster in a list than in an array.
        self._way = model.reference.tolist()
        self._steps_per_second = (len(model.grid) - 1) / self.duration
        code_size = model.encoder[-1][0].shape[1]
        first, bias = model.decoder[0]
        self._code_weights = np.ascontiguousarray(first[:code_size])
        self._time_weights = np.ascontiguousarray(first[code_size:])
        self._time_bias = bias
        self._layers = [(np.ascontiguousarray(weights.T), bias) for weights, bias in model.decoder[1:]]
        self._on_grid = {0: self._prepare(self.grid)}
        self._prior = self._moments()

    @classmethod
    def train(cls, demonstrations: Demonstrations, **options: Any) -> CnmpLearner:
        """Trains one; see `drake_shared.learners.training.train` for the options. Imports torch."""
        # To import torch takes seconds, which count.
        begun = perf_counter()
        from drake_shared.learners.training import train

        return train(demonstrations, begun=begun, **options)

    def to_file(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Tensors and description for `save_learner`."""
        return cnmp_to_file(self.model)

    @classmethod
    def from_file(
        cls, path: Any, tensors: Mapping[str, NDArray[Any]], description: Mapping[str, Any]
    ) -> CnmpLearner:
        """The learner of a file, for `load_learner`.

        Raises:
            InputError: Something in it does not fit.
        """
        return cls(cnmp_from_file(path, tensors, description))

    def scaled(self, factor: float) -> CnmpLearner:
        """The same with all standard deviations times ``factor``."""
        scale = self.model.sigma_scale * factor
        return CnmpLearner(dataclasses.replace(self.model, sigma_scale=scale, metadata=self.metadata))

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
        start = len(self.grid) - len(queries)
        on_grid = start >= 0 and bool((queries == self.grid[start:]).all())
        if not len(observed_times):
            mean, variance = self._prior
            if on_grid:
                return mean[start:].copy(), variance[start:].copy()
            return self._interpolate(mean, queries), self._interpolate(variance, queries)
        prepared = self._later(start) if on_grid else self._prepare(queries)
        code = self._encode(observed_times.tolist(), observed.tolist())
        raw = self._decode(code, prepared)
        model = self.model
        mean = raw[:2] * np.float32(model.scale) + prepared.way
        sigma = softplus(raw[2:])
        sigma *= model.scale * model.sigma_scale
        sigma += model.sigma_floor * model.sigma_scale
        sigma *= sigma
        variance = sigma.T.astype(np.float64, order="C")
        doubt = self._doubt(observed_times, observed)
        if doubt:
            variance += doubt
        return mean.T.copy(), variance

    def _encode(self, times: list[float], positions: list[list[float]]) -> NDArray[np.float32]:
        """The code (C,) of the observations together."""
        hidden = np.array(
            [self._seen(time, x, y) for time, (x, y) in zip(times, positions, strict=True)], np.float32
        )
        *inner, (weights, bias) = self.model.encoder
        for inner_weights, inner_bias in inner:
            hidden = hidden @ inner_weights
            hidden += inner_bias
            np.maximum(hidden, 0.0, out=hidden)
        hidden = hidden @ weights
        hidden += bias
        return aggregate(hidden, self.model.aggregation)

    def _seen(self, time: float, x: float, y: float) -> list[float]:
        """What the encoder is told of one observation: time, as `time_features` has it, and where it is."""
        time = min(max(time, 0.0), self.duration) if time == time else math.nan
        angle = math.pi * time / self.duration
        ways = range(1, self.model.harmonics + 1)
        step = time * self._steps_per_second
        index = min(int(step), len(self._way) - 2) if step == step else 0
        share = step - index
        (x0, y0), (x1, y1) = self._way[index], self._way[index + 1]
        return [
            time / self.duration,
            *[math.sin(k * angle) for k in ways],
            *[math.cos(k * angle) for k in ways],
            (x - x0 - share * (x1 - x0)) / self.model.scale,
            (y - y0 - share * (y1 - y0)) / self.model.scale,
        ]

    def _decode(self, code: NDArray[np.float32], prepared: _Queries) -> NDArray[np.float32]:
        """Mean and raw spread, normalised, shape (4, Q); fresh.

        max(h + b, 0) is max(h, -b) + b, and the weights of the next layer make a number of the second part
        that is the same for all queries. So a layer is one product and one maximum.
        """
        shift = code @ self._code_weights
        hidden = np.maximum(prepared.hidden, -shift[:, None], out=prepared.buffers[0])
        for (weights, bias), buffer in zip(self._layers, prepared.buffers[1:], strict=False):
            shift = weights @ shift
            shift += bias
            hidden = np.matmul(weights, hidden, out=buffer)
            np.maximum(hidden, -shift[:, None], out=hidden)
        weights, bias = self._layers[-1]
        shift = weights @ shift
        shift += bias
        raw = weights @ hidden
        raw += shift[:, None]
        return raw

    def _later(self, start: int) -> _Queries:
        """The queries of the grid from ``start`` on."""
        prepared = self._on_grid.get(start)
        if prepared is None:
            prepared = self._on_grid[start] = self._on_grid[0].later(start)
        return prepared

    def _prepare(self, queries: NDArray[np.float64]) -> _Queries:
        """What does not depend on the observations."""
        features = time_features(queries, self.duration, self.model.harmonics).astype(np.float32)
        widths = [bias.size for _, bias in self.model.decoder[:-1]]
        return _Queries(
            hidden=np.ascontiguousarray((features @ self._time_weights + self._time_bias).T),
            way=np.ascontiguousarray(self._interpolate(self.model.reference, queries).T),
            buffers=[np.empty((width, len(queries)), np.float32) for width in widths],
        )

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


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class _Queries:
    """Queries, with what of a prediction depends on them alone, and room to work in.

    Attributes:
        hidden: Shape (H, Q), the time part of the decoder's first layer. Queries come last: BLAS multiplies a
            few rows by many columns five times faster than many rows by a few columns.
        way: Shape (2, Q), what the mean is counted from, in [m].
        buffers: Shapes (H, Q) of each hidden layer of the decoder.
    """

    hidden: NDArray[np.float32]
    way: NDArray[np.float64]
    buffers: list[NDArray[np.float32]]

    def later(self, start: int) -> _Queries:
        """The queries from ``start`` on."""
        return _Queries(
            hidden=self.hidden[:, start:],
            way=self.way[:, start:],
            buffers=[buffer[:, start:] for buffer in self.buffers],
        )


def _read_only(values: NDArray[np.float64]) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
