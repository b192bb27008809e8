"""A plain CNMP, trained as public codes train it, to compare the training of drake_shared with.

Network 3-128-128-128 and 129-128-128-4 on time, x and y, each scaled to [0, 1] or [-1, 1]; batches of 32
demonstrations with 1 to 10 observations and 10 queries each, drawn uniformly; negative log-likelihood; Adam
with a constant learning rate. No noise, Fourier features or schedule.
"""

from __future__ import annotations

import itertools
import time

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

BATCH = 32
MAX_OBSERVATIONS = 10
QUERIES = 10


class PlainCnmp:
    """The network and its training.

    Args:
        paths: Demonstrations on one grid of times: shape (m, N, 2), in [m].
        learning_rate: Of Adam.
        seed: For the initial weights and the samples.
    """

    def __init__(self, paths: NDArray[np.float64], *, learning_rate: float, seed: int) -> None:
        corners = paths.reshape(-1, 2)
        self._middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        self._scale = 0.5 * float(np.ptp(corners, axis=0).max()) or 1.0
        self._paths = torch.tensor((paths - self._middle) / self._scale, dtype=torch.float32)
        self._times = torch.linspace(0.0, 1.0, paths.shape[1])
        self._generator = torch.Generator().manual_seed(seed)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.encoder = _network(3, 128, 128, 128)
            self.decoder = _network(129, 128, 128, 4)
        weights = [*self.encoder.parameters(), *self.decoder.parameters()]
        self._optimizer = torch.optim.Adam(weights, lr=learning_rate)
        self.iterations = 0

    def train(self, seconds: float) -> float:
        """Trains for at least this CPU time of the process, and returns the time that it took, in [s]."""
        start = time.process_time()
        while (spent := time.process_time() - start) < seconds:
            self._step()
        return spent

    def predict(self, steps: NDArray[np.intp], positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean paths (B, N, 2), in [m], for one observation in each of B cases.

        Args:
            steps: Indices on the grid of the observations: shape (B,).
            positions: Shape (B, 2), in [m].
        """
        seen = torch.tensor((positions - self._middle) / self._scale, dtype=torch.float32)
        observed = torch.cat([self._times[torch.as_tensor(steps)][:, None], seen], dim=1)[:, None, :]
        with torch.no_grad():
            mask, queries = torch.ones(len(observed), 1), self._times.expand(len(observed), -1)
            mean, _ = self._forward(observed, mask, queries)
        predicted: NDArray[np.float64] = mean.numpy().astype(float) * self._scale + self._middle
        return predicted

    def _step(self) -> None:
        count, length = self._paths.shape[:2]
        chosen = torch.randint(count, (BATCH, 1), generator=self._generator)
        number = torch.randint(1, MAX_OBSERVATIONS + 1, (BATCH, 1), generator=self._generator)
        mask = (torch.arange(MAX_OBSERVATIONS) < number).float()
        when = torch.randint(length, (BATCH, MAX_OBSERVATIONS), generator=self._generator)
        queried = torch.randint(length, (BATCH, QUERIES), generator=self._generator)
        observed = torch.cat([self._times[when][..., None], self._paths[chosen, when]], dim=-1)
        mean, sigma = self._forward(observed, mask, self._times[queried])
        density = torch.distributions.Normal(mean, sigma)
        loss = -density.log_prob(self._paths[chosen, queried]).mean()  # type: ignore[no-untyped-call]
        self._optimizer.zero_grad()
        loss.backward()
        self._optimizer.step()
        self.iterations += 1

    def _forward(self, observed: Tensor, mask: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
        codes = self.encoder(observed) * mask[..., None]
        code = codes.sum(dim=1) / mask.sum(dim=1, keepdim=True)
        code = code[:, None, :].expand(-1, queries.shape[1], -1)
        raw = self.decoder(torch.cat([code, queries[..., None]], dim=-1))
        return raw[..., :2], nn.functional.softplus(raw[..., 2:]) + 1e-6


def _network(*widths: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for inputs, outputs in itertools.pairwise(widths):
        layers += [nn.Linear(inputs, outputs), nn.ReLU()]
    return nn.Sequential(*layers[:-1])
