"""The objective of training: a negative log-likelihood with separate gradients for mean and deviation."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from drake_shared.learners.cnmp.network import CnmpNetworks


class Objective(nn.Module):
    """What training minimizes, of E learners at once.

    Args:
        networks: Of the learners.
        axes: Shape (E, D), half the extent of each coordinate, normalized.
        position_scale: See `drake_shared.learners.cnmp.parameters.TrainingParameters`.
    """

    def __init__(self, networks: CnmpNetworks, axes: Tensor, position_scale: float | None) -> None:
        super().__init__()
        self.networks = networks
        self._position_scale = position_scale
        self.register_buffer("_axes", axes[:, None].contiguous())

    def predict(self, observations: Tensor, samples: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
        """As the networks predict, with positions scaled by axis if parameters say so."""
        scale, axes = self._position_scale, self.get_buffer("_axes")
        if scale is not None:
            features = observations.shape[-1] - axes.shape[-1]
            time, positions = observations[..., :features], observations[..., features:]
            observations = torch.cat([time, positions * (scale / axes)], dim=-1)
        mean, spread = self.networks(observations, samples, queries)
        return (mean if scale is None else mean * axes[:, None]), spread

    def forward(
        self,
        observations: Tensor,
        samples: Tensor,
        queries: Tensor,
        truth: Tensor,
        weights: Tensor,
        floor: Tensor,
        beta: float | Tensor,
    ) -> tuple[Tensor, Tensor]:
        """`beta_nll` of a batch, with ``floor`` (E, 1, 1, 1) added to the standard deviations."""
        mean, spread = self.predict(observations, samples, queries)
        return beta_nll(mean, spread + floor, truth, weights=weights, beta=beta)


def beta_nll(
    mean: Tensor, sigma: Tensor, truth: Tensor, *, weights: Tensor, beta: float | Tensor
) -> tuple[Tensor, Tensor]:
    """Negative log-likelihood, its terms weighted by sigma^(2 beta).

    With beta = 0 it is line 12 of Alg. 1, which gets stuck where routes cross: sigma grows, and the gradient
    of the mean, which is divided by its square, vanishes. Weighting each term by the detached sigma to the
    power 2 beta restores it (Seitzer et al. 2022, beta-NLL).

    ``weights`` apply to the mean alone. Sigma is learnt from all samples alike, since what a driver may want
    is not only what scores well.

    Args:
        mean, sigma, truth: Shape (E, B, Q, D), of E learners.
        weights: Shape (E, B, 1, 1).
        beta: From 0 to 1.

    Returns:
        The objective, the sum over learners, whose value has no meaning (the square counts twice, once for
        each gradient); and of each learner the plain negative log-likelihood per point (over the D
        coordinates), in nats, shape (E,).
    """
    fixed = sigma.detach()
    error = truth - mean
    of_sigma = sigma.log() + 0.5 * (error.detach() / sigma).square()
    terms = 0.5 * weights * (error / fixed).square() + of_sigma
    terms = terms * fixed ** (2.0 * beta)
    with torch.no_grad():
        constant = 0.5 * mean.shape[-1] * math.log(2.0 * math.pi)
        nll = of_sigma.detach().sum(dim=-1).mean(dim=(1, 2)) + constant
    return terms.sum(dim=-1).mean(dim=(1, 2)).sum(), nll
