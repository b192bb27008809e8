"""The conditional neural movement primitive as a predictor, in numpy alone."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.arrays import path_at, read_only
from drake_shared.learners.base import check_query
from drake_shared.learners.cnmp.file import cnmp_from_file, cnmp_to_file
from drake_shared.learners.cnmp.model import CnmpModel
from drake_shared.learners.cnmp.time_features import time_features
from drake_shared.learners.layers import aggregate_each, softplus
from drake_shared.learners.ood_variance import Doubt


class CnmpLearner:
    """Predicts trajectories as the CNMP of sec. III.A of Amirshirzad et al. 2022 does. A `Learner`.

    Each observation is encoded, the codes are averaged, and the decoder turns the average and a query time
    into a mean and a standard deviation. Without observations the prediction is the demonstrations' own
    weighted mean and variance.

    What does not depend on the observations is computed once: for queries on the grid, or its later part, the
    decoder's first layer only adds the code's part to the time's.

    Args:
        model: The trained network and what goes with it.
    """

    name = "cnmp"

    def __init__(self, model: CnmpModel) -> None:
        self.model = model
        self.preset = model.preset
        self.confidence_gain = model.confidence_gain
        self.duration = float(model.grid[-1])
        self.grid = read_only(model.grid)
        self.demonstrations: NDArray[np.float64] | None = read_only(model.demonstrations)
        self.metadata = dict(model.metadata)
        self._doubt = Doubt(
            grid=self.grid,
            demonstrations=self.demonstrations,
            reach=model.doubt_reach,
            gain=model.doubt_gain,
        )
        # Numbers and biases as arrays of the type and dimensions of what they meet: numpy takes them soonest.
        self._scale = np.array(model.scale, np.float32)
        self._sigma_factor = np.array(model.scale * model.sigma_scale, np.float32)
        self._sigma_offset = np.array(model.sigma_floor * model.sigma_scale, np.float32)
        self._encoder = [(weights, bias[None]) for weights, bias in model.encoder]
        # One observation is looked up faster in a list than in an array.
        self._way = model.reference.tolist()
        self._harmonics = range(1, model.harmonics + 1)
        self._steps_per_second = (len(model.grid) - 1) / self.duration
        code_size = model.encoder[-1][0].shape[1]
        first, bias = model.decoder[0]
        self._code_weights = np.ascontiguousarray(first[:code_size])
        self._time_weights = np.ascontiguousarray(first[code_size:])
        self._time_bias = bias
        self._layers = [
            (np.ascontiguousarray(weights.T), bias[None, :, None]) for weights, bias in model.decoder[1:]
        ]
        self._on_grid = {0: self._prepare(self.grid)}
        self._prior = self._moments()

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
        seen_times, seen, queries = check_query(times, positions, query_times)
        if not len(seen_times):
            mean, variance = self._prior
            return path_at(mean, self.grid, queries), path_at(variance, self.grid, queries)
        (answer,) = self._answers(seen_times, seen, queries, [len(seen_times)])
        return answer

    def predict_prefixes(
        self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """What `predict` says of the first observation, of the first two, and so on to all, to the bit.

        Much of a prediction's time is that of calling numpy, which is called as often for several as for one.
        """
        seen_times, seen, queries = check_query(times, positions, query_times)
        return self._answers(seen_times, seen, queries, range(1, len(seen_times) + 1))

    def _answers(
        self,
        times: NDArray[np.float64],
        positions: NDArray[np.float64],
        queries: NDArray[np.float64],
        counts: Sequence[int],
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Mean and variance (Q, 2) each after as many of the observations as ``counts`` says."""
        if not counts:
            return []
        prepared = self._prepared(queries)
        seen = np.array(
            [self._seen(time, x, y) for time, (x, y) in zip(times.tolist(), positions.tolist(), strict=True)],
            np.float32,
        )
        encoded = [self._encode(seen[:count]) for count in counts]
        raw = self._decode(aggregate_each(encoded, self.model.aggregation), prepared)
        mean = raw[:, :2] * self._scale + prepared.way
        sigma = softplus(raw[:, 2:])
        sigma *= self._sigma_factor
        sigma += self._sigma_offset
        sigma *= sigma
        doubts = self._doubt.prefixes(times, positions)
        answers = []
        for index, count in enumerate(counts):
            variance = sigma[index].T.astype(np.float64, order="C")
            variance += doubts[count - 1]
            answers.append((mean[index].T.copy(), variance))
        return answers

    def _encode(self, seen: NDArray[np.float32]) -> NDArray[np.float32]:
        """The codes (n, C) of observations (n, F + 2)."""
        hidden = seen
        *inner, (weights, bias) = self._encoder
        for inner_weights, inner_bias in inner:
            hidden = hidden @ inner_weights
            hidden += inner_bias
            np.maximum(hidden, 0.0, out=hidden)
        hidden = hidden @ weights
        hidden += bias
        return hidden

    def _seen(self, time: float, x: float, y: float) -> list[float]:
        """What the encoder is told of one observation: time, as `time_features` has it, and where it is."""
        duration, scale = self.duration, self.model.scale
        time = min(max(time, 0.0), duration) if time == time else math.nan
        angle = math.pi * time / duration
        step = time * self._steps_per_second
        index = min(int(step), len(self._way) - 2) if step == step else 0
        share = step - index
        (x0, y0), (x1, y1) = self._way[index], self._way[index + 1]
        return [
            time / duration,
            *[math.sin(k * angle) for k in self._harmonics],
            *[math.cos(k * angle) for k in self._harmonics],
            (x - x0 - share * (x1 - x0)) / scale,
            (y - y0 - share * (y1 - y0)) / scale,
        ]

    def _decode(self, codes: NDArray[np.float32], prepared: _Queries) -> NDArray[np.float32]:
        """Mean and raw spread, normalised, after each of the codes (n, C): shape (n, 4, Q); fresh.

        max(h + b, 0) is max(h, -b) + b, and the weights of the next layer make a number of the second part
        that is the same for all queries. So a layer is one product and one maximum.
        """
        shift = (codes[:, None, :] @ self._code_weights).reshape(len(codes), -1, 1)
        hidden = np.maximum(prepared.hidden, -shift)
        *inner, (last_weights, last_bias) = self._layers
        for weights, bias in inner:
            shift = weights @ shift
            shift += bias
            hidden = weights @ hidden
            np.maximum(hidden, -shift, out=hidden)
        shift = last_weights @ shift
        shift += last_bias
        raw = last_weights @ hidden
        raw += shift
        return raw

    def _prepared(self, queries: NDArray[np.float64]) -> _Queries:
        """What of a prediction depends on the queries alone; kept for those that are the rest of the grid."""
        start = len(self.grid) - len(queries)
        if start < 0 or not (queries == self.grid[start:]).all():
            return self._prepare(queries)
        prepared = self._on_grid.get(start)
        if prepared is None:
            prepared = self._on_grid[start] = self._on_grid[0].later(start)
        return prepared

    def _prepare(self, queries: NDArray[np.float64]) -> _Queries:
        features = time_features(queries, self.duration, self.model.harmonics).astype(np.float32)
        return _Queries(
            hidden=np.ascontiguousarray((features @ self._time_weights + self._time_bias).T),
            way=np.ascontiguousarray(path_at(self.model.reference, self.grid, queries).T),
        )

    def _moments(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean and variance (N, 2) of the demonstrations themselves."""
        weights = self.model.weights[:, None, None]
        mean = (weights * self.model.demonstrations).sum(axis=0)
        # What a driver may want is not what is desirable: the spread is that of all demonstrations alike.
        variance = np.square(self.model.demonstrations - mean).mean(axis=0)
        return mean, variance + self.model.sigma_floor**2


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class _Queries:
    """What of a prediction depends on the queries alone.

    Attributes:
        hidden: Shape (H, Q), the time part of the decoder's first layer. Queries come last: BLAS multiplies a
            few rows by many columns five times faster than many rows by a few columns.
        way: Shape (2, Q), what the mean is counted from, in [m].
    """

    hidden: NDArray[np.float32]
    way: NDArray[np.float64]

    def later(self, start: int) -> _Queries:
        """The queries from ``start`` on."""
        # In one piece: numpy works at half the speed on rows that lie apart.
        return _Queries(
            hidden=np.ascontiguousarray(self.hidden[:, start:]), way=np.ascontiguousarray(self.way[:, start:])
        )
