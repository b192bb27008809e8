"""Drivers who are late, fast, slow, pause or change their minds, with the learner that ships."""

import numpy as np
import pytest

from drake_shared import Behaviour, Simulation, TrialSettings, load_learner, load_scenario, metrics
from drake_shared.common.files import models_directory
from drake_shared.learners import train
from drake_shared.operators.named import changes_of_route
from drake_shared.simulation.lockstep.engine import Lockstep
from drake_shared.simulation.teaching import teach

SCENARIO = "two_obstacles"


@pytest.fixture(scope="module")
def scenario():
    return load_scenario(SCENARIO)


@pytest.fixture(scope="module")
def simulation(scenario):
    learner = load_learner(models_directory() / "learners" / f"{SCENARIO}_default.safetensors")
    return Simulation(scenario, learner=learner)


DRIVERS = {
    "1.5 s late": {"late_start": 1.5},
    "3 s late": {"late_start": 3.0},
    "30% faster": {"speed_factor": 1.3},
    "30% slower": {"speed_factor": 1 / 1.3},
    "pausing for 2 s": {"pause_time": 4.0, "pause": 2.0},
}


@pytest.mark.parametrize("driver", DRIVERS)
def test_shared_control_does_not_harm_operators_with_another_pace(simulation, scenario, driver):
    behaviour, outcomes = Behaviour(**DRIVERS[driver]), {}
    for mode in ("human", "shared"):
        trials = Lockstep(simulation).run(
            [
                TrialSettings(driver=mode, route=route.name, seed=seed, behaviour=behaviour)
                for seed, route in enumerate(scenario.routes)
            ]
        )
        rows = [metrics(trial) for trial in trials]
        outcomes[mode] = [(row["intent_success"], row["collision"]) for row in rows]
    for alone, shared in zip(outcomes["human"], outcomes["shared"], strict=True):
        assert shared[0] >= alone[0]
        assert shared[1] <= alone[1]
    assert sum(succeeded for succeeded, _ in outcomes["human"]) >= 2


def test_an_operator_who_changes_the_route_gets_control_within_a_second(simulation, scenario):
    changed = 5.0
    settings = [
        TrialSettings(route=route.name, then=then.name, seed=seed, behaviour=Behaviour(switch_time=changed))
        for seed, (route, then) in enumerate(changes_of_route(scenario))
    ]
    assert settings
    for trial in Lockstep(simulation).run(settings):
        soon = (trial["t"] >= changed) & (trial["t"] <= changed + 1.0)
        assert trial["human_weight"][soon].max() > 0.5
        assert metrics(trial)["intent_success"]


def test_a_mixture_learner_never_drives_into_an_obstacle_at_a_fork(scenario):
    """Its mean lies between two modes, in the obstacle; the mode that it follows does not."""
    learner = train(teach(scenario), learner="mixture", iterations=800)
    simulation = Simulation(scenario, learner=learner)
    for seed in range(3):
        trial = simulation.run(TrialSettings(driver="agent", seed=seed))
        assert trial.status == "reached"
        assert not trial["contact"].any()
    start = np.array([[scenario.start.x, scenario.start.y]])
    modes = learner.predict_modes([0.0], start, learner.grid[1:])[2]
    demonstrations = learner.demonstrations
    # Every demonstrated route is a mode, within 5 cm.
    for path in demonstrations:
        away = [np.linalg.norm(mode - path[1:], axis=1).max() for mode in modes.mean]
        assert min(away) < 0.05
