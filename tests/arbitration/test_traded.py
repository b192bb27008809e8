"""Traded control: when the agent takes over, and when it gives back."""

import math

import numpy as np
import pytest

from drake_shared.arbitration.rule import ArbiterInputs
from drake_shared.arbitration.traded import Traded
from drake_shared.common.errors import InputError
from drake_shared.systems.traded_control import TradedControl


def weight_of(rule, *, confidence, agent, clearance=math.inf, autonomous=1.0):
    given = ArbiterInputs(
        human=np.zeros((2, 1)),
        autonomous=np.full((2, 1), autonomous),
        confidence=np.array([confidence]),
        pose=np.empty((0, 1)),
        clearance=np.array([clearance]),
    )
    weight, _, after = rule.step({"agent": np.array([agent])}, given)
    assert after["agent"].item() == (weight == 0.0)
    return weight.item()


@pytest.mark.parametrize(
    ("confidence", "agent", "weight"),
    [(0.65, False, 0.0), (0.6, False, 1.0), (0.6, True, 0.0), (0.55, True, 1.0), (math.nan, True, 1.0)],
)
def test_traded_control_has_hysteresis(confidence, agent, weight):
    assert (
        weight_of(Traded(threshold=0.6, margin=0.04, least_clearance=0.0), confidence=confidence, agent=agent)
        == weight
    )


@pytest.mark.parametrize("agent", [False, True])
def test_near_an_obstacle_the_human_drives_however_sure_the_agent_is(agent):
    rule = Traded(threshold=0.5, margin=0.05, least_clearance=0.3)
    assert weight_of(rule, confidence=1.0, agent=agent, clearance=0.29) == 1.0
    assert weight_of(rule, confidence=1.0, agent=agent, clearance=0.3) == 0.0


def test_an_agent_without_a_command_does_not_drive_in_the_next_step():
    rule = Traded(threshold=0.5, margin=0.05, least_clearance=0.0)
    assert weight_of(rule, confidence=1.0, agent=True, autonomous=math.nan) == 1.0


def test_the_clearance_is_asked_for_only_where_it_counts():
    assert not TradedControl().HasInputPort("clearance")
    assert TradedControl(least_clearance=0.3).HasInputPort("clearance")
    with pytest.raises(InputError) as caught:
        TradedControl(least_clearance=-1.0)
    assert caught.value.field == "least_clearance"
