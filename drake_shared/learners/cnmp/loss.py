"""The loss: a negative log-likelihood with separate gradients for mean and standard deviation."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def beta_nll(
    mean: Tensor, sigma: Tensor, truth: Tensor, *, weights: Tensor, beta: float
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
    if beta > 0.0:
        terms = terms * fixed ** (2.0 * beta)
    with torch.no_grad():
        constant = 0.5 * mean.shape[-1] * math.log(2.0 * math.pi)
        nll = of_sigma.detach().sum(dim=-1).mean(dim=(1, 2)) + constant
    return terms.sum(dim=-1).mean(dim=(1, 2)).sum(), nll
