"""Coverage of forecasts in trials of a driver whom the learner was not taught."""

import pytest

from drake_shared.analysis.online_coverage import online_coverage
from drake_shared.learners import load_learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import load_scenario
from drake_shared.simulation.trial import Simulation, TrialSettings


def test_intervals_that_adapt_keep_their_coverage_with_a_noisy_driver():
    scenario, learner = load_scenario("two_obstacles"), load_learner("two_obstacles")
    simulation = Simulation(scenario, learner=learner)
    trials = [
        simulation.run(
            TrialSettings(route=scenario.routes[seed % 3].name, seed=seed, behaviour=Behaviour(noise=1.2))
        )
        for seed in range(4)
    ]
    adapted, own = online_coverage(learner, trials)
    assert adapted == pytest.approx(0.9, abs=0.02)
    assert own < 0.7
