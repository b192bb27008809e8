"""Ensembles: disagreement of the members adds to the variance."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.learners import PRESETS, load_learner, save_learner, train
from drake_shared.learners.cnmp.training import train_together

QUICK = 60
SHOWN = ([1.0], [[1.0, 0.7]])


@pytest.fixture(scope="module")
def ensemble(two_ways):
    return train(two_ways, members=3, iterations=QUICK, seed=2)


def test_mean_and_variance_are_those_of_the_mixture_of_its_members(ensemble):
    said = [member.predict(*SHOWN, ensemble.grid) for member in ensemble.members]
    mean, variance = ensemble.predict(*SHOWN, ensemble.grid)
    means, variances = np.stack([part[0] for part in said]), np.stack([part[1] for part in said])
    np.testing.assert_allclose(mean, means.mean(axis=0), atol=1e-12)
    second_moment = (variances + means**2).mean(axis=0)
    np.testing.assert_allclose(variance, second_moment - mean**2, atol=1e-12)
    assert (variance > variances.mean(axis=0)).all()


def test_members_equal_learners_trained_alone(ensemble, two_ways):
    """They differ by the rounding of batched products, which training magnifies."""
    for record, member in zip(ensemble.metadata["training"]["members"], ensemble.members, strict=True):
        alone = train(two_ways, iterations=QUICK, seed=record["seed"])
        for one, other in zip(
            member.predict(*SHOWN, member.grid), alone.predict(*SHOWN, alone.grid), strict=True
        ):
            np.testing.assert_allclose(one, other, atol=2e-3)


def test_the_same_seed_gives_the_same_bits_and_the_file_gives_them_back(ensemble, two_ways, tmp_path):
    again = train(two_ways, members=3, iterations=QUICK, seed=2)
    save_learner(ensemble, tmp_path / "e.safetensors")
    read = load_learner(tmp_path / "e.safetensors")
    assert read.name == "ensemble"
    for other in (again, read):
        assert other.confidence_gain == ensemble.confidence_gain
        for one, same in zip(
            ensemble.predict(*SHOWN, ensemble.grid), other.predict(*SHOWN, ensemble.grid), strict=True
        ):
            np.testing.assert_array_equal(one, same)


def test_scaled_scales_the_variance_of_each_member(ensemble):
    mean, variance = ensemble.predict(*SHOWN, ensemble.grid)
    scaled_mean, scaled_variance = ensemble.scaled(2.0).predict(*SHOWN, ensemble.grid)
    np.testing.assert_array_equal(scaled_mean, mean)
    assert (scaled_variance > variance).all()


@pytest.mark.parametrize(("options", "count"), [({"members": 2}, 2), ({"learner": "ensemble"}, 5)])
def test_an_ensemble_has_five_members_or_as_many_as_are_wanted(two_ways, options, count):
    ensemble = train(two_ways, iterations=1, **options)
    assert len(ensemble.members) == len(ensemble.metadata["training"]["members"]) == count
    # One bound on K holds for all.
    assert ensemble.confidence_gain <= max(member.confidence_gain for member in ensemble.members)


def test_learners_of_different_tasks_are_trained_side_by_side(make_bows):
    tasks = [make_bows([1.0, -1.0]), make_bows([0.5]), make_bows([1.0, 0.2, -1.0])]
    together = train_together(tasks, [3, 4, 5], iterations=QUICK)
    for demonstrations, seed, learner in zip(tasks, (3, 4, 5), together, strict=True):
        alone = train(demonstrations, iterations=QUICK, seed=seed)
        assert learner.metadata["training"]["data_sha256"] == alone.metadata["training"]["data_sha256"]
        assert learner.confidence_gain == pytest.approx(alone.confidence_gain, rel=0.02)
        for one, other in zip(
            learner.predict(*SHOWN, learner.grid), alone.predict(*SHOWN, alone.grid), strict=True
        ):
            np.testing.assert_allclose(one, other, atol=3e-3)


def test_each_learner_of_the_paper_stops_at_its_own_loss(make_bows):
    parameters = dataclasses.replace(
        PRESETS["paper"],
        encoder=(64, 64),
        decoder=(64,),
        batch=20,
        queries=20,
        loss_threshold=0.0,
        cycle=150,
        iterations=450,
        first_floor=0.0,
    )
    tasks = [make_bows([1.0]), make_bows([1.0, -1.0])]
    together = train_together(tasks, [0, 0], parameters=parameters)
    counts = [learner.metadata["training"]["iterations"] for learner in together]
    alone = [train(one, seed=0, parameters=parameters) for one in tasks]
    assert counts == pytest.approx([one.metadata["training"]["iterations"] for one in alone], abs=5)
    # One stops in the first cycle, the other goes on in the second.
    assert min(counts) < 150 < max(counts) < 450
    for one, other in zip(together, alone, strict=True):
        np.testing.assert_allclose(one.predict(*SHOWN, one.grid), other.predict(*SHOWN, one.grid), atol=0.01)


@pytest.mark.parametrize("options", [{"members": 0}, {"members": 101}, {"members": 2, "learner": "mixture"}])
def test_bad_numbers_of_members_are_refused(two_ways, options):
    with pytest.raises(InputError, match="members"):
        train(two_ways, iterations=1, **options)
