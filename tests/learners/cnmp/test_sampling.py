"""The samples of training: lines 6 to 9 of Alg. 1."""

import dataclasses

import numpy as np
import pytest
import torch

from drake_shared.learners import PRESETS
from drake_shared.learners.augmentation import low_frequency_basis
from drake_shared.learners.cnmp.loss import Objective
from drake_shared.learners.cnmp.network import CnmpNetworks
from drake_shared.learners.cnmp.sampling import Batch, Sampler, TaskData

STEPS = 11
# Demonstration d is at (d, step) at each step, so that a position tells which it is.
PATHS = np.stack([np.stack([np.full(STEPS, d), np.arange(STEPS)], axis=-1) for d in range(3)]).astype(float)
FEATURES = torch.arange(STEPS, dtype=torch.float32)[:, None]
WEIGHTS = np.array([0.6, 0.3, 0.1])


def sampler(preset: str, seeds=(2,), **changes) -> Sampler:
    parameters = dataclasses.replace(PRESETS[preset], **changes)
    tasks = [TaskData(paths=PATHS, weights=WEIGHTS, unit=1.0, seed=seed) for seed in seeds]
    return Sampler(tasks, FEATURES, parameters)


def draws(made: Sampler, count: int) -> list[Batch]:
    return [made.sample() for _ in range(count)]


def test_the_paper_samples_a_demonstration_by_pd_and_a_query():
    batches = draws(sampler("paper", batch=1, queries=1), 3_000)
    assert all(batch.truth.shape == (1, 1, 1, 2) for batch in batches)
    chosen = np.array([int(batch.truth[0, 0, 0, 0]) for batch in batches])
    np.testing.assert_allclose(np.bincount(chosen) / 3_000, WEIGHTS, atol=0.03)
    assert all((batch.weights == 1.0).all() for batch in batches)


def test_the_paper_observes_1_to_m_points_without_noise():
    batches = draws(sampler("paper", batch=1, queries=1, observations=4), 2_000)
    counts = np.bincount([batch.observations.shape[1] for batch in batches])[1:]
    np.testing.assert_allclose(counts / 2_000, 0.25, atol=0.03)
    for batch in batches[:50]:
        step, demonstration, where = batch.observations[0].T
        assert (step == where).all()
        assert (demonstration == batch.truth[0, 0, 0, 0]).all()
        assert (batch.queries[:, 0] == batch.truth[0, 0, :, 1]).all()


def test_the_default_samples_evenly_and_weights_the_mean():
    batch = sampler("default", batch=6_000, noise=0.0, blending=0.0).sample()
    chosen = batch.truth[0, :, 0, 0].int().numpy()
    np.testing.assert_allclose(np.bincount(chosen) / 6_000, 1 / 3, atol=0.03)
    np.testing.assert_allclose(batch.weights[0, :, 0, 0], 3.0 * WEIGHTS[chosen], rtol=1e-6)


def test_a_share_of_each_batch_has_one_observation():
    batch = sampler("default", batch=1_000, single_share=0.4, observations=5).sample()
    counts = torch.bincount(batch.samples)
    assert len(counts) == 1_000
    assert (counts[:400] == 1).all()
    assert counts.min() == 1
    assert counts.max() == 5


def test_noise_moves_observations_and_not_queries():
    batch = sampler("default", batch=5_000, noise=0.1, blending=0.0).sample()
    offsets = batch.observations[0, :, 2] - batch.observations[0, :, 0]
    assert offsets.std().item() == pytest.approx(0.1, rel=0.05)
    assert (batch.truth[0, :, :, 1] == batch.queries[:, 0]).all()


def test_the_same_seed_gives_the_same_samples():
    for one, other in zip(draws(sampler("default"), 3), draws(sampler("default"), 3), strict=True):
        assert torch.equal(one.observations, other.observations)
        assert torch.equal(one.truth, other.truth)


def test_samples_of_a_learner_do_not_depend_on_the_others():
    alone, together = sampler("default", seeds=[5]), sampler("default", seeds=[2, 5])
    for one, both in zip(draws(alone, 3), draws(together, 3), strict=True):
        assert torch.equal(one.observations[0], both.observations[1])
        assert torch.equal(one.truth[0], both.truth[1])
        assert not torch.equal(both.truth[0], both.truth[1])


@pytest.mark.parametrize(("copies", "share"), [(1, 1.0), (4, 0.25)])
def test_low_frequency_noise_falls_with_the_number_of_demonstrations_of_a_route(copies, share):
    parameters = dataclasses.replace(PRESETS["default"], batch=4_000, noise=0.0, wandering=0.2)
    paths = np.concatenate([PATHS[:1]] * copies)
    task = TaskData(paths=paths, weights=np.full(copies, 1 / copies), unit=1.0, seed=2)
    batch = Sampler([task], FEATURES, parameters).sample()
    strays = batch.truth[0, :, :, 0]
    asked = batch.queries[:, 0].long().numpy()
    expected = 0.04 * share * np.square(low_frequency_basis(STEPS)).sum(axis=0)[asked]
    np.testing.assert_allclose(strays.var(dim=0), expected, rtol=0.1, atol=1e-6)


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_a_padded_batch_has_the_loss_and_the_gradient_of_the_plain_one(preset):
    """Padding gives all batches one shape, as a GPU needs; it counts for nothing."""
    parameters = PRESETS[preset]
    features = torch.rand((STEPS, 1 + 2 * parameters.harmonics), generator=torch.Generator().manual_seed(0))
    tasks = [TaskData(paths=PATHS, weights=WEIGHTS, unit=1.0, seed=seed) for seed in (0, 1)]
    samplers = [Sampler(tasks, features, parameters, padded=padded) for padded in (False, True)]
    networks = CnmpNetworks(
        features=features.shape[1],
        positions=2,
        encoder=parameters.encoder,
        aggregation=parameters.aggregation,
        decoder=parameters.decoder,
        seeds=[0, 1],
    )
    objective = Objective(networks, torch.ones((2, 2)), parameters.position_scale)
    for plain, padded in zip(*(draws(made, 3) for made in samplers), strict=True):
        assert padded.observations.shape[1] == parameters.batch * parameters.observations
        assert plain.observations.shape[1] < padded.observations.shape[1]
        found = []
        for batch, beta in ((plain, 0.5), (padded, torch.tensor(0.5))):
            loss, nll = objective(*batch, torch.full((2, 1, 1, 1), 0.1), beta)
            gradients = torch.autograd.grad(loss, list(objective.parameters()))
            found.append([nll, *gradients])
        for one, other in zip(*found, strict=True):
            torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-6)
