"""A mixture of experts as a predictor: one CNMP for each route, and the probability of each."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from drake_shared.common.arrays import read_only
from drake_shared.common.errors import InputError
from drake_shared.learners.base import Array, Prediction, check_query
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.fields import Content, Number, Parts, Tensor
from drake_shared.learners.modes import Modes
from drake_shared.learners.stored import StoredLearner

NEGLIGIBLE = 1e-4
"""An expert less probable than this has no noticeable effect, and is not evaluated."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MixtureLearner(StoredLearner):
    """Expert decoders with a gate, after CNEP (Yildirim and Ugur, arXiv 2402.08424). A `MultimodalLearner`.

    Demonstrations are grouped by route, and each group trains an expert. The gate is not learnt but follows
    from Bayes' rule: a route's prior is its share of the demonstrations, and the likelihood of an observed
    position is normal about the demonstrations of that route at that time, with the noise that training puts
    on positions. So a low score excludes no route, and a position between two routes counts for both.

    `predict` returns the mean and the total variance, within and between the modes. In the mean the better
    routes weigh more, by the sampling weights Pd of their demonstrations.

    Attributes:
        experts: A CNMP for each of C routes, on one grid.
        shares: Shape (C,), of the demonstrations, summing to 1.
        leanings: Shape (C,), weights of the routes in the mean: Pd of a route's demonstrations over its
            share, 1 without scores.
        noise: Standard deviation of observed positions, in [m].
    """

    name: ClassVar[str] = "mixture"
    experts: Annotated[tuple[CnmpLearner, ...], Parts(CnmpLearner)]
    shares: Annotated[Array, Tensor("C")]
    leanings: Annotated[Array, Tensor("C")]
    noise: Annotated[float, Number()]

    @property
    def grid(self) -> Array:
        """Shape (N,), in [s]."""
        return self.experts[0].grid

    @property
    def duration(self) -> float:
        """T, in [s]."""
        return self.experts[0].duration

    @cached_property
    def demonstrations(self) -> Array:
        """Shape (m, N, D), in [m]; grouped by route."""
        return read_only(np.concatenate([expert.demonstrations for expert in self.experts]))

    def predict(self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike) -> Prediction:
        """Mean (Q, D) in [m] and total variance (Q, D) in [m^2] at ``query_times`` (Q,); see `Learner`."""
        mean, variance, _ = self.predict_modes(times, positions, query_times)
        return mean, variance

    def predict_modes(
        self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike
    ) -> tuple[Array, Array, Modes]:
        """Mean and total variance as `predict` returns them, and the modes that they summarize."""
        size = self.demonstrations.shape[2]
        seen_times, seen, queries = check_query(times, positions, query_times, size)
        probability = self._probability(seen_times, seen)
        weights = probability * self.leanings
        means = np.full((len(self.experts), len(queries), size), math.nan)
        variances = np.full_like(means, math.nan)
        mean, variance = np.zeros((len(queries), size)), np.zeros((len(queries), size))
        # NaN passes: then all experts are evaluated, and the prediction is NaN.
        used = [index for index, value in enumerate(probability) if not value < NEGLIGIBLE]
        for index in used:
            means[index], variances[index] = self.experts[index].predict(seen_times, seen, queries)
            mean += weights[index] * means[index]
        mean /= weights[used].sum()
        for index in used:
            variance += probability[index] * (variances[index] + np.square(means[index] - mean))
        variance /= probability[used].sum()
        modes = Modes(probability=probability, mean=means, variance=variances, aim=int(np.argmax(weights)))
        return mean, variance, modes

    def scaled(self, factor: float, *, confidence_gain: float | None = None) -> MixtureLearner:
        """A copy with the standard deviations within modes times ``factor``, and K of its own if given."""
        return replace(
            self,
            experts=tuple(expert.scaled(factor) for expert in self.experts),
            confidence_gain=self.confidence_gain if confidence_gain is None else confidence_gain,
        )

    @classmethod
    def _read(cls, content: Content) -> dict[str, Any]:
        values = super()._read(content)
        if np.any(values["shares"] <= 0) or np.any(values["leanings"] <= 0):
            raise InputError(content.path, "shares, leanings", "must be above 0")
        return values

    def _probability(self, times: Array, positions: Array) -> Array:
        """The probability of each route after positions (n, D) observed at ``times`` (n,): shape (C,)."""
        logs = np.log(self.shares)
        rate = (len(self.grid) - 1) / self.duration
        for time, position in zip(times.tolist(), positions.tolist(), strict=True):
            if not math.isfinite(sum(position, time)):
                return np.full(len(logs), math.nan)
            step = round(min(max(time, 0.0), self.duration) * rate)
            for x, centers, widths in zip(position, *self._routes, strict=True):
                logs = logs - 0.5 * ((x - centers[step]) ** 2 / widths[step] + np.log(widths[step]))
        odds: Array = np.exp(logs - logs.max())
        odds /= odds.sum()
        return odds

    @cached_property
    def _routes(self) -> tuple[list[Array], list[Array]]:
        """Of each coordinate, center and variance of each route at each time of the grid, shape (N, C)."""
        paths = [expert.demonstrations for expert in self.experts]
        axes = range(self.demonstrations.shape[2])
        return (
            [np.stack([path[:, :, axis].mean(axis=0) for path in paths], axis=1) for axis in axes],
            [
                np.stack([path[:, :, axis].var(axis=0) for path in paths], axis=1) + self.noise**2
                for axis in axes
            ],
        )
