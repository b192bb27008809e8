"""Posterior fusion as a system of the diagram."""

import dataclasses

import numpy as np
import pytest

from drake_shared.arbitration.fusion_model import FusionModel
from drake_shared.arbitration.routes import routes_of
from drake_shared.common.errors import InputError
from drake_shared.learners import load_learner
from drake_shared.learners.no_learner import NoLearner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import Circle, load_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.posterior_fusion import PosteriorFusion
from drake_shared.systems.route_arbiter import demonstrated_paths

SCENARIO = load_scenario("two_obstacles")


@pytest.fixture(scope="module")
def simulation():
    config = SharedControlConfig(arbitration="fusion", safety_clearance=0.03)
    return Simulation(SCENARIO, learner=load_learner("two_obstacles"), config=config)


@pytest.fixture(scope="module")
def trial(simulation):
    return simulation.run(TrialSettings(route="left_left", seed=1, behaviour=Behaviour(noise=1.2)))


def test_a_noisy_driver_reaches_the_goal_and_is_given_less_of_the_control(trial):
    assert trial.status == "reached"
    assert not trial["contact"].any()
    assert trial["human_weight"][100:].mean() < 0.6


def test_the_noise_of_the_driver_is_estimated_with_its_uncertainty(simulation):
    arbiter = simulation.parts.arbiter
    found = {}
    for noise in (0.1, 1.2):
        running = simulation.begin(TrialSettings(route="left_left", seed=1, behaviour=Behaviour(noise=noise)))
        running.advance(6.0)
        context = arbiter.GetMyContextFromRoot(running.root)
        (mean, deviation), (time, _) = arbiter.GetNoise(context), arbiter.GetNoiseTime(context)
        assert abs(mean - noise) < max(3.0 * deviation, 0.1)
        assert arbiter.GetOutputPort("driver_noise").Eval(context).item() == pytest.approx(mean)
        assert 0.1 < time < 2.0
        found[noise] = mean
    assert found[0.1] < 0.4 < 0.8 < found[1.2]


def test_the_estimate_is_in_the_log_and_without_a_person_there_is_nobody_to_compare_with(trial):
    assert 0.6 < trial["driver_noise"][100:].mean() < 1.5
    assert not trial["another_driver"].any()


def test_the_model_is_kept_in_the_log(trial):
    assert trial.metadata["arbitration"]["configuration"] == dataclasses.asdict(FusionModel()) | {
        "noises": list(FusionModel().noises),
        "noise_times": list(FusionModel().noise_times),
        "noise_prior": [],
    }


def test_trials_of_one_diagram_do_not_depend_on_each_other(simulation, trial):
    again = simulation.run(TrialSettings(route="left_left", seed=1, behaviour=Behaviour(noise=1.2)))
    np.testing.assert_array_equal(again["x"], trial["x"])


def test_the_routes_are_those_of_the_demonstrations_and_the_further_ways():
    routes = routes_of(SCENARIO, demonstrated_paths(load_learner("two_obstacles")))
    assert routes.demonstrated.tolist() == [True, True, True, False]  # The fourth way is right, right.
    assert np.abs(routes.points[3][60:140, 1]).min() > 0.3


def test_without_demonstrations_every_way_is_planned():
    assert demonstrated_paths(NoLearner(SCENARIO.duration)) == []
    assert not routes_of(SCENARIO, []).demonstrated.any()


def test_a_goal_without_a_way_is_refused():
    plug = Circle(name="plug", x=2.5, y=0.0, radius=1.5)
    with pytest.raises(InputError) as caught:
        PosteriorFusion(scenario=dataclasses.replace(SCENARIO, obstacles=[plug], routes=[]))
    assert caught.value.field == "obstacles"


def test_a_model_whose_state_is_too_large_is_refused():
    many = tuple(np.linspace(0.1, 2.0, 60))
    with pytest.raises(InputError) as caught:
        PosteriorFusion(scenario=SCENARIO, model=FusionModel(noises=many, noise_times=many))
    assert caught.value.field == "rule"
