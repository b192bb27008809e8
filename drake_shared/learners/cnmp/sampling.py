"""What an iteration of training is shown: lines 6 to 9 of Alg. 1, for a batch of demonstrations at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from drake_shared.learners.augmentation import left_unknown, make_blend, wander_basis
from drake_shared.learners.cnmp.parameters import TrainingParameters

ENOUGH, HELD_OUT = 60, 0.1
"""From so many demonstrations on, this share of them is held out."""
DRAWN = 128
"""So many samples are drawn at a time, in one batch or more: to draw one costs no less than a hundred."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """For each of E learners B demonstrations with M observations in all and Q queries each, normalised.

    Attributes:
        observations: Shape (E, M, F + 2), time features and position.
        owners: Shape (M,), which demonstration each is of, ascending.
        queries: Shape (Q, F), time features.
        truth: Shape (E, B, Q, 2), where the demonstrations are at the queries.
        lean: Shape (E, B, 1, 1), weight of each demonstration in the mean's loss; 1 on average.
    """

    observations: Tensor
    owners: Tensor
    queries: Tensor
    truth: Tensor
    lean: Tensor


@dataclass(frozen=True, kw_only=True, eq=False)
class Lesson:
    """What one learner is taught.

    Attributes:
        paths: Shape (m, N, 2), demonstrations in normalised units.
        weights: Shape (m,), Pd of Alg. 1, summing to 1.
        unit: What "relative" lengths of the parameters are in, in normalised units.
        seed: Of what is drawn for this learner.
    """

    paths: NDArray[np.float64]
    weights: NDArray[np.float64]
    unit: float
    seed: int


class Sampler:
    """Draws batches.

    When observations and queries are, and how many, is common to all learners; which demonstrations and what
    noise is each one's own. So what a learner is shown does not depend on its company.

    Args:
        lessons: Of each learner, on one grid.
        features: Shape (N, F), time features of the grid.
        parameters: Decide how.
    """

    def __init__(self, lessons: Sequence[Lesson], features: Tensor, parameters: TrainingParameters) -> None:
        self._parameters = parameters
        self._features = features
        self._pupils = [_Pupil(lesson, parameters) for lesson in lessons]
        self._batches = self._draw()

    def draw(self) -> Batch:
        """The next batch."""
        return next(self._batches)

    def _draw(self) -> Iterator[Batch]:
        p, steps = self._parameters, len(self._features)
        generator = torch.Generator().manual_seed(0)
        batches = max(1, DRAWN // p.batch)
        rows = batches * p.batch
        while True:
            number = torch.randint(1, p.observations + 1, (batches, p.batch), generator=generator)
            number[:, : int(p.single_share * p.batch)] = 1
            # torch's own repeat_interleave takes a third of the time of a whole iteration.
            owners = torch.from_numpy(np.repeat(np.arange(rows), number.flatten().numpy()))
            when = torch.randint(steps, (len(owners),), generator=generator)
            asked = torch.randint(steps, (batches, p.queries), generator=generator)
            drawn = [pupil.draw(rows, owners, when) for pupil in self._pupils]
            paths, seen, lean = (torch.stack(parts) for parts in zip(*drawn, strict=True))
            told = self._features[when].expand(len(seen), -1, -1)
            observations = torch.cat([told, seen], dim=-1)
            end = 0
            for batch, count in enumerate(number.sum(dim=1).tolist()):
                begin, end = end, end + count
                first = batch * p.batch
                chosen = slice(first, first + p.batch)
                yield Batch(
                    observations=observations[:, begin:end],
                    owners=owners[begin:end] - first,
                    queries=self._features[asked[batch]],
                    truth=paths[:, chosen, asked[batch]],
                    lean=lean[:, chosen, None, None],
                )


class _Pupil:
    """One learner's own part in what is drawn."""

    def __init__(self, lesson: Lesson, parameters: TrainingParameters) -> None:
        paths, weights = lesson.paths, lesson.weights
        self._even = parameters.even_spread
        self._paths = torch.tensor(paths, dtype=torch.float32)
        self._weights = torch.tensor(weights * len(weights), dtype=torch.float32)
        self._noise = parameters.noise * lesson.unit
        self._generator = torch.Generator().manual_seed(lesson.seed)
        self._shares: Tensor | None = None
        if parameters.blending > 0.0:
            reach = parameters.blending * lesson.unit
            shares, gains = make_blend(paths, reach=reach, widening=parameters.widening)
            self._shares = torch.tensor(shares, dtype=torch.float32)
            self._spreads = torch.tensor(np.sqrt(shares) * gains[:, None], dtype=torch.float32)
            unknown = parameters.wandering * lesson.unit * left_unknown(shares)
            self._wandering = torch.tensor(unknown, dtype=torch.float32)
            self._wander = torch.tensor(wander_basis(paths.shape[1]), dtype=torch.float32)

    def draw(self, rows: int, owners: Tensor, when: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Demonstrations (rows, N, 2), what is seen of their ``owners`` (M, 2), and their lean (rows,)."""
        generator = self._generator
        if self._even:
            chosen = torch.randint(len(self._paths), (rows,), generator=generator)
            lean = self._weights[chosen]
        else:
            chosen = torch.multinomial(self._weights, rows, replacement=True, generator=generator)
            lean = torch.ones(rows)
        paths = self._blended(chosen)
        seen = paths[owners, when]
        if self._noise > 0.0:
            seen = seen + self._noise * torch.randn(seen.shape, generator=generator)
        return paths, seen, lean

    def _blended(self, chosen: Tensor) -> Tensor:
        """Demonstrations of the way of each of those chosen, shape (rows, N, 2); see `make_blend`."""
        if self._shares is None:
            return self._paths[chosen]
        strays = torch.randn((len(chosen), len(self._paths)), generator=self._generator)
        strays *= self._spreads[chosen]
        parts = self._shares[chosen] * (1.0 - strays.sum(dim=1, keepdim=True)) + strays
        paths = (parts @ self._paths.flatten(start_dim=1)).view(len(chosen), *self._paths.shape[1:])
        if (self._wandering > 0.0).any():
            amounts = torch.randn((2, len(chosen), len(self._wander)), generator=self._generator)
            paths += (self._wandering[chosen, None] * (amounts @ self._wander)).permute(1, 2, 0)
        return paths


def hold_out(count: int, seed: int) -> NDArray[np.bool_]:
    """Which of ``count`` demonstrations are held out, shape (m,): a tenth, if there are 60 or more."""
    chosen = np.zeros(count, dtype=bool)
    if count >= ENOUGH:
        chosen[np.random.default_rng(seed).permutation(count)[: round(HELD_OUT * count)]] = True
    return chosen
