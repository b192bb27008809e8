"""The network of the CNMP in torch, for training alone."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]


class CnmpNetwork(nn.Module):
    """Encoder, aggregation of the observations' codes, decoder.

    Args:
        features: Number F of time features.
        encoder: Widths of the encoder's layers; the last is a code's size C.
        aggregation: "mean" or "bayesian"; see `aggregate`.
        decoder: Widths of the decoder's hidden layers.
    """

    def __init__(
        self, *, features: int, encoder: Sequence[int], aggregation: str, decoder: Sequence[int]
    ) -> None:
        super().__init__()
        self.aggregation = aggregation
        self.encoder = _layers([features + 2, *encoder])
        self.decoder = _layers([encoder[-1] + features, *decoder, 4])

    def forward(self, observations: Tensor, owners: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
        """Predicts, in normalised units.

        Args:
            observations: Shape (M, F + 2), time features and position of each.
            owners: Shape (M,), which of the B samples each belongs to: ascending, from 0, none left out.
            queries: Shape (Q, F), time features.

        Returns:
            Mean and softplus spread (before the floor is added), shapes (B, Q, 2).
        """
        codes = _apply(list(self.encoder), observations)
        code = aggregate(codes, owners, self.aggregation)
        # The first layer's two parts, apart: the code's is the same for every query.
        first, *rest = self.decoder
        assert isinstance(first, nn.Linear)
        size = code.shape[-1]
        of_code = nn.functional.linear(code, first.weight[:, :size])
        of_time = nn.functional.linear(queries, first.weight[:, size:], first.bias)
        raw = _apply(rest, torch.relu(of_code[:, None, :] + of_time))
        return raw[..., :2], nn.functional.softplus(raw[..., 2:])

    def export(self) -> tuple[list[Layer], list[Layer]]:
        """Encoder and decoder as numpy weights (inputs, outputs) and biases."""
        return [_numpy(layer) for layer in self.encoder], [_numpy(layer) for layer in self.decoder]


def aggregate(codes: Tensor, owners: Tensor, aggregation: str) -> Tensor:
    """One code for all observations of a sample, shape (B, C), from codes (M, C).

    "mean" is their mean. "bayesian" takes half of a code as what an observation says of a latent variable and
    half as the precision with which it says so (Volpp et al. 2021): the result is the posterior mean and
    variance of that variable, from a prior of mean 0 and variance 1.
    """
    count = int(owners[-1]) + 1

    def total(values: Tensor) -> Tensor:
        return values.new_zeros(count, values.shape[1]).index_add_(0, owners, values)

    if aggregation == "mean":
        return total(codes) / torch.bincount(owners, minlength=count)[:, None]
    said, raw = codes.chunk(2, dim=1)
    precision = nn.functional.softplus(raw)
    variance = 1.0 / (1.0 + total(precision))
    return torch.cat([variance * total(precision * said), variance], dim=1)


def _layers(widths: Sequence[int]) -> nn.ModuleList:
    return nn.ModuleList(nn.Linear(a, b) for a, b in itertools.pairwise(widths))


def _apply(layers: Sequence[nn.Module], hidden: Tensor) -> Tensor:
    for index, layer in enumerate(layers):
        hidden = layer(hidden)
        if index < len(layers) - 1:
            hidden = torch.relu(hidden)
    return hidden


def _numpy(layer: nn.Module) -> Layer:
    assert isinstance(layer, nn.Linear)
    weight, bias = layer.weight.detach().numpy(), layer.bias.detach().numpy()
    return np.ascontiguousarray(weight.T, dtype=np.float32), bias.astype(np.float32, copy=True)
