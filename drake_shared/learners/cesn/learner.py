"""The context-based echo state network as a predictor, in numpy alone."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.arrays import path_at, read_only
from drake_shared.learners.base import check_query
from drake_shared.learners.cesn.file import cesn_from_file, cesn_to_file
from drake_shared.learners.cesn.model import CesnModel, at_times, encode, features, within
from drake_shared.learners.ood_variance import Doubt

Array = NDArray[np.float64]


class CesnLearner:
    """An echo state network with prediction intervals, after CESN+ (arXiv 2412.00541). A `Learner`.

    A fixed random reservoir, driven by the phase of the task, gives states over time; what was observed is
    the context; linear readouts, which ridge regression finds in one step, turn both into a mean and an
    interval about it. All that is learnt is the readouts, so training takes seconds and no torch.

    What the paper leaves open, or what is done otherwise here:

    - The context does not enter the reservoir but decides how its states are read out: the features read are
      the products of the states with those of the context. So the states are computed once, not rolled anew
      at each control step, and a prediction is three small products of matrices.
    - A context is a set of observations. Its code is the posterior of the amounts of the demonstrations'
      principal modes (`encode`), with a fixed random layer of tanh behind it, since to tell routes apart
      takes more than what is linear.
    - The interval of linear regression is as wide for all contexts that are as well known. Here a second
      readout gives the logarithm of the variance, by the scoring steps of a gamma regression on the squared
      residuals of contexts not used for the mean; then it is widened until 90% intervals hold 90%.
    - Far from all demonstrations the variance grows by `Doubt`; without observations the prediction is the
      demonstrations' own weighted mean and variance.

    Args:
        model: What was learnt and what goes with it.
    """

    name = "cesn"

    def __init__(self, model: CesnModel) -> None:
        self.model = model
        self.preset = model.preset
        self.confidence_gain = model.confidence_gain
        self.duration = float(model.grid[-1])
        self.grid = read_only(model.grid)
        self.demonstrations: Array | None = read_only(model.demonstrations)
        self.metadata = dict(model.metadata)
        self._doubt = Doubt(
            grid=self.grid,
            demonstrations=self.demonstrations,
            reach=model.doubt_reach,
            gain=model.doubt_gain,
        )
        # Rows first in memory, as a file gives them: in another order products differ in their last bits.
        self._hidden_weights = model.hidden_weights.astype(np.float32, order="C")
        self._hidden_bias = model.hidden_bias.astype(np.float32)
        self._readout = model.readout.reshape(len(model.readout), -1).astype(np.float32, order="C")
        # Shape (D, N): queries come last, as in the CNMP.
        self._states = at_times(model.states, self.grid, self.duration).T.astype(np.float32)
        self._log_variance = at_times(model.log_variance.T, self.grid, self.duration).T
        self._way = np.ascontiguousarray(model.reference.T)
        # Logarithms: from a normalised variance to one in [m^2], and the bounds of the former.
        self._lift = 2.0 * math.log(model.scale * model.sigma_scale)
        self._least = 2.0 * math.log(model.sigma_floor)
        self._most = 2.0 * math.log(model.reach)
        self._prior = self._moments()

    def to_file(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Tensors and description for `save_learner`."""
        tensors, description = cesn_to_file(self.model)
        return tensors, {**description, "confidence_gain": float(self.confidence_gain)}

    @classmethod
    def from_file(
        cls, path: Any, tensors: Mapping[str, NDArray[Any]], description: Mapping[str, Any]
    ) -> CesnLearner:
        """The learner of a file, for `load_learner`.

        Raises:
            InputError: Something in it does not fit.
        """
        return cls(cesn_from_file(path, tensors, description))

    def scaled(self, factor: float) -> CesnLearner:
        """The same with all standard deviations times ``factor``."""
        scale = self.model.sigma_scale * factor
        return CesnLearner(dataclasses.replace(self.model, sigma_scale=scale, metadata=self.metadata))

    def predict(self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike) -> tuple[Array, Array]:
        """Mean (Q, 2) in [m] and variance (Q, 2) in [m^2] at ``query_times`` (Q,); see `Learner.predict`."""
        observed_times, observed, queries = check_query(times, positions, query_times)
        start = len(self.grid) - len(queries)
        on_grid = start >= 0 and bool((queries == self.grid[start:]).all())
        first = start if on_grid else 0
        if not len(observed_times):
            mean, variance = (values[first:] for values in self._prior)
        else:
            observed_times = np.minimum(np.maximum(observed_times, 0.0), self.duration)
            if not math.isfinite(float(observed_times.sum() + observed.sum())):
                nothing = np.full((len(queries), 2), math.nan)
                return nothing, nothing.copy()
            mean, variance = self._conditioned(observed_times, observed, first)
        if on_grid:
            return mean.copy(), variance.copy()
        return path_at(mean, self.grid, queries), path_at(variance, self.grid, queries)

    def _conditioned(self, times: Array, positions: Array, first: int) -> tuple[Array, Array]:
        """Mean and variance (N - first, 2) on the grid from ``first`` on; ``times`` within [0, T]."""
        model = self.model
        offsets = (positions - at_times(model.reference, times, self.duration)) / model.scale
        modes = at_times(model.modes, times, self.duration)
        code = encode(modes, within(offsets, model.reach), model.noise).astype(np.float32)
        read = features(code, self._hidden_weights, self._hidden_bias) @ self._readout
        raw = read.reshape(4, -1) @ self._states[:, first:]
        mean = raw[:2] * model.scale + self._way[:, first:]
        logs = np.clip(raw[2:] + self._log_variance[:, first:], self._least, self._most)
        variance = np.exp(logs + self._lift) + self._doubt(times, positions)
        return mean.T, variance.T

    def _moments(self) -> tuple[Array, Array]:
        """Mean and variance (N, 2) of the demonstrations themselves."""
        model = self.model
        mean = (model.weights[:, None, None] * model.demonstrations).sum(axis=0)
        # What a driver may want is not what is desirable: the spread is that of all demonstrations alike.
        variance = np.square(model.demonstrations - mean).mean(axis=0)
        variance += (model.sigma_floor * model.scale) ** 2
        return mean, variance * model.sigma_scale**2
