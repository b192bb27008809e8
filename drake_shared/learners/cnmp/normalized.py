"""Demonstrations in the units of a network, and the learner that a network of these units is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.parameters import TrainingParameters
from drake_shared.learners.dataset import Dataset, normalization
from drake_shared.learners.fields import Layer

HOLD_OUT_FROM, HELD_OUT = 60, 0.1
"""From so many demonstrations on, this share of them is held out."""
MIN_NOISE = 0.05
"""Relative; the unit of lengths that are multiples of the noise, where there is none."""

Layers = tuple[Layer, ...]


class NormalizedTask:
    """The demonstrations of one learner, normalized: relative to a reference path, in units of a scale.

    Attributes:
        paths: Shape (m, N, D), normalized.
        weights: Shape (m,), Pd of Alg. 1.
        unit: Unit of "relative" lengths of the parameters, normalized.
        axes: Shape (D,), half the extent of each coordinate, at least the unit, normalized.
        sigma_floor, first_sigma: Least standard deviation at the end and at the start of a cycle, normalized.
        nats: What a loss in nats per normalized point lacks to one in nats per point in m.
        held_out: Shape (m,), whether each demonstration is held out.

    Args:
        dataset: On its grid.
        parameters: Of the training.
        seed: Determines what is held out.
    """

    def __init__(self, dataset: Dataset, parameters: TrainingParameters, seed: int) -> None:
        p = parameters
        self._dataset, self._parameters = dataset, p
        self._scale, self._reference = normalization(dataset, centred=p.centred)
        self._floor = p.sigma_floor * (dataset.spread if p.relative_floor else 1.0)
        self.paths = (dataset.positions - self._reference) / self._scale
        self.weights = dataset.weights
        self.unit = dataset.spread / self._scale
        halves = np.maximum(0.5 * np.ptp(dataset.positions, axis=(0, 1)), dataset.spread)
        self.axes: NDArray[np.float64] = halves / self._scale
        self.sigma_floor = self._floor / self._scale
        self.first_sigma = max(p.first_floor * dataset.spread, self._floor) / self._scale
        self.nats = dataset.mean_path.shape[1] * float(np.log(self._scale))
        self.held_out = np.zeros(len(self.paths), dtype=bool)
        if p.patience > 0.0 and len(self.paths) >= HOLD_OUT_FROM:
            order = np.random.default_rng(seed).permutation(len(self.paths))
            self.held_out[order[: round(HELD_OUT * len(self.paths))]] = True

    def learner(
        self,
        encoder: Layers,
        decoder: Layers,
        *,
        confidence_gain: float = 1.0,
        metadata: Mapping[str, Any] | None = None,
        max_variance: float | None = None,
    ) -> CnmpLearner:
        """The learner that a trained network is.

        Args:
            encoder, decoder: Of `unscaled`.
            confidence_gain: K of eq. (1), in [1/m^2].
            metadata: Of the learner.
            max_variance: Variance of hardly any confidence, in [m^2], which distance from all demonstrations
                adds; default: the variance of the demonstrations.
        """
        p, dataset = self._parameters, self._dataset
        noise = max(p.noise, MIN_NOISE) * dataset.spread
        ood_gain = 0.0
        if p.doubt_within > 0.0:
            ood_gain = (max_variance or dataset.spread**2) / (p.doubt_within * noise) ** 2
        return CnmpLearner(
            preset=p.preset,
            encoder=encoder,
            aggregation=p.aggregation,
            decoder=decoder,
            harmonics=p.harmonics,
            grid=dataset.grid,
            reference=self._reference,
            scale=self._scale,
            sigma_floor=self._floor,
            demonstrations=dataset.positions,
            weights=dataset.weights,
            doubt_reach=p.doubt_from * noise or dataset.spread,
            doubt_gain=ood_gain,
            confidence_gain=confidence_gain,
            metadata=metadata or {},
        )

    def is_ignored_by(self, learner: CnmpLearner) -> bool:
        """Whether a learner predicts the same whatever it observes, where the demonstrations lie apart."""
        dataset = self._dataset
        deviations = np.square(dataset.positions - dataset.mean_path).mean(axis=(0, 2))
        if len(dataset.positions) < 2 or deviations.mean() < (0.01 * dataset.extent) ** 2:
            return False  # The demonstrations are all alike.
        step = int(deviations.argmax())
        grid = dataset.grid
        means = np.stack([learner.predict(grid[[step]], path[[step]], grid)[0] for path in dataset.positions])
        predicted = np.square(means - means.mean(axis=0)).mean()
        return bool(predicted < 0.1 * deviations.mean())

    def unscaled(self, encoder: Layers, decoder: Layers) -> tuple[Layers, Layers]:
        """The layers for inputs and outputs that are not scaled, from those that were trained; in place."""
        p, count = self._parameters, 1 + 2 * self._parameters.harmonics
        weights, bias = encoder[0]
        if p.time_scale is not None:
            first, first_bias = decoder[0]
            for rows, own_bias in ((weights[:count], bias), (first[-count:], first_bias)):
                own_bias -= p.time_scale * rows.sum(axis=0)
                rows *= 2.0 * p.time_scale
        if p.position_scale is not None:
            axes = self.axes.astype(np.float32)
            weights[count:] *= (p.position_scale / axes)[:, None]
            last, last_bias = decoder[-1]
            last[:, : len(axes)] *= axes
            last_bias[: len(axes)] *= axes
        return encoder, decoder
