"""A mixture of experts: one CNMP for each way that was demonstrated, and the odds of each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.cnmp.file import cnmps_from_file, cnmps_to_file
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.metadata_fields import number_of, tensor_of
from drake_shared.learners.modes import Modes

# An expert less likely than this is not asked: it would change nothing that counts.
_UNLIKELY = 1e-4


class MixtureLearner:
    """Expert decoders with a gate, after CNEP (Yildirim and Ugur, arXiv 2402.08424). A `Learner`.

    Demonstrations are grouped by the way that they go, and each group teaches an expert. The gate is not
    learnt but follows from Bayes' rule: the odds of a way are its share of the demonstrations times the
    density of the positions shown, which is normal about the demonstrations of that way at that time, with
    the noise that training puts on positions. So no way is forgotten for having a low score, and a position
    between two ways speaks for both.

    ``predict`` gives the mean and the total variance, within and between the ways; ``predict_modes`` the ways
    as well.
    In the mean the better ways weigh more, by the sampling weights Pd of their demonstrations.

    Args:
        experts: A CNMP for each way, on one grid.
        shares: Shape (C,), of the demonstrations, summing to 1.
        leanings: Shape (C,), Pd of each way's demonstrations over their share; even without scores.
        noise: Standard deviation of positions shown, in [m].
        confidence_gain: K of eq. (1), in [1/m^2].
        metadata: Whatever else its file says.
    """

    name = "mixture"

    def __init__(
        self,
        *,
        experts: Sequence[CnmpLearner],
        shares: NDArray[np.float64],
        leanings: NDArray[np.float64],
        noise: float,
        confidence_gain: float,
        metadata: Mapping[str, Any],
    ) -> None:
        self.experts = list(experts)
        self.grid = self.experts[0].grid
        self.duration = self.experts[0].duration
        self.demonstrations: NDArray[np.float64] | None = np.concatenate(
            [np.asarray(expert.demonstrations) for expert in self.experts]
        )
        self.demonstrations.setflags(write=False)
        self.confidence_gain = confidence_gain
        self.metadata = dict(metadata)
        self.preset = str(metadata.get("preset", "default"))
        self._shares, self._leanings, self._noise = shares, leanings, noise
        # Of each way at each time of the grid: where it is, shape (N, C), and how wide, in x and in y.
        paths = [np.asarray(expert.demonstrations) for expert in self.experts]
        self._centres = [
            np.stack([path[:, :, axis].mean(axis=0) for path in paths], axis=1) for axis in (0, 1)
        ]
        self._widths = [
            np.stack([path[:, :, axis].var(axis=0) for path in paths], axis=1) + noise**2 for axis in (0, 1)
        ]
        self._rate = (len(self.grid) - 1) / self.duration

    def predict(
        self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean (Q, 2) in [m] and total variance (Q, 2) in [m^2] at ``query_times`` (Q,); see `Learner`."""
        mean, variance, _ = self.predict_modes(times, positions, query_times)
        return mean, variance

    def predict_modes(
        self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], Modes]:
        """Mean and total variance as `predict` gives them, and the modes that they are of."""
        seen_times = np.asarray(times, dtype=float)
        seen = np.asarray(positions, dtype=float)
        count = len(self.experts)
        probability = self._odds(seen_times, seen)
        size = np.size(query_times)
        means = np.full((count, size, 2), math.nan)
        variances = np.full((count, size, 2), math.nan)
        leaning = probability * self._leanings
        mean, variance = np.zeros((size, 2)), np.zeros((size, 2))
        # What is no number leaves no way out, and makes the prediction none either.
        asked = [index for index in range(count) if not probability[index] < _UNLIKELY]
        for index in asked:
            means[index], variances[index] = self.experts[index].predict(seen_times, seen, query_times)
            mean += leaning[index] * means[index]
        mean /= leaning[asked].sum()
        for index in asked:
            variance += probability[index] * (variances[index] + np.square(means[index] - mean))
        variance /= probability[asked].sum()
        modes = Modes(probability=probability, mean=means, variance=variances, aim=int(np.argmax(leaning)))
        return mean, variance, modes

    def to_file(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Tensors and description for `save_learner`."""
        tensors, descriptions = cnmps_to_file([expert.model for expert in self.experts], "expert")
        tensors |= {"shares": self._shares, "leanings": self._leanings}
        numbers = {"noise": self._noise, "duration": self.duration, "preset": self.preset}
        return tensors, {**self.metadata, **numbers, "experts": descriptions}

    @classmethod
    def from_file(
        cls, path: Any, tensors: Mapping[str, NDArray[Any]], description: Mapping[str, Any]
    ) -> MixtureLearner:
        """The learner of a file, for `load_learner`.

        Raises:
            InputError: Something in it does not fit.
        """
        experts = [CnmpLearner(model) for model in cnmps_from_file(path, tensors, description, "expert")]
        shares = tensor_of(path, tensors, "shares", (len(experts),))
        leanings = tensor_of(path, tensors, "leanings", (len(experts),))
        if np.any(shares <= 0) or np.any(leanings <= 0):
            raise InputError(path, "shares, leanings", "must be above 0")
        return cls(
            experts=experts,
            shares=shares,
            leanings=leanings,
            noise=number_of(path, description, "noise"),
            confidence_gain=number_of(path, description, "confidence_gain"),
            metadata={name: value for name, value in description.items() if name != "experts"},
        )

    def scaled(self, factor: float) -> MixtureLearner:
        """The same with the standard deviations within each way times ``factor``."""
        return MixtureLearner(
            experts=[expert.scaled(factor) for expert in self.experts],
            shares=self._shares,
            leanings=self._leanings,
            noise=self._noise,
            confidence_gain=self.confidence_gain,
            metadata=self.metadata,
        )

    def calibrated(self, demonstrations: Demonstrations) -> MixtureLearner:
        """The same with K found anew by `calibrate`."""
        self.confidence_gain = calibrate(self, demonstrations, resolution=self._noise)
        return self

    def _odds(self, times: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """How likely each way is after the positions (n, 2) seen at ``times`` (n,): shape (C,)."""
        logs = np.log(self._shares)
        for time, position in zip(times.tolist(), positions.tolist(), strict=True):
            if not math.isfinite(time + position[0] + position[1]):
                return np.full(len(logs), math.nan)
            step = round(min(max(time, 0.0), self.duration) * self._rate)
            for axis in (0, 1):
                width = self._widths[axis][step]
                logs = logs - 0.5 * (
                    (position[axis] - self._centres[axis][step]) ** 2 / width + np.log(width)
                )
        odds = np.exp(logs - logs.max())
        return odds / odds.sum()
