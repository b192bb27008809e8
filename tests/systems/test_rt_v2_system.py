"""Robot-Trajectron's rule as an arbiter of the diagram."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.learners import load_learner
from drake_shared.learners.mixture.learner import MixtureLearner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.lockstep.support import unsupported
from drake_shared.simulation.trial import Simulation, TrialSettings

SCENARIO = load_scenario("two_obstacles")
CONFIG = SharedControlConfig(arbitration="rt-v2")


@pytest.fixture(scope="module")
def mixture():
    """An expert for each route, made of the shipped learner without training."""
    cnmp = load_learner("two_obstacles")
    experts = tuple(
        dataclasses.replace(cnmp, demonstrations=cnmp.demonstrations[route : route + 1], weights=np.ones(1))
        for route in range(3)
    )
    return MixtureLearner(
        experts=experts,
        shares=np.full(3, 1 / 3),
        leanings=np.ones(3),
        noise=0.1,
        confidence_gain=cnmp.confidence_gain,
        metadata=cnmp.metadata,
    )


def test_a_driver_is_brought_to_the_goal_and_keeps_a_share(mixture):
    simulation = Simulation(SCENARIO, learner=mixture, config=CONFIG)
    trial = simulation.run(TrialSettings(route="left_left", behaviour=Behaviour()))
    assert trial.status == "reached"
    weight = trial["human_weight"]
    assert ((weight >= 0.0) & (weight <= 1.0)).all()
    assert 0.0 < weight.mean() < 1.0
    assert trial.metadata["arbitration"]["configuration"] == {
        "look_ahead": 0.6,
        "command_variance": 0.05,
        "least_variance": 0.03,
    }


def test_a_learner_without_modes_is_refused():
    simulation = Simulation(SCENARIO, learner=load_learner("two_obstacles"), config=CONFIG)
    with pytest.raises(InputError) as caught:
        simulation.run(TrialSettings())
    assert caught.value.field == "learner"
    assert "\n" not in str(caught.value)


def test_it_runs_in_drake(mixture):
    assert unsupported(Simulation(SCENARIO, learner=mixture, config=CONFIG)) == "arbiter rt-v2"
