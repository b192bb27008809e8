"""Fit of an operator: recovers known simulated ones, and refuses unsuitable trials."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from drake_shared.analysis.operator_fit import FITTED, fit_operator, settings_of
from drake_shared.common.errors import InputError
from drake_shared.learners import load_learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import blend_for
from drake_shared.simulation.lockstep.engine import Lockstep
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings

COUNT = 10
MODEL = Path(__file__).parents[2] / "models" / "learners" / "two_obstacles_default.safetensors"


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return Simulation(
        load_scenario("two_obstacles"), learner=load_learner(MODEL), config=blend_for("default")
    )


def drives(simulation: Simulation, *, mode: str = "human", count: int = COUNT, seed: int = 0, **behaviour):
    routes = [route.name for route in simulation.scenario.routes]
    settings = [
        TrialSettings(
            driver=mode,
            seed=seed + index,
            route=routes[index % len(routes)],
            behaviour=Behaviour(**behaviour),
        )
        for index in range(count)
    ]
    return list(Lockstep(simulation).run(settings))


@pytest.fixture(scope="module")
def plain(simulation) -> list[Trial]:
    return drives(simulation)


@pytest.mark.parametrize(
    ("mode", "behaviour"),
    [
        ("human", {}),
        ("human", {"skill": 0.6, "delay": 0.137, "noise": 0.3}),
        ("shared", {"delay": 0.3}),
        ("shared", {"skill": 0.6, "delay": 0.1, "yielding": 0.5}),
    ],
)
def test_the_parameters_of_a_simulated_operator_are_recovered_from_ten_trials(simulation, mode, behaviour):
    fit = fit_operator(drives(simulation, mode=mode, **behaviour))
    true = Behaviour(**behaviour)
    assert fit.skill.value == pytest.approx(true.skill, rel=0.1)
    assert fit.delay.value == pytest.approx(true.delay, abs=0.02)
    assert fit.noise.value == pytest.approx(true.noise, rel=0.15)
    assert fit.noise_time.value == pytest.approx(true.noise_time, rel=0.25)
    if mode == "shared":
        assert fit.yielding.value == pytest.approx(true.yielding, abs=0.02)
        assert fit.yielding.low <= true.yielding <= fit.yielding.high
    else:
        assert fit.yielding is None
    assert fit.speed_factor == pytest.approx(1.0, abs=0.01)
    assert 0.97 < fit.explained < fit.explained_a_step_ahead < 1.0
    assert fit.skill.low < true.skill < fit.skill.high


def test_noise_does_not_pass_for_another_speed(simulation):
    # Here the likelihood has a second maximum at a speed factor of 0.89 with noise that lasts for 5 s.
    behaviour = {"skill": 0.6, "delay": 0.137, "noise": 0.3, "yielding": 0.5}
    fit = fit_operator(drives(simulation, mode="shared", seed=9_000, **behaviour))
    assert fit.speed_factor == pytest.approx(1.0, abs=0.01)
    assert fit.noise.value == pytest.approx(0.3, rel=0.15)
    assert fit.delay.low < 0.137 < fit.delay.high


def test_the_interval_narrows_with_more_trials(simulation, plain):
    # With this noise and skill the Cramer-Rao bound of ten trials is a standard deviation of 7% of skill,
    # so 10% needs more of them.
    trials = drives(simulation, count=20, delay=0.1, noise=0.3)
    few, many = fit_operator(trials[:10]).skill, fit_operator(trials).skill
    assert few.low < 1.0 < few.high
    assert many.value == pytest.approx(1.0, rel=0.1)
    assert many.high - many.low < 0.75 * (few.high - few.low)
    alone = fit_operator(plain[:1])
    assert (alone.trials, alone.skill.low, alone.delay.high) == (1, None, None)


def test_late_start_speed_and_pauses_do_not_bias_the_fit(simulation):
    fit = fit_operator(
        drives(simulation, late_start=1.0, speed_factor=0.9, pause_time=4.0, pause=1.0, skill=0.8)
    )
    assert fit.speed_factor == pytest.approx(0.9, abs=0.01)
    assert fit.skill.value == pytest.approx(0.8, rel=0.1)
    assert fit.delay.value == pytest.approx(0.2, abs=0.02)


def test_goodness_of_fit_is_low_for_behaviour_outside_the_model(simulation, plain):
    known = fit_operator(plain)
    unknown = fit_operator(drives(simulation, random_share=0.3, count=4))
    assert known.explained > 0.99
    assert unknown.explained < 0.7


def test_settings_are_those_that_all_trials_share(simulation, plain):
    assert settings_of(plain) == {name: getattr(Behaviour(), name) for name in FITTED}
    other = drives(simulation, count=1, skill=0.5)
    assert "skill" not in settings_of([*plain, *other])


def changed(trial: Trial, **metadata) -> Trial:
    return dataclasses.replace(trial, metadata={**trial.metadata, **metadata})


def test_trials_of_a_person_are_not_simulated(plain):
    assert fit_operator(plain[:2]).simulated
    assert not fit_operator([changed(trial, operator="MouseInput") for trial in plain[:2]]).simulated


@pytest.mark.parametrize(
    ("metadata", "field"),
    [
        ({"mode": "agent"}, "mode"),
        ({"route": None}, "route"),
        ({"then": "left_left"}, "then"),
        ({"operator": "RecordedInput"}, "operator"),
        ({"operator": "MouseInput"}, "operator"),
        ({"preset": "paper"}, "preset"),
        ({"scenario": {"name": "other"}}, "scenario"),
    ],
)
def test_trials_that_do_not_belong_together_are_refused(plain, metadata, field):
    with pytest.raises(InputError, match=f"second: {field}"):
        fit_operator([plain[0], changed(plain[1], **metadata)], names=["first", "second"])


def test_trials_without_motion_or_commands_or_rows_are_refused(simulation, plain):
    still = {name: np.repeat(column[:1], len(column)) for name, column in plain[0].columns.items()}
    still["t"] = plain[0]["t"]
    with pytest.raises(InputError, match="trial 0 must hold motion"):
        fit_operator([dataclasses.replace(plain[0], columns=still)])
    hands_off = {**plain[0].columns, "human_left": 0 * plain[0]["t"], "human_right": 0 * plain[0]["t"]}
    with pytest.raises(InputError, match="trial 0 must hold human commands"):
        fit_operator([dataclasses.replace(plain[0], columns=hands_off)])
    sparse = {name: column[::2] for name, column in plain[0].columns.items()}
    with pytest.raises(InputError, match="trial 0: t "):
        fit_operator([dataclasses.replace(plain[0], columns=sparse)])
    holes = {**plain[0].columns, "x": np.where(plain[0]["t"] == 0.5, np.nan, plain[0]["x"])}
    with pytest.raises(InputError) as caught:
        fit_operator([dataclasses.replace(plain[0], columns=holes)])
    assert caught.value.field == "row 10"
    with pytest.raises(InputError, match="trials"):
        fit_operator([])


def straight(trial: Trial) -> Trial:
    """``trial`` with 2 s at constant speed straight ahead, along a route that is as straight."""
    scenario = load_scenario("two_obstacles")
    t, zeros, speed = trial["t"][:41], np.zeros(41), 0.3
    columns = {name: column[:41] for name, column in trial.columns.items()}
    columns |= {"x": speed * t, "y": zeros, "yaw": zeros}
    wheel = np.full(41, speed / scenario.robot.wheel_radius)
    columns |= {"human_left": wheel, "human_right": wheel}
    world = trial.metadata["scenario"]
    (left,) = (route for route in world["routes"] if route["name"] == "left_left")
    ahead = {**left, "name": "ahead", "waypoints": [[0.0, 0.0], [2.0, 0.0], [5.0, 0.0]]}
    aside = [{**item, "y": -0.8} for item in world["obstacles"]]
    world = {**world, "routes": [left, ahead], "obstacles": aside}
    return changed(dataclasses.replace(trial, columns=columns), route="ahead", scenario=world)


def faster(trial: Trial) -> Trial:
    """``trial`` with a push of both wheels."""
    pushed = {
        f"human_{side}": trial[f"human_{side}"] * (1.0 + (trial["t"] > 1.0)) for side in ("left", "right")
    }
    return dataclasses.replace(trial, columns={**trial.columns, **pushed})


def test_what_straight_drives_do_not_tell_is_refused_by_its_name(plain):
    ahead = straight(plain[0])
    with pytest.raises(InputError) as caught:
        fit_operator([ahead], names=["ahead.parquet"])
    assert caught.value.source == "ahead.parquet"
    with pytest.raises(InputError) as caught:
        fit_operator([faster(ahead), ahead], names=["faster.parquet", "ahead.parquet"])
    assert caught.value.field == "skill"


def test_a_value_that_rests_on_one_trial_has_no_interval(plain):
    ahead = faster(straight(plain[0]))
    turning = changed(plain[2], scenario=ahead.metadata["scenario"])
    skill = fit_operator([ahead, turning]).skill
    assert np.isfinite(skill.value)
    assert (skill.low, skill.high) == (None, None)
