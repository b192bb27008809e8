"""The context-based echo state network as a predictor, in numpy alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.arrays import path_at
from drake_shared.common.errors import InputError
from drake_shared.learners.base import Array, Prediction
from drake_shared.learners.cesn.context import at_times, encode, features, within
from drake_shared.learners.fields import Content, Number, Tensor
from drake_shared.learners.stored import RegressionLearner

Floats = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CesnLearner(RegressionLearner):
    """An echo state network with prediction intervals, after CESN+ (arXiv 2412.00541). A `Learner`.

    A fixed random reservoir, driven by the phase of the task, gives states over time; the observations are
    the context; linear readouts, which ridge regression finds in one step, map both to a mean and an interval
    about it. Only the readouts are learnt, so training takes seconds and no torch.

    Choices that the paper leaves open, or that differ from it:

    - The context does not enter the reservoir but decides how its states are read out: the readout is linear
      in the products of the states with the features of the context. So the states are computed once rather
      than at each control step, and a prediction is three small matrix products.
    - A context is a set of observations. Its code is the posterior of the amounts of the demonstrations'
      principal modes (`encode`), followed by a fixed random layer of tanh, since routes are not distinguished
      linearly.
    - The interval of linear regression does not depend on which route a context shows. Here a second readout
      gives the logarithm of the variance, by the scoring steps of a gamma regression on the squared residuals
      of contexts not used for the mean; then it is widened until 90% intervals cover 90%.

    "Normalized" is relative to ``reference`` and in units of ``scale``.

    Attributes:
        states: Shape (P, S), of the reservoir at P even phases of the task.
        modes: Shape (P, D, K), at these phases the principal modes of the normalized demonstrations, each
            times its standard deviation.
        hidden_weights, hidden_bias: Shapes (2K, H) and (H,), of the random layer.
        readout: Shape (1 + 2K + H, 2D, S), from a context's features to the readout of the states for the
            normalized mean of each coordinate and the logarithm of its variance.
        log_variance: Shape (D, P), to which the latter are added.
        noise: Standard deviation of observed positions, normalized.
        reach: Largest distance from the reference, normalized; positions farther away are moved in to it.
        sigma_floor: Normalized.
    """

    name: ClassVar[str] = "cesn"
    states: Annotated[Array, Tensor("P", "S")]
    modes: Annotated[Array, Tensor("P", "D", "K")]
    hidden_weights: Annotated[Array, Tensor("2K", "H")]
    hidden_bias: Annotated[Array, Tensor("H")]
    readout: Annotated[Array, Tensor("1 + 2K + H", "2D", "S")]
    log_variance: Annotated[Array, Tensor("D", "P")]
    noise: Annotated[float, Number()]
    reach: Annotated[float, Number()]

    @classmethod
    def _read(cls, content: Content) -> dict[str, Any]:
        values = super()._read(content)
        if len(values["states"]) < 2:
            raise InputError(content.path, "states", "must be at 2 phases or more", len(values["states"]))
        return values

    def _condition(self, times: Array, positions: Array, queries: Array) -> Prediction:
        if not (np.isfinite(times).all() and np.isfinite(positions).all()):
            shape = (len(queries), self.position_size)
            return np.full(shape, math.nan), np.full(shape, math.nan)
        times = np.minimum(np.maximum(times, 0.0), self.duration)
        start = len(self.grid) - len(queries)
        on_grid = start >= 0 and bool((queries == self.grid[start:]).all())
        mean, variance = self._on_grid(times, positions, start if on_grid else 0)
        if on_grid:
            return mean.copy(), variance.copy()
        return path_at(mean, self.grid, queries), path_at(variance, self.grid, queries)

    def _on_grid(self, times: Array, positions: Array, first: int) -> Prediction:
        """Mean and variance (N - first, D) on the grid from ``first`` on; ``times`` within [0, T]."""
        hidden_weights, hidden_bias, readout, states, log_variance = self._prepared
        size = self.position_size
        offsets = (positions - at_times(self.reference, times, self.duration)) / self.scale
        modes = at_times(self.modes, times, self.duration)
        code = encode(modes, within(offsets, self.reach), self.noise).astype(np.float32)
        rows = (features(code, hidden_weights, hidden_bias) @ readout).reshape(2 * size, -1)
        raw = rows @ states[:, first:]
        mean = raw[:size] * self.scale + self.reference.T[:, first:]
        # Logarithms of normalized variances within their bounds, then of variances in [m^2].
        logs = raw[size:] + log_variance[:, first:]
        logs = np.clip(logs, 2.0 * math.log(self.sigma_floor), 2.0 * math.log(self.reach))
        variance = np.exp(logs + 2.0 * math.log(self.scale * self.sigma_scale))
        variance += self._ood_variance(times, positions)
        return mean.T, variance.T

    @cached_property
    def _prepared(self) -> tuple[Floats, Floats, Floats, Floats, Array]:
        """Layer, readout (F, 2D S), and on the grid the states (S, N) and log variances (D, N)."""
        # Always row-major: in another order products differ in their last bits.
        return (
            self.hidden_weights.astype(np.float32, order="C"),
            self.hidden_bias.astype(np.float32),
            self.readout.reshape(len(self.readout), -1).astype(np.float32, order="C"),
            at_times(self.states, self.grid, self.duration).T.astype(np.float32),
            at_times(self.log_variance.T, self.grid, self.duration).T,
        )

    @property
    def _floor(self) -> float:
        return self.sigma_floor * self.scale
