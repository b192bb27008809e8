"""ProMP: the baseline that users know, from ``movement_primitives`` (extra ``baselines``)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from drake_shared.common.arrays import path_at
from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstrations, align
from drake_shared.learners.base import Array, Prediction, check_query
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.dataset import data_record, make_dataset
from drake_shared.learners.fields import Number, Tensor
from drake_shared.learners.stored import GridLearner

WEIGHTS_PER_AXIS = 25
# Relative to the spread of the demonstrations: the noise of observed positions, and the standard deviation
# that remains however many points were observed, which is what 25 weights cannot represent.
_OBSERVATION_NOISE, _FLOOR = 0.2, 0.04


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PrompLearner(GridLearner):
    """A Gaussian over trajectories (Paraschos et al. 2013), conditioned on points with noise. A `Learner`.

    Its variance does not depend on the positions observed, only on their times.

    Attributes:
        mean: Shape (25 D,), of the weights.
        covariance: Shape (25 D, 25 D), of the weights.
        noise: Standard deviation of observed positions, in [m].
        floor: Least standard deviation of a prediction, in [m].

    Raises:
        InputError: ``movement_primitives`` is not installed.
    """

    name: ClassVar[str] = "promp"
    mean: Annotated[Array, Tensor("25D")]
    covariance: Annotated[Array, Tensor("25D", "25D")]
    noise: Annotated[float, Number()]
    floor: Annotated[float, Number()]

    def __post_init__(self) -> None:
        super().__post_init__()
        make_promp(self.position_size)

    def scaled(self, factor: float, *, confidence_gain: float | None = None) -> PrompLearner:
        """A copy with all standard deviations times ``factor``; conditioning stays as it is."""
        return replace(
            self,
            covariance=factor**2 * self.covariance,
            noise=factor * self.noise,
            floor=factor * self.floor,
            confidence_gain=self.confidence_gain if confidence_gain is None else confidence_gain,
        )

    def predict(self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike) -> Prediction:
        """Mean (Q, D) in [m] and variance (Q, D) in [m^2] at ``query_times`` (Q,); see `Learner.predict`."""
        size = self.position_size
        seen_times, seen, queries = check_query(times, positions, query_times, size)
        if not (np.isfinite(seen_times).all() and np.isfinite(seen).all()):
            return np.full((len(queries), size), np.nan), np.full((len(queries), size), np.nan)
        primitive, basis = self._primitive
        for time, position in zip(np.clip(seen_times, 0.0, self.duration), seen, strict=True):
            primitive = primitive.condition_position(
                position, self.noise**2 * np.eye(size), t=float(time), t_max=self.duration
            )
        mean = basis @ primitive.weight_mean.reshape(size, -1).T
        # Of the covariance of all weights only the blocks of each axis give their variances.
        covariance = primitive.weight_cov.reshape(size, WEIGHTS_PER_AXIS, size, WEIGHTS_PER_AXIS)
        variance = np.stack(
            [((basis @ covariance[axis, :, axis]) * basis).sum(axis=1) for axis in range(size)], axis=-1
        )
        variance += self.floor**2
        return path_at(mean, self.grid, queries), path_at(variance, self.grid, queries)

    @cached_property
    def _primitive(self) -> tuple[Any, Array]:
        """The primitive, and the activations (N, 25) of the weights of one axis on the grid."""
        primitive = make_promp(self.position_size)
        primitive.from_weight_distribution(self.mean, self.covariance)
        return primitive, primitive._rbfs_1d_sequence(self.grid.copy()).T


def train_promp(demonstrations: Demonstrations, *, preset: str = "default") -> PrompLearner:
    """Fits the mean and covariance of the weights; scores, seed and time have no effect.

    Raises:
        InputError: ``movement_primitives`` is not installed.
    """
    demonstrations = align(demonstrations)
    dataset = make_dataset(demonstrations, weighted=False)
    primitive = make_promp(dataset.positions.shape[2])
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
        preset=preset,
        metadata={
            "scenario": demonstrations.scenario,
            "clock": "progress",
            "evidence": "pose+command",
            "training": data_record(demonstrations, dataset),
        },
    )
    gain = calibrate(learner, demonstrations, resolution=learner.noise)
    return replace(learner, confidence_gain=gain)


def make_promp(size: int) -> Any:
    """A primitive of the library for positions of ``size`` D.

    Raises:
        InputError: ``movement_primitives`` is not installed.
    """
    try:
        from movement_primitives.promp import ProMP
    except ImportError as error:
        raise InputError(
            "learner", "promp", "needs movement_primitives: in the checkout, pip install '.[baselines]'"
        ) from error
    return ProMP(size, WEIGHTS_PER_AXIS)
