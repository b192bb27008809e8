"""ProMP as a learner: the baseline that users know, by ``movement_primitives`` (extra ``baselines``)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.arrays import path_at
from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.dataset import data_record, make_dataset

WEIGHTS_PER_AXIS = 25
# Of the spread of the demonstrations: how far an observed position may be from the way it belongs to.
_OBSERVATION_NOISE = 0.2
# Standard deviation, relative to the spread, that remains however many points were seen: what 25 weights
# cannot follow.
_FLOOR = 0.04


class PrompLearner:
    """A Gaussian over trajectories (Paraschos et al. 2013), conditioned on points with noise. A `Learner`.

    Its variance does not depend on the positions shown, only on their times.

    Args:
        grid: Shape (N,), in [s].
        demonstrations: Shape (m, N, 2), in [m].
        mean: Shape (50,), of the weights of x and y.
        covariance: Shape (50, 50).
        noise: Standard deviation of observed positions, in [m].
        floor: Least standard deviation of a prediction, in [m].
        confidence_gain: K of eq. (1), in [1/m^2].
        metadata: Whatever else its file says.

    Raises:
        InputError: ``movement_primitives`` is not installed.
    """

    name = "promp"

    def __init__(
        self,
        *,
        grid: NDArray[np.float64],
        demonstrations: NDArray[np.float64],
        mean: NDArray[np.float64],
        covariance: NDArray[np.float64],
        noise: float,
        floor: float,
        confidence_gain: float,
        metadata: Mapping[str, Any],
    ) -> None:
        self.grid = grid
        self.demonstrations: NDArray[np.float64] | None = demonstrations
        self.duration = float(grid[-1])
        self.noise = noise
        self.floor = floor
        self.confidence_gain = confidence_gain
        self.metadata = dict(metadata)
        self.preset = str(metadata.get("preset", "default"))
        self._weights = _promp()
        self._weights.from_weight_distribution(mean, covariance)
        # Shape (N, 25): how much each weight of one axis counts at each time.
        self._activations = self._weights._rbfs_1d_sequence(grid.copy()).T

    def to_file(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Tensors and description, as `from_file` takes them."""
        tensors = {
            "grid": self.grid,
            "demonstrations": np.asarray(self.demonstrations),
            "mean": self._weights.weight_mean,
            "covariance": self._weights.weight_cov,
        }
        numbers = {"noise": self.noise, "floor": self.floor, "confidence_gain": self.confidence_gain}
        return tensors, {**self.metadata, **numbers, "preset": self.preset, "duration": self.duration}

    @classmethod
    def from_file(
        cls, path: Any, tensors: Mapping[str, NDArray[Any]], description: Mapping[str, Any]
    ) -> PrompLearner:
        """The learner of a file.

        Raises:
            InputError: Something is missing, has another shape, or is not finite.
        """
        size = 2 * WEIGHTS_PER_AXIS
        shapes = {"grid": 1, "demonstrations": 3, "mean": 1, "covariance": 2}
        for name, dimensions in shapes.items():
            tensor = tensors.get(name)
            if tensor is None or tensor.ndim != dimensions or not np.isfinite(tensor).all():
                raise InputError(path, name, f"must be finite numbers of {dimensions} dimensions")
        if tensors["mean"].shape != (size,) or tensors["covariance"].shape != (size, size):
            raise InputError(path, "covariance", f"must have shape ({size}, {size})")
        numbers = {
            name: float(description.get(name, np.nan)) for name in ("noise", "floor", "confidence_gain")
        }
        for name, value in numbers.items():
            if not (np.isfinite(value) and value > 0):
                raise InputError(path, name, "must be a finite number above 0", value)
        given: dict[str, Any] = {name: tensors[name] for name in shapes} | numbers
        return cls(**given, metadata=description)

    def scaled(self, factor: float) -> PrompLearner:
        """The same with all standard deviations times ``factor``; how points are taken stays as it is."""
        tensors, description = self.to_file()
        tensors["covariance"] = factor**2 * tensors["covariance"]
        scaled = {name: factor * description[name] for name in ("noise", "floor")}
        return self.from_file("learner", tensors, description | scaled)

    def predict(
        self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean (Q, 2) in [m] and variance (Q, 2) in [m^2] at ``query_times`` (Q,)."""
        primitive = self._weights
        for time, position in zip(np.atleast_1d(times), np.reshape(positions, (-1, 2)), strict=True):
            if not np.isfinite(time + position.sum()):
                nothing = np.full((np.size(query_times), 2), np.nan)
                return nothing, nothing.copy()
            inside = min(max(float(time), 0.0), self.duration)
            primitive = primitive.condition_position(
                position, self.noise**2 * np.eye(2), t=inside, t_max=self.duration
            )
        basis, size = self._activations, WEIGHTS_PER_AXIS
        mean = basis @ primitive.weight_mean.reshape(2, size).T
        # Of the covariance of all weights only the blocks of x and of y give their variances.
        blocks = (primitive.weight_cov[:size, :size], primitive.weight_cov[size:, size:])
        variance = np.stack([((basis @ block) * basis).sum(axis=1) for block in blocks], axis=-1)
        variance = np.maximum(variance, 0.0) + self.floor**2
        queries = np.asarray(query_times, dtype=float)
        return tuple(  # type: ignore[return-value]
            path_at(values, self.grid, queries) for values in (mean, variance)
        )


def _promp():
    try:
        from movement_primitives.promp import ProMP
    except ImportError as error:
        raise InputError(
            "learner", "promp", "needs movement_primitives: pip install 'drake_shared[baselines]'"
        ) from error
    return ProMP(2, WEIGHTS_PER_AXIS)


def train_promp(
    demonstrations: Demonstrations, *, preset: str = "default", weighted: bool = True
) -> PrompLearner:
    """Fits the mean and covariance of the weights by least squares.

    Raises:
        InputError: ``movement_primitives`` is not installed.
    """
    dataset = make_dataset(demonstrations, weighted=weighted)
    primitive = _promp()
    # The library scales the times that it is given in place, hence copies.
    weights = np.array([primitive.weights(dataset.grid.copy(), path) for path in dataset.positions])
    offsets = weights - weights.mean(axis=0)
    learner = PrompLearner(
        grid=dataset.grid,
        demonstrations=dataset.positions,
        mean=weights.mean(axis=0),
        covariance=offsets.T @ offsets / len(weights),
        noise=_OBSERVATION_NOISE * dataset.spread,
        floor=_FLOOR * dataset.spread,
        confidence_gain=1.0,
        metadata={
            "scenario": demonstrations.scenario,
            "preset": preset,
            "clock": "progress",
            "evidence": "pose+command",
            "training": data_record(demonstrations, dataset),
        },
    )
    learner.confidence_gain = calibrate(learner, demonstrations, resolution=learner.noise)
    return learner
