"""The loss: how unlikely the truth is, with the mean and the spread each learnt from what it should be."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def beta_nll(
    mean: Tensor, sigma: Tensor, truth: Tensor, *, lean: Tensor, beta: float
) -> tuple[Tensor, Tensor]:
    """Negative log-likelihood, its terms weighted by sigma^(2 beta).

    With beta = 0 it is line 12 of Alg. 1, which gets stuck where routes cross: sigma widens, the gradient of
    the mean is divided by its square and dies. Weighting each term by the detached sigma to the power 2 beta
    gives it back (Seitzer et al. 2022, beta-NLL).

    What a driver may want and what is desirable are two things: ``lean`` weighs the demonstrations for the
    mean, while sigma sees all alike and so covers also those that the mean leans away from.

    Args:
        mean, sigma, truth: Shape (E, B, Q, 2), of E learners.
        lean: Shape (E, B, 1, 1).
        beta: From 0 to 1.

    Returns:
        What to minimise, the sum over learners, whose value means nothing (the square counts twice, for
        either gradient); and of each learner the plain negative log-likelihood per point (over x and y), in
        nats, shape (E,).
    """
    fixed = sigma.detach()
    error = truth - mean
    of_sigma = sigma.log() + 0.5 * (error.detach() / sigma).square()
    terms = 0.5 * lean * (error / fixed).square() + of_sigma
    if beta > 0.0:
        terms = terms * fixed ** (2.0 * beta)
    with torch.no_grad():
        nll = of_sigma.detach().sum(dim=-1).mean(dim=(1, 2)) + math.log(2.0 * math.pi)
    return terms.sum(dim=-1).mean(dim=(1, 2)).sum(), nll
