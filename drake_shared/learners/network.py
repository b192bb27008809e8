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
    """Encoder, mean over the observations, decoder.

    Args:
        features: Number F of time features.
        encoder: Widths of the encoder's layers; the last is the representation's size R.
        decoder: Widths of the decoder's hidden layers.
    """

    def __init__(self, *, features: int, encoder: Sequence[int], decoder: Sequence[int]) -> None:
        super().__init__()
        self.encoder = _layers([features + 2, *encoder])
        self.decoder = _layers([encoder[-1] + features, *decoder, 4])

    def forward(self, observations: Tensor, mask: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
        """Predicts, in normalised units.

        Args:
            observations: Shape (B, n, F + 2), time features and position of each.
            mask: Shape (B, n), 1 where there is one, else 0.
            queries: Shape (B, Q, F) or (Q, F), time features.

        Returns:
            Mean and softplus spread (before the floor is added), shapes (B, Q, 2).
        """
        codes = _apply(list(self.encoder), observations)
        code = (codes * mask[..., None]).sum(dim=1) / mask.sum(dim=1, keepdim=True)
        # The first layer's two parts, apart: the code's is the same for every query.
        first, *rest = self.decoder
        assert isinstance(first, nn.Linear)
        size = code.shape[-1]
        hidden = nn.functional.linear(queries, first.weight[:, size:], first.bias)
        hidden = hidden + nn.functional.linear(code, first.weight[:, :size])[:, None, :]
        raw = _apply(rest, torch.relu(hidden))
        return raw[..., :2], nn.functional.softplus(raw[..., 2:])

    def export(self) -> tuple[list[Layer], list[Layer]]:
        """Encoder and decoder as numpy weights (inputs, outputs) and biases."""
        return [_numpy(layer) for layer in self.encoder], [_numpy(layer) for layer in self.decoder]


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
