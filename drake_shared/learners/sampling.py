"""What an iteration of training is shown: lines 6 to 9 of Alg. 1, for a batch of demonstrations at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from drake_shared.learners.blending import make_blend
from drake_shared.learners.parameters import TrainingParameters

ENOUGH, HELD_OUT = 60, 0.1
"""From so many demonstrations on, this share of them is held out."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """B demonstrations with M observations in all and Q queries each, in normalised units.

    Attributes:
        observations: Shape (M, F + 2), time features and position.
        owners: Shape (M,), which demonstration each is of, ascending.
        queries: Shape (Q, F), time features.
        truth: Shape (B, Q, 2), where the demonstrations are at the queries.
        lean: Shape (B, 1, 1), weight of each demonstration in the mean's loss; 1 on average.
    """

    observations: Tensor
    owners: Tensor
    queries: Tensor
    truth: Tensor
    lean: Tensor


class Sampler:
    """Draws batches.

    Args:
        paths: Shape (m, N, 2), demonstrations in normalised units.
        features: Shape (N, F), time features of the grid.
        weights: Shape (m,), Pd of Alg. 1, summing to 1.
        unit: What "relative" lengths of the parameters are in, in normalised units.
        parameters: Decide how.
        seed: Of everything drawn.
    """

    def __init__(
        self,
        *,
        paths: NDArray[np.float64],
        features: Tensor,
        weights: NDArray[np.float64],
        unit: float,
        parameters: TrainingParameters,
        seed: int,
    ) -> None:
        self._parameters = parameters
        self._paths = torch.tensor(paths, dtype=torch.float32)
        self._features = features
        self._weights = torch.tensor(weights * len(weights), dtype=torch.float32)
        self._noise = parameters.noise * unit
        self._generator = torch.Generator().manual_seed(seed)
        self._shares: Tensor | None = None
        if parameters.blending > 0.0 and len(paths) > 1:
            shares, gains = make_blend(paths, reach=parameters.blending * unit, widening=parameters.widening)
            self._shares = torch.tensor(shares, dtype=torch.float32)
            self._spreads = torch.tensor(np.sqrt(shares) * gains[:, None], dtype=torch.float32)

    def draw(self) -> Batch:
        """The next batch."""
        p, generator = self._parameters, self._generator
        count, steps = self._paths.shape[:2]
        if p.even_spread:
            chosen = torch.randint(count, (p.batch,), generator=generator)
            lean = self._weights[chosen][:, None, None]
        else:
            chosen = torch.multinomial(self._weights, p.batch, replacement=True, generator=generator)
            lean = torch.ones(1, 1, 1)
        paths = self._blended(chosen)
        number = torch.randint(1, p.observations + 1, (p.batch,), generator=generator)
        number[: int(p.single_share * p.batch)] = 1
        # torch's own repeat_interleave takes a third of the time of a whole iteration.
        owners = torch.from_numpy(np.repeat(np.arange(p.batch), number.numpy()))
        when = torch.randint(steps, (len(owners),), generator=generator)
        seen = paths[owners, when]
        if self._noise > 0.0:
            seen = seen + self._noise * torch.randn(seen.shape, generator=generator)
        asked = torch.randint(steps, (p.queries,), generator=generator)
        return Batch(
            observations=torch.cat([self._features[when], seen], dim=-1),
            owners=owners,
            queries=self._features[asked],
            truth=paths[:, asked],
            lean=lean,
        )

    def _blended(self, chosen: Tensor) -> Tensor:
        """Demonstrations of the way of each of those chosen, shape (B, N, 2); see `make_blend`."""
        if self._shares is None:
            return self._paths[chosen]
        strays = torch.randn((len(chosen), len(self._paths)), generator=self._generator)
        strays *= self._spreads[chosen]
        parts = self._shares[chosen] * (1.0 - strays.sum(dim=1, keepdim=True)) + strays
        return (parts @ self._paths.flatten(start_dim=1)).view(len(chosen), *self._paths.shape[1:])


def hold_out(count: int, seed: int) -> NDArray[np.bool_]:
    """Which of ``count`` demonstrations are held out, shape (m,): a tenth, if there are 60 or more."""
    chosen = np.zeros(count, dtype=bool)
    if count >= ENOUGH:
        chosen[np.random.default_rng(seed).permutation(count)[: round(HELD_OUT * count)]] = True
    return chosen
