"""The network of the CNMP in torch, for training: several of them, computed as one."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn

from drake_shared.learners.fields import Layer


class CnmpNetworks(nn.Module):
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
        super().__init__()
        self._aggregation, self._size = aggregation, positions
        shapes = ([features + positions, *encoder], [encoder[-1] + features, *decoder, 2 * positions])
        made = []
        for seed in seeds:
            with torch.random.fork_rng(devices=[]):
                torch.manual_seed(seed)
                made.append([[nn.Linear(a, b) for a, b in itertools.pairwise(widths)] for widths in shapes])
        encoders, ((weights, bias), *rest) = (_stacked([one[part] for one in made]) for part in (0, 1))
        # The decoder's first layer in two parts: the code's product is the same for every query, and the
        # gradients of parts of one tensor would be assembled in each iteration.
        of_code, of_time = torch.split(weights, [encoder[-1], features], dim=1)
        self._encoder = nn.ModuleList(_Layer(*layer) for layer in encoders)
        self._of_code, self._of_time, self._bias = map(_parameter, (of_code, of_time, bias))
        self._rest = nn.ModuleList(_Layer(*layer) for layer in rest)

    def keep(self, indices: Sequence[int]) -> None:
        """Drops all networks but those at ``indices``; `parameters` are others afterwards."""
        for module in self.modules():
            for name, tensor in list(module.named_parameters(recurse=False)):
                setattr(module, name, _parameter(tensor[list(indices)]))

    def forward(self, observations: Tensor, samples: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
        """Predicts, in normalized units.

        Args:
            observations: Shape (E, M, F + D), time features and position of each.
            samples: Which of the B samples each observation belongs to; see `aggregate`.
            queries: Shape (Q, F), time features.

        Returns:
            Mean and softplus standard deviation (before the floor is added), shapes (E, B, Q, D).
        """
        code = aggregate(_apply(self._encoder, observations), samples, self._aggregation)
        of_code = code @ self._of_code
        of_time = queries @ self._of_time + self._bias
        hidden = torch.relu_(of_code[:, :, None, :] + of_time[:, None])
        raw = _apply(self._rest, hidden.flatten(1, 2)).view(*hidden.shape[:3], 2 * self._size)
        return raw[..., : self._size], nn.functional.softplus(raw[..., self._size :])

    def export(self, index: int) -> tuple[tuple[Layer, ...], tuple[Layer, ...]]:
        """Encoder and decoder of the network at ``index``, as new numpy weights and biases."""
        first = _numpy(torch.cat([self._of_code, self._of_time], dim=1)[index], self._bias[index])
        encoder, rest = (
            tuple(_numpy(*(tensor[index] for tensor in layer.parameters())) for layer in part)
            for part in (self._encoder, self._rest)
        )
        return encoder, (first, *rest)


class _Layer(nn.Module):
    """A layer of E networks: weights (E, inputs, outputs) and biases (E, 1, outputs)."""

    def __init__(self, weights: Tensor, bias: Tensor) -> None:
        super().__init__()
        self.weights, self.bias = _parameter(weights), _parameter(bias)

    def forward(self, hidden: Tensor) -> Tensor:
        return torch.baddbmm(self.bias, hidden, self.weights)


def aggregate(codes: Tensor, samples: Tensor, aggregation: str) -> Tensor:
    """One code for all observations of a sample, shape (E, B, C).

    See `drake_shared.learners.cnmp.layers.aggregate`.

    Args:
        codes: Shape (E, M, C), of M observations.
        samples: Shape (M,), the sample of each observation, ascending from 0, every sample at least once. Or
            shape (B, m) of a padded batch with M = B m: 1 for an observation, 0 for padding.
        aggregation: "mean" or "bayesian".
    """
    if samples.ndim == 1:
        count = int(samples[-1]) + 1
        number = torch.bincount(samples, minlength=count)
    else:
        number = samples.sum(dim=1)

    def total(values: Tensor) -> Tensor:
        if samples.ndim == 1:
            return values.new_zeros(len(values), count, values.shape[-1]).index_add_(1, samples, values)
        return (values.view(len(values), *samples.shape, -1) * samples[..., None]).sum(dim=2)

    if aggregation == "mean":
        return total(codes) / number[:, None]
    latent, raw = codes.chunk(2, dim=-1)
    precision = nn.functional.softplus(raw)
    variance = 1.0 / (1.0 + total(precision))
    return torch.cat([variance * total(precision * latent), variance], dim=-1)


def _stacked(networks: Sequence[Sequence[nn.Linear]]) -> list[tuple[Tensor, Tensor]]:
    """Weights and biases of the layers of E networks as one."""
    return [
        (
            torch.stack([one.weight.detach().T for one in layer]),
            torch.stack([one.bias.detach()[None] for one in layer]),
        )
        for layer in zip(*networks, strict=True)
    ]


def _parameter(tensor: Tensor) -> nn.Parameter:
    return nn.Parameter(tensor.detach().contiguous())


def _apply(layers: nn.ModuleList, hidden: Tensor) -> Tensor:
    for index, layer in enumerate(layers):
        hidden = layer(hidden)
        if index < len(layers) - 1:
            hidden = torch.relu_(hidden)
    return hidden


def _numpy(weights: Tensor, bias: Tensor) -> Layer:
    return (
        np.array(weights.detach().cpu().numpy(), dtype=np.float32, order="C"),
        np.array(bias[0].detach().cpu().numpy(), dtype=np.float32),
    )
