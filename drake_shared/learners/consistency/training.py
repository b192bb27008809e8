"""Training of a consistency model: a denoiser first, from which it is distilled. Needs torch.

As the authors of consistency shared autonomy do (see `drake_shared.arbitration.consistency`): a denoiser is
trained by the objective of Karras et al. 2022, then a consistency function by distillation with Heun's method
(Song et al. 2023, algorithm 2).
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from drake_shared.common.arrays import path_at
from drake_shared.learners.cnmp.training import fast_training
from drake_shared.learners.consistency.model import (
    DATA_SPREAD,
    LOG_SCALE,
    ConsistencyModel,
    consistency_scalings,
    denoiser_scalings,
    noise_level,
    position_features,
)
from drake_shared.learners.dataset import scale_of

Floats = NDArray[np.float64]
Scalings = Callable[[Tensor], tuple[Tensor, Tensor, Tensor]]

_HIDDEN = (96, 96, 96)
_SAMPLES, _BATCH = 20_000, 256
_ITERATIONS = 800
_LEARNING_RATE = 4e-3
# Noise levels of the distillation, and the decay of the target network.
_LEVELS, _DECAY = 30, 0.95
# Standard deviation of the displacements from which the way back is learnt, relative to the spread of the
# demonstrations.
_DISPLACEMENT = 0.4


def demonstrated_actions(
    paths: Floats, grid: Floats, *, horizon: float, seed: int = 0
) -> tuple[Floats, Floats]:
    """Positions and demonstrated actions (n, D) there, both in [m].

    The positions are displaced from the demonstrated ones, and an action leads from there to where the
    demonstration is after the horizon: a driver who is off every demonstration needs an action too.

    Args:
        paths: Shape (m, N, D), in [m].
        grid: Shape (N,), times of the positions, in [s].
        horizon: Time in which an action leads to its displacement, in [s].
        seed: Of the samples.
    """
    random = np.random.default_rng(seed)
    ahead = np.stack([path_at(path, grid, grid + horizon) for path in paths])
    chosen = random.integers(paths.shape[0] * paths.shape[1], size=_SAMPLES)
    now, then = (array.reshape(-1, paths.shape[2])[chosen] for array in (paths, ahead))
    spread, _ = scale_of(paths)
    positions = now + _DISPLACEMENT * spread * random.standard_normal(now.shape)
    return positions, then - positions


def train_consistency(
    positions: Floats, actions: Floats, *, seed: int = 0, iterations: int = _ITERATIONS
) -> ConsistencyModel:
    """Trains a consistency model of the actions at positions.

    Args:
        positions: Shape (n, D), in [m].
        actions: Shape (n, D), in [m].
        seed: Of the network and the noise.
        iterations: Of the denoiser, and as many of the distillation.
    """
    low, high = positions.min(axis=0), positions.max(axis=0)
    origin, extent = 0.5 * (low + high), float(0.5 * (high - low).max())
    mean = actions.mean(axis=0)
    scale = float(np.sqrt(np.square(actions - mean).mean())) / DATA_SPREAD
    place = torch.from_numpy(position_features((positions - origin) / extent)).float()
    clean = torch.from_numpy((actions - mean) / scale).float()
    with fast_training(), torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        denoiser = _network(place.shape[1], clean.shape[1])
        _fit_denoiser(denoiser, place, clean, iterations)
        network = _distilled(denoiser, place, clean, iterations)
    linear = [layer for layer in network if isinstance(layer, nn.Linear)]
    return ConsistencyModel(
        layers=tuple((one.weight.detach().numpy().T.copy(), one.bias.detach().numpy()) for one in linear),
        origin=origin,
        extent=extent,
        mean=mean,
        scale=scale,
    )


def _network(features: int, size: int) -> nn.Sequential:
    widths = (size + 1 + features, *_HIDDEN)
    hidden = [(nn.Linear(a, b), nn.ReLU()) for a, b in itertools.pairwise(widths)]
    return nn.Sequential(*itertools.chain(*hidden), nn.Linear(widths[-1], size))


def _apply(network: nn.Module, scalings: Scalings, noisy: Tensor, noise: Tensor, place: Tensor) -> Tensor:
    """Denoised actions (B, D) of noisy ones with noise levels (B, 1)."""
    skip, out, inner = scalings(noise)
    added: Tensor = network(torch.cat([inner * noisy, LOG_SCALE * noise.log(), place], dim=1))
    return skip * noisy + out * added


def _fit_denoiser(network: nn.Module, place: Tensor, clean: Tensor, iterations: int) -> None:
    """Trains the network as the denoiser of least squared error."""

    def loss(rows: Tensor) -> Tensor:
        own = clean[rows]
        noise = noise_level(torch.rand(len(rows), 1))
        noisy = own + noise * torch.randn_like(own)
        out: Tensor = denoiser_scalings(noise)[1]
        error = _apply(network, denoiser_scalings, noisy, noise, place[rows]) - own
        return (error / out).square().mean()

    _optimize(network, loss, len(clean), iterations)


def _distilled(teacher: nn.Sequential, place: Tensor, clean: Tensor, iterations: int) -> nn.Sequential:
    """The consistency function of the denoiser's probability flow."""
    network, target = copy.deepcopy(teacher), copy.deepcopy(teacher)
    levels = noise_level(torch.linspace(0.0, 1.0, _LEVELS))[:, None]

    def slope(noisy: Tensor, noise: Tensor, there: Tensor) -> Tensor:
        return (noisy - _apply(teacher, denoiser_scalings, noisy, noise, there)) / noise

    def loss(rows: Tensor) -> Tensor:
        own, there = clean[rows], place[rows]
        index = torch.randint(1, _LEVELS, (len(rows),))
        noise, less = levels[index], levels[index - 1]
        noisy = own + noise * torch.randn_like(own)
        with torch.no_grad():
            first = slope(noisy, noise, there)
            euler = noisy + (less - noise) * first
            before = noisy + 0.5 * (less - noise) * (first + slope(euler, less, there))
            wanted = _apply(target, consistency_scalings, before, less, there)
            for own_weights, weights in zip(target.parameters(), network.parameters(), strict=True):
                own_weights.lerp_(weights, 1.0 - _DECAY)
        return (_apply(network, consistency_scalings, noisy, noise, there) - wanted).square().mean()

    _optimize(network, loss, len(clean), iterations)
    return network


def _optimize(network: nn.Module, loss: Callable[[Tensor], Tensor], count: int, iterations: int) -> None:
    """Minimizes the loss of random rows, of which there are ``count``."""
    optimizer = torch.optim.Adam(network.parameters(), foreach=True)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, _LEARNING_RATE, total_steps=iterations)
    for _ in range(iterations):
        optimizer.zero_grad()
        loss(torch.randint(count, (_BATCH,))).backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        schedule.step()
