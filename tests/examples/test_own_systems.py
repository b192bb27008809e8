"""The examples of one's own learner, operator and diagram."""

import importlib.metadata

import numpy as np

from drake_shared.scenario import load_scenario
from drake_shared.systems.operators import make_operator, registered_operators


def test_a_learner_of_ones_own_helps_and_reaches_the_goal(example):
    result = example("own_learner").main()
    assert result["intent_success"]
    assert result["mean_human_weight"] < 0.9


def test_an_operator_of_ones_own_reaches_the_goal_and_adds_columns_to_the_log(example):
    results = example("keyboard_operator").main()
    assert results["human"]["success"]
    assert results["shared"]["success"]


def test_a_registered_operator_is_made_by_its_name(example, monkeypatch):
    module = example("keyboard_operator")
    group = "drake_shared.operators"
    point = importlib.metadata.EntryPoint("keyboard", "keyboard_operator:make_operator", group)
    monkeypatch.setattr("drake_shared.common.entry_points.entry_points", lambda group: [point])
    assert registered_operators() == ["keyboard"]
    operator = make_operator("keyboard", scenario=load_scenario())
    assert isinstance(operator, module.KeyboardOperator)


def test_single_systems_work_in_a_diagram_of_ones_own(example):
    weight = example("shared_unicycle").main(duration=2.0)
    assert len(weight) == 41
    assert np.all((weight >= 0.0) & (weight <= 1.0))
    assert weight.min() < 0.95
