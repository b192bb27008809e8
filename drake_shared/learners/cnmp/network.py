"""The network of the CNMP in torch, for training alone: several of them, computed as one."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn

from drake_shared.learners.cnmp.model import Layer

TorchLayer = tuple[Tensor, Tensor]
"""Weights (E, inputs, outputs) and biases (E, 1, outputs)."""


class CnmpNetwork:
    """Encoder, aggregation of the observations' codes, decoder: E networks of one shape.

    Networks as small as these keep a processor waiting for its instructions; E of them in one batched product
    cost far less than E times one.

    Args:
        features: Number F of time features.
        encoder: Widths of the encoder's layers; the last is a code's size C.
        aggregation: "mean" or "bayesian"; see `aggregate`.
        decoder: Widths of the decoder's hidden layers.
        seeds: Of the first weights of each network.
    """

    def __init__(
        self,
        *,
        features: int,
        encoder: Sequence[int],
        aggregation: str,
        decoder: Sequence[int],
        seeds: Sequence[int],
    ) -> None:
        self.aggregation = aggregation
        shapes = ([features + 2, *encoder], [encoder[-1] + features, *decoder, 4])
        made = []
        for seed in seeds:
            with torch.random.fork_rng(devices=[]):
                torch.manual_seed(seed)
                made.append([_first_layers(widths) for widths in shapes])
        self._encoder, ((weights, bias), *rest) = (_stacked([one[part] for one in made]) for part in (0, 1))
        # The decoder's first layer in two parts: the code's product is the same for every query, and the
        # gradients of parts of one tensor would be put together anew in each iteration.
        self._of_code, self._of_time = (_leaf(part) for part in weights.split([encoder[-1], features], dim=1))
        self._bias, self._rest = bias, rest

    def parameters(self) -> list[Tensor]:
        """All weights and biases."""
        layers = [tensor for layer in (*self._encoder, *self._rest) for tensor in layer]
        return [*layers, self._of_code, self._of_time, self._bias]

    def __call__(self, observations: Tensor, owners: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
        """Predicts, in normalised units.

        Args:
            observations: Shape (E, M, F + 2), time features and position of each.
            owners: Shape (M,), which of the B samples each belongs to: ascending, from 0, none left out.
            queries: Shape (Q, F), time features.

        Returns:
            Mean and softplus spread (before the floor is added), shapes (E, B, Q, 2).
        """
        codes = _apply(self._encoder, observations)
        code = aggregate(codes, owners, self.aggregation)
        of_code = code @ self._of_code
        of_time = queries @ self._of_time + self._bias
        hidden = torch.relu(of_code[:, :, None, :] + of_time[:, None])
        raw = _apply(self._rest, hidden.flatten(1, 2)).view(*hidden.shape[:3], 4)
        return raw[..., :2], nn.functional.softplus(raw[..., 2:])

    def only(self, index: int) -> CnmpNetwork:
        """The network at ``index`` by itself, as it is now."""
        part = object.__new__(CnmpNetwork)
        part.aggregation = self.aggregation

        def own(tensor: Tensor) -> Tensor:
            return tensor[index : index + 1].detach().clone()

        part._encoder, part._rest = (
            [(own(weights), own(bias)) for weights, bias in layers] for layers in (self._encoder, self._rest)
        )
        part._of_code, part._of_time, part._bias = map(own, (self._of_code, self._of_time, self._bias))
        return part

    def export(self, index: int = 0) -> tuple[list[Layer], list[Layer]]:
        """Encoder and decoder of the network at ``index`` as numpy weights (inputs, outputs) and biases."""
        first = (torch.cat([self._of_code, self._of_time], dim=1), self._bias)
        return (
            [_numpy(weights[index], bias[index, 0]) for weights, bias in self._encoder],
            [_numpy(weights[index], bias[index, 0]) for weights, bias in (first, *self._rest)],
        )


def aggregate(codes: Tensor, owners: Tensor, aggregation: str) -> Tensor:
    """One code for all observations of a sample, shape (E, B, C), from codes (E, M, C).

    "mean" is their mean. "bayesian" takes half of a code as what an observation says of a latent variable and
    half as the precision with which it says so (Volpp et al. 2021): the result is the posterior mean and
    variance of that variable, from a prior of mean 0 and variance 1.
    """
    count = int(owners[-1]) + 1

    def total(values: Tensor) -> Tensor:
        return values.new_zeros(len(values), count, values.shape[-1]).index_add_(1, owners, values)

    if aggregation == "mean":
        return total(codes) / torch.bincount(owners, minlength=count)[:, None]
    said, raw = codes.chunk(2, dim=-1)
    precision = nn.functional.softplus(raw)
    variance = 1.0 / (1.0 + total(precision))
    return torch.cat([variance * total(precision * said), variance], dim=-1)


def _first_layers(widths: Sequence[int]) -> list[nn.Linear]:
    return [nn.Linear(a, b) for a, b in itertools.pairwise(widths)]


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
    """A tensor of its own that gradients are asked for."""
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
