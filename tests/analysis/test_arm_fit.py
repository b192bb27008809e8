"""Fit of an operator of an arm: recovers known simulated ones, and tells how they move."""

import dataclasses

import numpy as np
import pytest

from drake_shared.analysis.operator_fit import fit_operator
from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import load_scenario
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings

CUPS = load_scenario("table_three_cups")


@pytest.fixture(scope="module")
def alone() -> Simulation:
    return Simulation(CUPS)


def drives(simulation: Simulation, *, count: int = 6, seed: int = 0, **behaviour) -> list[Trial]:
    routes = [route.name for route in CUPS.routes]
    return [
        simulation.run(
            TrialSettings(seed=seed + index, route=routes[index % 3], behaviour=Behaviour(**behaviour))
        )
        for index in range(count)
    ]


def test_an_operator_who_follows_the_route_is_recovered(alone):
    true = Behaviour(noise=0.02, delay=0.17, skill=0.6, speed_factor=0.9)
    fit = fit_operator(drives(alone, **dataclasses.asdict(true)))
    assert fit.simulated
    assert fit.aim_ahead is fit.yielding is fit.plane_switch_time is None
    assert fit.skill.low < fit.skill.value < fit.skill.high
    assert fit.skill.value == pytest.approx(true.skill, abs=0.2)
    # Between two control periods.
    assert fit.delay.value == pytest.approx(true.delay, abs=0.02)
    assert fit.noise.value == pytest.approx(true.noise, rel=0.15)
    assert fit.noise_time.value == pytest.approx(true.noise_time, rel=0.3)
    assert fit.speed_factor == pytest.approx(true.speed_factor, abs=0.03)
    assert fit.explained < fit.explained_a_step_ahead < 1.0


def test_an_operator_who_aims_ahead_and_switches_planes_is_recovered(alone):
    true = Behaviour(noise=0.02, delay=0.25, aim_ahead=0.06, plane_switch_time=0.4)
    trials = drives(alone, **dataclasses.asdict(true))
    assert any(trial["plane_switches"].any() for trial in trials)
    fit = fit_operator(trials)
    assert fit.skill is None
    assert fit.aim_ahead.value == pytest.approx(true.aim_ahead, abs=0.015)
    assert fit.plane_switch_time.value == pytest.approx(true.plane_switch_time, abs=CUPS.control_period)
    assert fit.delay.value == pytest.approx(true.delay, abs=0.1)
    assert fit.noise.value == pytest.approx(true.noise, rel=0.2)


def test_drives_in_planes_and_in_three_axes_are_not_of_one_operator(alone):
    (free,), (switching,) = drives(alone, count=1), drives(alone, count=1, plane_switch_time=0.4)
    with pytest.raises(InputError) as caught:
        fit_operator([free, switching], names=["free.parquet", "switching.parquet"])
    assert (caught.value.source, caught.value.field) == ("switching.parquet", "plane")


def test_an_arm_that_stands_tells_nothing(alone):
    (trial,) = drives(alone, count=1)
    still = {name: np.repeat(column[:1], len(column)) for name, column in trial.columns.items()}
    still["t"] = trial["t"]
    with pytest.raises(InputError):
        fit_operator([dataclasses.replace(trial, columns=still)])
