"""A plain CNMP as published, trained as public codes train it: what the benchmark compares our training with.

Network 3-128-128-128 and 129-128-128-4 on time, x and y, each scaled to 0..1 or -1..1; a batch of 32
demonstrations; 1 to 10 observations and 10 queries of each, drawn evenly; plain negative log-likelihood; Adam
with a constant learning rate. No noise, no Fourier features, no schedule.
"""

from __future__ import annotations

import itertools
import time

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

BATCH = 32
MOST_OBSERVATIONS = 10
QUERIES = 10


class PublishedCnmp:
    """The network and its training.

    Args:
        positions: Demonstrations on one grid of times, shape (m, N, 2), in [m].
        learning_rate: Of Adam.
        seed: Of the weights and of what is drawn.
    """

    def __init__(self, positions: NDArray[np.float64], *, learning_rate: float, seed: int) -> None:
        corners = positions.reshape(-1, 2)
        self._middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        self._scale = 0.5 * float(np.ptp(corners, axis=0).max()) or 1.0
        self._paths = torch.tensor((positions - self._middle) / self._scale, dtype=torch.float32)
        self._times = torch.linspace(0.0, 1.0, positions.shape[1])
        self._draw = torch.Generator().manual_seed(seed)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.encoder = _network(3, 128, 128, 128)
            self.decoder = _network(129, 128, 128, 4)
        weights = [*self.encoder.parameters(), *self.decoder.parameters()]
        self._optimiser = torch.optim.Adam(weights, lr=learning_rate)
        self.iterations = 0

    def train(self, seconds: float) -> float:
        """Trains on for so many CPU seconds of this process, and says how many it took."""
        begun = time.process_time()
        while (spent := time.process_time() - begun) < seconds:
            self._step()
        return spent

    def predict(
        self, steps: NDArray[np.intp], positions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean (B, N, 2), in [m], and variance (B, N, 2), in [m^2], for one observation each of B cases.

        Args:
            steps: Shape (B,), at which step of the grid each was made.
            positions: Shape (B, 2), in [m].
        """
        seen = torch.tensor((positions - self._middle) / self._scale, dtype=torch.float32)
        observed = torch.cat([self._times[torch.as_tensor(steps)][:, None], seen], dim=1)[:, None, :]
        with torch.no_grad():
            mean, sigma = self._forward(
                observed, torch.ones(len(observed), 1), self._times.expand(len(observed), -1)
            )
        return (
            mean.numpy().astype(float) * self._scale + self._middle,
            np.square(sigma.numpy().astype(float) * self._scale),
        )

    def _step(self) -> None:
        count, length = self._paths.shape[:2]
        demonstration = torch.randint(count, (BATCH, 1), generator=self._draw)
        number = torch.randint(1, MOST_OBSERVATIONS + 1, (BATCH, 1), generator=self._draw)
        mask = (torch.arange(MOST_OBSERVATIONS) < number).float()
        when = torch.randint(length, (BATCH, MOST_OBSERVATIONS), generator=self._draw)
        asked = torch.randint(length, (BATCH, QUERIES), generator=self._draw)
        observed = torch.cat([self._times[when][..., None], self._paths[demonstration, when]], dim=-1)
        mean, sigma = self._forward(observed, mask, self._times[asked])
        loss = -torch.distributions.Normal(mean, sigma).log_prob(self._paths[demonstration, asked]).mean()
        self._optimiser.zero_grad()
        loss.backward()
        self._optimiser.step()
        self.iterations += 1

    def _forward(self, observed: Tensor, mask: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
        codes = self.encoder(observed) * mask[..., None]
        code = codes.sum(dim=1) / mask.sum(dim=1, keepdim=True)
        beside = code[:, None, :].expand(-1, queries.shape[1], -1)
        raw = self.decoder(torch.cat([beside, queries[..., None]], dim=-1))
        return raw[..., :2], nn.functional.softplus(raw[..., 2:]) + 1e-6


def _network(*widths: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for inputs, outputs in itertools.pairwise(widths):
        layers += [nn.Linear(inputs, outputs), nn.ReLU()]
    return nn.Sequential(*layers[:-1])
