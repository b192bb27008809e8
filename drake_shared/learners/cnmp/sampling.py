"""The samples of an iteration of training: lines 6 to 9 of Alg. 1, for a batch of demonstrations at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from drake_shared.learners.augmentation import low_frequency_basis, make_neighborhoods, unexplained
from drake_shared.learners.cnmp.parameters import TrainingParameters

SAMPLES_AT_ONCE = 128
"""Sampling one costs as much as sampling a hundred: so many are sampled at a time, for one batch or more."""


class Batch(NamedTuple):
    """For each of E learners B samples with M observations in all and Q queries each, normalized.

    Attributes:
        observations: Shape (E, M, F + D), time features and position.
        samples: Which sample each observation belongs to; see `drake_shared.learners.cnmp.network.aggregate`.
        queries: Shape (Q, F), time features.
        truth: Shape (E, B, Q, D), positions at the queries.
        weights: Shape (E, B, 1, 1), of each sample in the mean's loss; 1 on average.
    """

    observations: Tensor
    samples: Tensor
    queries: Tensor
    truth: Tensor
    weights: Tensor


@dataclass(frozen=True, kw_only=True, eq=False)
class TaskData:
    """The training data of one learner.

    Attributes:
        paths: Shape (m, N, D), demonstrations in normalized units.
        weights: Shape (m,), Pd of Alg. 1, summing to 1.
        unit: Unit of "relative" lengths of the parameters, in normalized units.
        seed: Of the samples for this learner.
    """

    paths: NDArray[np.float64]
    weights: NDArray[np.float64]
    unit: float
    seed: int


class Sampler:
    """Samples batches for learners that are trained side by side.

    Number and times of observations and queries are common to all learners; demonstrations and noise are each
    learner's own. So the samples of a learner do not depend on the others.

    Args:
        tasks: Data of each learner, on one grid.
        features: Shape (N, F), time features of the grid, on the device of the samples.
        parameters: Of the training.
        padded: Whether every sample is padded to the largest number of observations, so that all batches have
            one shape.
    """

    def __init__(
        self,
        tasks: Sequence[TaskData],
        features: Tensor,
        parameters: TrainingParameters,
        *,
        padded: bool = False,
    ) -> None:
        self._parameters = parameters
        self._features = features
        self._padded = padded
        self._samplers = [_LearnerSampler(task, parameters, features.device) for task in tasks]
        self._batches = self._sample()

    def sample(self) -> Batch:
        """The next batch."""
        return next(self._batches)

    def keep(self, indices: Sequence[int]) -> None:
        """Samples from now on for the learners at ``indices`` alone."""
        self._samplers = [self._samplers[index] for index in indices]
        self._batches = self._sample()

    def _sample(self) -> Iterator[Batch]:
        p, steps, device = self._parameters, len(self._features), self._features.device
        # Of little work, and on a processor the order of its numbers is known without waiting.
        generator = torch.Generator().manual_seed(0)
        batches = max(1, SAMPLES_AT_ONCE // p.batch)
        rows = batches * p.batch
        while True:
            number = torch.randint(1, p.observations + 1, (batches, p.batch), generator=generator)
            number[:, : int(p.single_share * p.batch)] = 1
            # torch's own repeat_interleave takes a third of the time of a whole iteration.
            index = torch.from_numpy(np.repeat(np.arange(rows), number.flatten().numpy()))
            when = torch.randint(steps, (len(index),), generator=generator).to(device)
            queries = torch.randint(steps, (batches, p.queries), generator=generator).to(device)
            sampled = [sampler.sample(rows, index.to(device), when) for sampler in self._samplers]
            paths, observed, weights = (torch.stack(parts) for parts in zip(*sampled, strict=True))
            features = self._features[when].expand(len(observed), -1, -1)
            observations = torch.cat([features, observed], dim=-1)
            if self._padded:
                present = torch.arange(p.observations) < number.flatten()[:, None]
                shape = (len(observed), present.numel(), observations.shape[-1])
                places = present.flatten().nonzero()[:, 0].to(device)
                observations = observations.new_zeros(shape).index_copy_(1, places, observations)
                present = present.to(device, torch.float32)
            end = 0
            for batch, count in enumerate(number.sum(dim=1).tolist()):
                begin, end = end, end + (p.batch * p.observations if self._padded else count)
                first = batch * p.batch
                chosen = slice(first, first + p.batch)
                yield Batch(
                    observations=observations[:, begin:end],
                    samples=present[chosen] if self._padded else index[begin:end] - first,
                    queries=self._features[queries[batch]],
                    truth=paths[:, chosen, queries[batch]],
                    weights=weights[:, chosen, None, None],
                )


class _LearnerSampler:
    """Samples demonstrations and noise of one learner."""

    def __init__(self, task: TaskData, parameters: TrainingParameters, device: torch.device) -> None:
        def tensor(values: NDArray[np.float64]) -> Tensor:
            return torch.tensor(values, dtype=torch.float32, device=device)

        paths, weights = task.paths, task.weights
        self._even = parameters.even_spread
        self._device = device
        self._paths = tensor(paths)
        self._weights = tensor(weights * len(weights))
        self._noise = parameters.noise * task.unit
        self._generator = torch.Generator(device).manual_seed(task.seed)
        self._neighbors: Tensor | None = None
        if parameters.blending > 0.0:
            reach = parameters.blending * task.unit
            neighbors, gains = make_neighborhoods(paths, reach=reach, widening=parameters.widening)
            self._neighbors = tensor(neighbors)
            self._spreads = tensor(np.sqrt(neighbors) * gains[:, None])
            sigma = parameters.wandering * task.unit * unexplained(neighbors)
            self._low_frequency = tensor(sigma) if sigma.any() else None
            self._basis = tensor(low_frequency_basis(paths.shape[1]))

    def sample(self, rows: int, index: Tensor, when: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Demonstrations (rows, N, D), observations of those at ``index`` (M, D), and weights (rows,)."""
        generator = self._generator
        if self._even:
            chosen = torch.randint(len(self._paths), (rows,), generator=generator, device=self._device)
            weights = self._weights[chosen]
        else:
            chosen = torch.multinomial(self._weights, rows, replacement=True, generator=generator)
            weights = torch.ones(rows, device=self._device)
        paths = self._augmented(chosen)
        observed = paths[index, when]
        if self._noise > 0.0:
            observed = observed + self._noise * self._normal(*observed.shape)
        return paths, observed, weights

    def _augmented(self, chosen: Tensor) -> Tensor:
        """New demonstrations of the route of each of those chosen, (rows, N, D); see `make_neighborhoods`."""
        if self._neighbors is None:
            return self._paths[chosen]
        deviations = self._normal(len(chosen), len(self._paths))
        deviations *= self._spreads[chosen]
        parts = self._neighbors[chosen] * (1.0 - deviations.sum(dim=1, keepdim=True)) + deviations
        paths = (parts @ self._paths.flatten(start_dim=1)).view(len(chosen), *self._paths.shape[1:])
        if self._low_frequency is not None:
            amounts = self._normal(paths.shape[-1], len(chosen), len(self._basis))
            paths += (self._low_frequency[chosen, None] * (amounts @ self._basis)).permute(1, 2, 0)
        return paths

    def _normal(self, *shape: int) -> Tensor:
        return torch.randn(shape, generator=self._generator, device=self._device)
