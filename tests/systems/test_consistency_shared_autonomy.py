"""Consistency shared autonomy as an arbiter of the diagram."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.learners import load_learner
from drake_shared.learners.no_learner import NoLearner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.lockstep.engine import Lockstep
from drake_shared.simulation.lockstep.noise import is_drakes
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.consistency_shared_autonomy import ConsistencySharedAutonomy, model_of

SCENARIO = load_scenario("two_obstacles")
NOISY = TrialSettings(route="left_left", seed=1, behaviour=Behaviour(noise=1.2))


def simulation_of(arbitration, learner):
    return Simulation(SCENARIO, learner=learner, config=SharedControlConfig(arbitration=arbitration))


@pytest.fixture(scope="module")
def learner():
    return load_learner("two_obstacles")


@pytest.fixture(scope="module")
def simulation(learner):
    return simulation_of("consistency", learner)


@pytest.fixture(scope="module")
def trial(simulation):
    return simulation.run(NOISY)


@pytest.mark.skipif(not is_drakes(), reason="another C++ standard library draws other numbers")
def test_noisy_drivers_reach_the_goal_without_contact_more_often_than_alone(simulation, trial):
    settings = [dataclasses.replace(NOISY, seed=seed) for seed in range(12)]
    alone = [dataclasses.replace(one, driver="human") for one in settings]

    def successes(trials):
        return sum(one.status == "reached" and not one["contact"].any() for one in trials)

    ran = list(Lockstep(simulation).run([*settings, *alone]))
    assert successes(ran[:12]) >= 1.5 * successes(ran[12:]) > 0
    assert trial.metadata["arbitration"] == {"name": "consistency", "configuration": {"degree": 0.25}}
    # Trials in Drake are the same.
    np.testing.assert_allclose(ran[NOISY.seed]["x"], trial["x"], atol=1e-6)
    np.testing.assert_allclose(ran[NOISY.seed]["y"], trial["y"], atol=1e-6)


def test_the_weight_is_constant_and_the_command_is_not_the_humans(trial):
    weight = trial["human_weight"][1:-1]
    np.testing.assert_array_equal(weight, weight[0])
    assert 0.0 < weight[0] < 1.0
    assert np.abs(trial.commands("shared") - trial.commands("human")).max() > 0.5


def test_without_noise_the_human_drives_alone(learner):
    trial = simulation_of("consistency:degree=0", learner).run(NOISY)
    np.testing.assert_array_equal(trial["human_weight"], 1.0)
    np.testing.assert_array_equal(trial.commands("shared"), trial.commands("human"))


def test_a_network_is_trained_once_for_the_same_demonstrations(learner):
    assert model_of(learner) is model_of(dataclasses.replace(learner, confidence_gain=1.0))


def test_without_a_learner_the_human_drives_alone(simulation):
    trial = simulation.run(NOISY, learner=NoLearner(SCENARIO.duration))
    np.testing.assert_array_equal(trial.commands("shared"), trial.commands("human"))


def test_a_learner_without_its_demonstrations_is_refused(simulation, fake_learner):
    learner = fake_learner(np.zeros((10, 2)))
    learner.demonstrations = None
    with pytest.raises(InputError) as caught:
        simulation.run(NOISY, learner=learner)
    assert caught.value.field == "learner"
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("degree", [-0.1, 1.1, np.nan, "much"])
def test_a_degree_out_of_range_is_refused(degree):
    with pytest.raises(InputError) as caught:
        ConsistencySharedAutonomy(degree=degree)
    assert caught.value.field == "degree"
