"""The network of the CNMP in torch, for training: several of them, computed as one."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn

from drake_shared.learners.fields import Layer

TorchLayer = tuple[Tensor, Tensor]
"""Weights (E, inputs, outputs) and biases (E, 1, outputs)."""


class CnmpNetwork:
    """Encoder, aggregation of the observations' codes, decoder: E networks of one shape.

    For networks as small as these the overhead of calls dominates; E of them in one batched product cost far
    less than E times one.

    Args:
        features: Number F of time features.
        positions: Size D of a position.
        encoder: Widths of the encoder's layers; the last is a code's size C.
        aggregation: "mean" or "bayesian"; see `aggregate`.
        decoder: Widths of the decoder's hidden layers.
        seeds: Of the initial weights of each network.
    """

    def __init__(
        self,
        *,
        features: int,
        positions: int,
        encoder: Sequence[int],
        aggregation: str,
        decoder: Sequence[int],
        seeds: Sequence[int],
    ) -> None:
        self._aggregation, self._size = aggregation, positions
        shapes = ([features + positions, *encoder], [encoder[-1] + features, *decoder, 2 * positions])
        made = []
        for seed in seeds:
            with torch.random.fork_rng(devices=[]):
                torch.manual_seed(seed)
                made.append([[nn.Linear(a, b) for a, b in itertools.pairwise(widths)] for widths in shapes])
        self._encoder, ((weights, bias), *rest) = (_stacked([one[part] for one in made]) for part in (0, 1))
        # The decoder's first layer in two parts: the code's product is the same for every query, and the
        # gradients of parts of one tensor would be assembled in each iteration.
        self._of_code, self._of_time = (
            _leaf(part) for part in torch.split(weights, [encoder[-1], features], dim=1)
        )
        self._bias, self._rest = bias, rest

    def parameters(self) -> list[Tensor]:
        """All weights and biases."""
        layers = [tensor for layer in (*self._encoder, *self._rest) for tensor in layer]
        return [*layers, self._of_code, self._of_time, self._bias]

    def keep(self, indices: Sequence[int]) -> None:
        """Drops all networks but those at ``indices``; `parameters` are others afterwards."""
        chosen = list(indices)
        self._encoder = [(_leaf(weights[chosen]), _leaf(bias[chosen])) for weights, bias in self._encoder]
        self._rest = [(_leaf(weights[chosen]), _leaf(bias[chosen])) for weights, bias in self._rest]
        self._of_code, self._of_time, self._bias = (
            _leaf(tensor[chosen]) for tensor in (self._of_code, self._of_time, self._bias)
        )

    def __call__(self, observations: Tensor, sample_index: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
        """Predicts, in normalized units.

        Args:
            observations: Shape (E, M, F + D), time features and position of each.
            sample_index: Shape (M,), the one of the B samples that each belongs to: ascending, from 0, every
                sample at least once.
            queries: Shape (Q, F), time features.

        Returns:
            Mean and softplus standard deviation (before the floor is added), shapes (E, B, Q, D).
        """
        code = aggregate(_apply(self._encoder, observations), sample_index, self._aggregation)
        of_code = code @ self._of_code
        of_time = queries @ self._of_time + self._bias
        hidden = torch.relu(of_code[:, :, None, :] + of_time[:, None])
        raw = _apply(self._rest, hidden.flatten(1, 2)).view(*hidden.shape[:3], 2 * self._size)
        return raw[..., : self._size], nn.functional.softplus(raw[..., self._size :])

    def export(self, index: int) -> tuple[tuple[Layer, ...], tuple[Layer, ...]]:
        """Encoder and decoder of the network at ``index``, as numpy weights and biases."""
        first = (torch.cat([self._of_code, self._of_time], dim=1), self._bias)
        return (
            tuple(_numpy(weights[index], bias[index, 0]) for weights, bias in self._encoder),
            tuple(_numpy(weights[index], bias[index, 0]) for weights, bias in (first, *self._rest)),
        )


def aggregate(codes: Tensor, sample_index: Tensor, aggregation: str) -> Tensor:
    """One code for all observations of a sample, shape (E, B, C), from codes (E, M, C).

    See `drake_shared.learners.cnmp.layers.aggregate`.
    """
    count = int(sample_index[-1]) + 1

    def total(values: Tensor) -> Tensor:
        return values.new_zeros(len(values), count, values.shape[-1]).index_add_(1, sample_index, values)

    if aggregation == "mean":
        return total(codes) / torch.bincount(sample_index, minlength=count)[:, None]
    latent, raw = codes.chunk(2, dim=-1)
    precision = nn.functional.softplus(raw)
    variance = 1.0 / (1.0 + total(precision))
    return torch.cat([variance * total(precision * latent), variance], dim=-1)


def _stacked(networks: Sequence[Sequence[nn.Linear]]) -> list[TorchLayer]:
    """Layers of E networks as one."""
    return [
        (
            _leaf(torch.stack([one.weight.detach().T for one in layer])),
            _leaf(torch.stack([one.bias.detach()[None] for one in layer])),
        )
        for layer in zip(*networks, strict=True)
    ]


def _leaf(tensor: Tensor) -> Tensor:
    """A copy that is optimized."""
    return tensor.detach().contiguous().requires_grad_()


def _apply(layers: Sequence[TorchLayer], hidden: Tensor) -> Tensor:
    for index, (weights, bias) in enumerate(layers):
        hidden = torch.baddbmm(bias, hidden, weights)
        if index < len(layers) - 1:
            hidden = torch.relu(hidden)
    return hidden


def _numpy(weights: Tensor, bias: Tensor) -> Layer:
    return (
        np.array(weights.detach().numpy(), dtype=np.float32, order="C"),
        np.array(bias.detach().numpy(), dtype=np.float32),
    )
