"""The conditional neural movement primitive (CNMP) as a predictor, in numpy alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.arrays import path_at
from drake_shared.common.errors import InputError
from drake_shared.learners.base import Array, Prediction, check_query
from drake_shared.learners.cnmp.layers import aggregate_each, softplus, time_features
from drake_shared.learners.fields import Content, Layer, Layers, Tensors
from drake_shared.learners.stored import RegressionLearner

Floats = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CnmpLearner(RegressionLearner):
    """Predicts trajectories as the CNMP of sec. III.A of Amirshirzad et al. 2022 does. A `Learner`.

    Each observation is encoded, the codes are averaged, and the decoder maps the average and a query time to
    a mean and a standard deviation.

    Attributes:
        harmonics: Fourier features of time.
        aggregation: Of several codes, "mean" or "bayesian"; see `drake_shared.learners.cnmp.layers`.
        encoder: From time features and a normalized position to a code (C,).
        decoder: From the code, then time features, to mean and raw standard deviation (2D,), normalized.
        sigma_floor: In [m].
    """

    name: ClassVar[str] = "cnmp"
    harmonics: int
    aggregation: str
    encoder: Annotated[tuple[Layer, ...], Layers()]
    decoder: Annotated[tuple[Layer, ...], Layers()]

    def predict_prefixes(
        self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike
    ) -> list[Prediction]:
        """What `predict` returns for the first observation, the first two, and so on to all, bit for bit.

        Much of a prediction's time is the overhead of numpy calls, of which there are as many for one.
        """
        seen_times, seen, queries = check_query(times, positions, query_times, self.position_size)
        return self._predictor.predict(seen_times, seen, queries, range(1, len(seen_times) + 1))

    def to_file(self) -> tuple[Tensors, dict[str, Any]]:
        """See `StoredLearner`."""
        tensors, description = super().to_file()
        description["architecture"] = {
            "harmonics": self.harmonics,
            "aggregation": self.aggregation,
            "encoder": [int(bias.size) for _, bias in self.encoder],
            "decoder": [int(bias.size) for _, bias in self.decoder],
        }
        return tensors, description

    @classmethod
    def _read(cls, content: Content) -> dict[str, Any]:
        values = super()._read(content)
        given = content.description.get("architecture")
        architecture: dict[str, Any] = given if isinstance(given, dict) else {}
        harmonics, aggregation = architecture.get("harmonics"), architecture.get("aggregation")
        features = 1 + 2 * harmonics if isinstance(harmonics, int) else 0
        widths = {part: [int(bias.size) for _, bias in values[part]] for part in ("encoder", "decoder")}
        size, code = content.sizes["D"], widths["encoder"][-1]
        fits = (
            features > 0
            and (aggregation == "mean" or (aggregation == "bayesian" and code % 2 == 0))
            and all(architecture.get(part) == widths[part] for part in widths)
            and len(values["encoder"][0][0]) == features + size
            and len(values["decoder"][0][0]) == code + features
            and widths["decoder"][-1] == 2 * size
        )
        if not fits:
            expected = "must give harmonics, aggregation and widths that fit the tensors"
            raise InputError(content.path, "architecture", expected, given)
        return {**values, "harmonics": harmonics, "aggregation": aggregation}

    def _condition(self, times: Array, positions: Array, queries: Array) -> Prediction:
        (prediction,) = self._predictor.predict(times, positions, queries, [len(times)])
        return prediction

    @cached_property
    def _predictor(self) -> _Predictor:
        return _Predictor(self)


class _Queries(NamedTuple):
    """The part of a prediction that depends on the queries alone.

    Attributes:
        hidden: Shape (H, Q), the time's part of the decoder's first layer. Queries come last: BLAS multiplies
            a few rows by many columns five times faster than many rows by a few columns.
        reference: Shape (D, Q), in [m].
    """

    hidden: Floats
    reference: Array


class _Predictor:
    """Evaluates the network of a learner; what does not depend on observations is precomputed."""

    def __init__(self, learner: CnmpLearner) -> None:
        self._learner = learner
        self._grid, self._duration, self._size = learner.grid, learner.duration, learner.position_size
        self._ood_variance = learner._ood_variance
        # Arrays of the type and dimensions of their other operand are fastest.
        self._scale = np.array(learner.scale, np.float32)
        self._sigma_factor = np.array(learner.scale * learner.sigma_scale, np.float32)
        self._sigma_offset = np.array(learner.sigma_floor * learner.sigma_scale, np.float32)
        self._encoder = [(weights, bias[None]) for weights, bias in learner.encoder]
        # One time is looked up faster in a list than in an array.
        self._reference = learner.reference.tolist()
        self._harmonics = range(1, learner.harmonics + 1)
        self._steps_per_second = (len(learner.grid) - 1) / self._duration
        self._observed_on_grid = {time: self._observed_at(time) for time in learner.grid.tolist()}
        code_size = learner.encoder[-1][0].shape[1]
        first, self._time_bias = learner.decoder[0]
        self._code_weights = np.ascontiguousarray(first[:code_size])
        self._time_weights = np.ascontiguousarray(first[code_size:])
        self._layers = [
            (np.ascontiguousarray(weights.T), bias[None, :, None]) for weights, bias in learner.decoder[1:]
        ]
        self._on_grid = {0: self._prepare(self._grid)}
        self._compared: dict[int, Array] = {}

    def predict(
        self, times: Array, positions: Array, queries: Array, counts: Sequence[int]
    ) -> list[Prediction]:
        """Predicts from the first observations, as many of them as each of ``counts`` says."""
        if not counts:
            return []
        prepared = self._prepared(queries)
        observed = [
            self._observation(time, position)
            for time, position in zip(times.tolist(), positions.tolist(), strict=True)
        ]
        inputs = np.array(observed, np.float32)
        encoded = [self._encode(inputs[:count]) for count in counts]
        raw = self._decode(aggregate_each(encoded, self._learner.aggregation), prepared)
        mean = raw[:, : self._size] * self._scale + prepared.reference
        sigma = softplus(raw[:, self._size :])
        sigma *= self._sigma_factor
        sigma += self._sigma_offset
        sigma *= sigma
        added = self._ood_variance.prefixes(times, positions)
        predictions = []
        for index, count in enumerate(counts):
            variance = sigma[index].T.astype(np.float64, order="C")
            variance += added[count - 1]
            predictions.append((mean[index].T.copy(), variance))
        return predictions

    def _observation(self, time: float, position: list[float]) -> list[float]:
        """The encoder's input: time as `time_features` has it, and the normalized position."""
        # A clock of progress shows times of the grid alone.
        known = self._observed_on_grid.get(time)
        features, before, beyond = self._observed_at(time) if known is None else known
        scale = self._learner.scale
        offsets = [(x - x0 - dx) / scale for x, x0, dx in zip(position, before, beyond, strict=True)]
        return features + offsets

    def _observed_at(self, time: float) -> tuple[list[float], list[float], list[float]]:
        """Features of a time, the reference's position at a step of the grid, and how far it moves on."""
        duration = self._duration
        time = math.nan if math.isnan(time) else min(max(time, 0.0), duration)
        angle = math.pi * time / duration
        step = time * self._steps_per_second
        index = 0 if math.isnan(step) else min(int(step), len(self._reference) - 2)
        before, after = self._reference[index], self._reference[index + 1]
        features = [
            time / duration,
            *[math.sin(k * angle) for k in self._harmonics],
            *[math.cos(k * angle) for k in self._harmonics],
        ]
        return features, before, [(step - index) * (x1 - x0) for x0, x1 in zip(before, after, strict=True)]

    def _encode(self, inputs: Floats) -> Floats:
        """The codes (n, C) of observations (n, F + D)."""
        hidden = inputs
        *inner, (weights, bias) = self._encoder
        for inner_weights, inner_bias in inner:
            hidden = hidden @ inner_weights
            hidden += inner_bias
            np.maximum(hidden, 0.0, out=hidden)
        hidden = hidden @ weights
        hidden += bias
        return hidden

    def _decode(self, codes: Floats, prepared: _Queries) -> Floats:
        """Mean and raw standard deviation, normalized, from codes (n, C): a new array (n, 2D, Q).

        max(h + b, 0) is max(h, -b) + b, and the next layer maps the second term to a number that is the same
        for all queries. So a layer is one product and one maximum.
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
        raw: Floats = last_weights @ hidden
        raw += shift
        return raw

    def _prepared(self, queries: Array) -> _Queries:
        """`_prepare`, kept for queries that are the rest of the grid."""
        start = len(self._grid) - len(queries)
        if queries is not self._compared.get(start):
            if start < 0 or not (queries == self._grid[start:]).all():
                return self._prepare(queries)
            # A read-only array need not be compared again.
            if not queries.flags.writeable:
                self._compared[start] = queries
        prepared = self._on_grid.get(start)
        if prepared is None:
            # numpy is twice as fast on contiguous rows.
            whole = self._on_grid[0]
            prepared = self._on_grid[start] = _Queries(
                hidden=np.ascontiguousarray(whole.hidden[:, start:]),
                reference=np.ascontiguousarray(whole.reference[:, start:]),
            )
        return prepared

    def _prepare(self, queries: Array) -> _Queries:
        features = time_features(queries, self._duration, self._learner.harmonics).astype(np.float32)
        return _Queries(
            hidden=np.ascontiguousarray((features @ self._time_weights + self._time_bias).T),
            reference=np.ascontiguousarray(path_at(self._learner.reference, self._grid, queries).T),
        )
