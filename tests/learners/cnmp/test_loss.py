"""The loss and its gradients, computed by hand."""

import numpy as np
import pytest
import torch

from drake_shared.learners.cnmp.loss import beta_nll


def tensors(*values: float) -> list[torch.Tensor]:
    return [torch.full((1, 1, 1, 2), value, requires_grad=True) for value in values]


def test_without_beta_gradients_are_those_of_the_negative_log_likelihood():
    mean, sigma, truth = tensors(0.2, 0.5, 1.0)
    loss, nll = beta_nll(mean, sigma, truth, weights=torch.ones(1, 1, 1, 1), beta=0.0)
    expected = 2 * (0.5 * ((1.0 - 0.2) / 0.5) ** 2 + np.log(0.5) + 0.5 * np.log(2 * np.pi))
    assert nll.item() == pytest.approx(expected, rel=1e-6)
    loss.backward()
    np.testing.assert_allclose(mean.grad, -(1.0 - 0.2) / 0.5**2, rtol=1e-5)
    np.testing.assert_allclose(sigma.grad, 1 / 0.5 - (1.0 - 0.2) ** 2 / 0.5**3, rtol=1e-5)


def test_beta_restores_the_gradient_of_the_mean_where_sigma_is_large():
    gradients = []
    for beta in (0.0, 0.5, 1.0):
        mean, sigma, truth = tensors(0.0, 10.0, 1.0)
        beta_nll(mean, sigma, truth, weights=torch.ones(1, 1, 1, 1), beta=beta)[0].backward()
        gradients.append(-mean.grad[0, 0, 0, 0].item())
    np.testing.assert_allclose(gradients, [0.01, 0.1, 1.0], rtol=1e-5)


def test_weights_apply_to_the_mean_and_sigma_covers_all():
    """Minimised over truths -1 and +1 of weights 0.2 and 1.8, mean and variance are the known ones."""
    truth = torch.tensor([-1.0, 1.0])[None, :, None, None].expand(1, 2, 1, 2)
    weights = torch.tensor([0.2, 1.8])[None, :, None, None]
    mean, log_sigma = torch.zeros(2, requires_grad=True), torch.zeros(2, requires_grad=True)
    optimiser = torch.optim.Adam([mean, log_sigma], lr=0.05)
    for _ in range(600):
        optimiser.zero_grad()
        shape = (1, 2, 1, 2)
        loss, _ = beta_nll(
            mean.expand(shape), log_sigma.exp().expand(shape), truth, weights=weights, beta=0.5
        )
        loss.backward()
        optimiser.step()
    best = 0.9 - 0.1
    np.testing.assert_allclose(mean.detach(), best, atol=1e-3)
    even = 0.5 * (1.0 + best) ** 2 + 0.5 * (1.0 - best) ** 2
    np.testing.assert_allclose(log_sigma.detach().exp() ** 2, even, rtol=5e-3)
