"""Predictions of a CNMP for many sets of observations at once."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from drake_shared.learners.base import Array
from drake_shared.learners.cnmp.layers import Floats, softplus
from drake_shared.learners.cnmp.learner import CnmpLearner

Index = NDArray[np.int64]

# A hidden layer of more bytes does not stay in the cache.
_BLOCK_BYTES = 400_000


class CnmpRows:
    """Evaluates a CNMP for rows of one or two observations each, bit for bit as the learner does alone.

    BLAS rounds a product differently if its shape is another one. So there is a product of the learner's own
    shapes for each row, in one call of numpy for many rows, and all the rest is one array.

    Args:
        learner: Its positions have size 2.
        times: Shape (P,), the times that observations may have, in [s].
    """

    def __init__(self, learner: CnmpLearner, times: Array) -> None:
        self._learner = learner
        self._predictor = predictor = learner._predictor
        self._count = len(learner.grid)
        at_origin = [predictor._observation(time, [0.0, 0.0]) for time in times.tolist()]
        self._features = np.array(at_origin, np.float32)[:, :-2]
        clipped = np.minimum(np.maximum(times, 0.0), learner.duration)
        steps = clipped * predictor._steps_per_second
        before = np.minimum(steps.astype(int), self._count - 2)
        reference = learner.reference
        self._origin = reference[before]
        self._beyond = (steps - before)[:, None] * (reference[before + 1] - reference[before])
        self._ood_variance = learner._ood_variance.table(times)

    def predict(self, index: Index, positions: Array, first: Index) -> tuple[Array, Array, Array]:
        """Predicts after the first observation of each row, and after both.

        Args:
            index: Shape (n, c), c being 1 or 2: of ``times``, for each observation.
            positions: Shape (n, c, 2), in [m].
            first: Shape (n,), ascending: index of the first query of each row in the learner's grid.

        Returns:
            Mean in [m], variance in [m^2], and the mean that an agent assists, which is another one if the
            learner predicts modes: shapes (n, c, 2, Q), for the grid from ``first[0]`` on. What comes before
            a row's own first query is finite and has no meaning.
        """
        predictor, size = self._predictor, positions.shape[-1]
        offsets = (positions - self._origin[index] - self._beyond[index]) / self._learner.scale
        inputs = np.concatenate([self._features[index], offsets.astype(np.float32)], axis=-1)
        counts = range(1, index.shape[1] + 1)
        encoded = [predictor._encode(inputs[:, :count]) for count in counts]
        code = np.stack([self._aggregate(codes) for codes in encoded], axis=1)
        raw = self._decode(code, first)
        mean = raw[:, :, :size] * predictor._scale + predictor._on_grid[0].reference[:, first[0] :]
        sigma = softplus(raw[:, :, size:])
        sigma *= predictor._sigma_factor
        sigma += predictor._sigma_offset
        sigma *= sigma
        variance = sigma + self._ood_variance(index, positions)[..., None, None]
        return mean, variance, mean

    def _aggregate(self, codes: Floats) -> Floats:
        """One code (n, C) for the observations of each row, from their codes (n, c, C)."""
        if self._learner.aggregation == "mean":
            mean: Floats = codes.sum(axis=1) / codes.shape[1]
            return mean
        half = codes.shape[-1] // 2
        precision = softplus(codes[..., half:])
        weighted = (precision * codes[..., :half]).sum(axis=1)
        total = precision.sum(axis=1) + np.float32(1.0)
        return np.concatenate([weighted / total, np.reciprocal(total)], axis=-1)

    def _decode(self, code: Floats, first: Index) -> Floats:
        """Mean and raw standard deviation, normalized, from codes (n, c, C): shape (n, c, 4, Q)."""
        predictor = self._predictor
        rows, prefixes = code.shape[:2]
        shift = (code[:, :, None] @ predictor._code_weights)[:, :, 0, :, None]
        shifts = [-shift]
        *inner, (last_weights, last_bias) = predictor._layers
        for weights, bias in inner:
            shift = weights @ shift + bias[0]
            shifts.append(-shift)
        raw = np.zeros((rows, prefixes, len(last_weights), self._count - int(first[0])), np.float32)
        edges = [0, *(np.flatnonzero(np.diff(first)) + 1).tolist(), rows]
        for begin, end in itertools.pairwise(edges):
            start = int(first[begin])
            # Of this shape BLAS multiplies for the learner alone.
            table = predictor._prepared(self._learner.grid[start:]).hidden
            most = max(1, _BLOCK_BYTES // (4 * prefixes * table.size))
            for low in range(begin, end, most):
                part = slice(low, min(low + most, end))
                # A maximum of two arrays is twice as fast as one of an array and a number.
                hidden = np.empty((part.stop - low, prefixes, *table.shape), np.float32)
                hidden[...] = shifts[0][part]
                np.maximum(table, hidden, out=hidden)
                for (weights, _), moved in zip(inner, shifts[1:], strict=True):
                    hidden = weights @ hidden
                    np.maximum(hidden, moved[part], out=hidden)
                np.matmul(last_weights, hidden, out=raw[part, :, :, start - int(first[0]) :])
        raw += last_weights @ shift + last_bias[0]
        return raw
