"""The simulated operators by name: each does what its model says, and mostly gets there alone."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from drake_shared.analysis.batch import Batch, run_batch
from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.named import OPERATORS, changes_of_route, named_operator
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import read_log

MODEL = Path(__file__).parents[2] / "models" / "learners" / "two_obstacles_default.safetensors"
NAMES = {
    *("primary", "noisy", "laggy", "delayed", "signal-noise", "late-slow", "switching", "stubborn"),
    *("yielding", "resting", "unskilled"),
}


def rows_of(name: str, **settings) -> list[dict]:
    named = OPERATORS[name]
    behaviour = named.behaviour_in(load_scenario("two_obstacles"))
    return list(run_batch(Batch(behaviour=behaviour, switching=named.switches, **settings)))


def test_there_is_one_for_each_way_to_drive_and_no_two_are_alike():
    assert set(OPERATORS) == NAMES
    kinds = {(named.behaviour, named.switches) for named in OPERATORS.values()}
    assert len(kinds) == len(NAMES)
    assert OPERATORS["primary"].behaviour == Behaviour()
    assert all(named.model and named.source for named in OPERATORS.values())


@pytest.mark.parametrize("name", sorted(NAMES))
def test_alone_it_reaches_the_goal_it_means_more_often_than_not(name):
    rows = rows_of(name, config=SharedControlConfig(driver="human"), count=6)
    assert sum(row["intent_success"] for row in rows) > 3


@pytest.mark.parametrize("name", ["laggy", "signal-noise", "unskilled", "switching", "stubborn", "yielding"])
def test_shared_it_reaches_the_goal_it_means(name):
    rows = rows_of(name, model=str(MODEL), count=3)
    assert all(row["intent_success"] for row in rows)


def test_a_change_of_route_leads_to_the_next_that_can_still_be_driven(scenario):
    def names(task) -> list[tuple[str, str]]:
        return [(route.name, then.name) for route, then in changes_of_route(task)]

    assert names(scenario) == [("left_right", "left_left"), ("left_left", "left_right")]
    assert names(load_scenario("doorway")) == [("right_left", "right_right"), ("right_right", "right_left")]
    scenario.routes = scenario.routes[:2]
    with pytest.raises(InputError, match="scenario two_obstacles: routes must hold one that can be left"):
        changes_of_route(scenario)


def test_who_switches_half_way_is_measured_by_the_second_route(tmp_path):
    rows = rows_of("switching", config=SharedControlConfig(driver="human"), count=2, out=str(tmp_path))
    assert [row["route"] for row in rows] == ["left_right", "left_left"]
    assert all(row["intent_success"] for row in rows)
    first = read_log(rows[0]["log"])
    assert first.metadata["then"] == "left_left"
    beside_second = np.abs(first["x"] - 3.6).argmin()
    assert first["y"][beside_second] > 0.5


def test_an_unknown_name_is_told_those_that_are_known():
    assert named_operator("noisy") is OPERATORS["noisy"]
    with pytest.raises(InputError, match=r"operator must be one of primary, noisy, .*, got 'sleepy'"):
        named_operator("sleepy")


def test_names_are_for_reading_only():
    with pytest.raises(TypeError):
        OPERATORS["mine"] = OPERATORS["noisy"]
    with pytest.raises(dataclasses.FrozenInstanceError):
        OPERATORS["noisy"].switches = True
