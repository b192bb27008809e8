"""The arithmetic of the blend and of authority, against the formulas by hand."""

import math

import numpy as np
import pytest

from drake_shared.arbitration.authority import (
    Authority,
    AuthorityState,
    is_hands_off,
    limited_command,
    limited_weight,
    next_times,
)
from drake_shared.arbitration.blend import blend, confidence_weight, finite_weight

PERIOD = 0.05


@pytest.mark.parametrize("size", [1, 2, 3, 7])
def test_the_blend_is_equation_2_for_commands_of_any_size(size):
    rng = np.random.default_rng(size)
    human, agent, weight = rng.normal(size=size), rng.normal(size=size), rng.uniform()
    expected = weight * human + (1 - weight) * agent
    np.testing.assert_allclose(blend(weight, human.tolist(), agent.tolist()), expected, rtol=1e-15)


def test_equal_commands_blend_to_that_command():
    np.testing.assert_allclose(blend(0.3, [1.0, -2.0, 4.0], [1.0, -2.0, 4.0]), [1.0, -2.0, 4.0])


def test_the_agents_command_does_not_matter_where_the_human_drives():
    assert list(blend(1.0, [1.0, 2.0], [math.nan, math.inf])) == [1.0, 2.0]
    assert list(blend(0.5, [math.nan, 2.0], [4.0, 8.0])) == [2.0, 4.0]


@pytest.mark.parametrize(("confidence", "weight"), [(0.0, 1.0), (0.3, 0.7), (1.0, 0.0), (math.nan, 1.0)])
def test_the_weight_is_what_the_confidence_leaves(confidence, weight):
    assert confidence_weight(confidence) == pytest.approx(weight)


@pytest.mark.parametrize("agent", [[math.nan], [1.0, math.inf, 0.0], [math.inf, -math.inf]])
def test_without_a_finite_command_of_the_agent_the_weight_is_1(agent):
    assert finite_weight(0.2, agent) == 1.0
    assert finite_weight(0.2, [1.0] * len(agent)) == 0.2


def step(before, *, angle, human=(1.0, 1.0), idle_time=None, **authority):
    return next_times(
        Authority(**authority), before, angle=angle, human=human, idle_time=idle_time, period=PERIOD
    )


def test_times_of_conflict_agreement_and_idleness_by_hand():
    state = AuthorityState.initial(2, idle_time=0.0)
    for index in range(1, 7):
        state = step(state, angle=1.0)
        assert state.conflict_time == pytest.approx(index * PERIOD)
        assert state.agreement_time == 0.0
        assert bool(state.released) is (index == 6)  # 0.3 s
    state = step(state, angle=0.1, human=(0.0, 0.0))
    assert (state.conflict_time, state.agreement_time, state.idle_time) == pytest.approx((0, 0.05, 0.05))
    assert state.released
    for _ in range(3):
        state = step(state, angle=0.1)
    assert not state.released
    assert state.idle_time == 0.0


def test_a_motion_without_direction_neither_agrees_nor_conflicts():
    state = step(AuthorityState.initial(2), angle=math.nan)
    assert state.conflict_time == state.agreement_time == 0.0


def test_a_measured_idle_time_counts_and_a_command_ends_it():
    state = AuthorityState.initial(2)
    assert step(state, angle=0.0, human=(0.0, 0.0), idle_time=0.7).idle_time == 0.7
    assert step(state, angle=0.0, human=(0.0, 1e-3), idle_time=0.7).idle_time == 0.0


def test_nobody_has_touched_the_controls_before_the_first_command():
    state = step(AuthorityState.initial(2), angle=0.0, human=(0.0, 0.0))
    assert state.idle_time == math.inf
    assert is_hands_off(Authority(), state)
    assert not is_hands_off(Authority(hands_off_time=None), state)
    assert not is_hands_off(Authority(), step(state, angle=0.0))


@pytest.mark.parametrize(
    ("changes", "weight", "expected"),
    [
        ({}, 0.45, 0.45),
        ({}, 0.0, 0.3),  # 4 per second
        ({}, 1.0, 0.7),
        ({"released": 1.0}, 0.0, 0.5 + PERIOD / 0.3),
        ({"idle_time": 2.0}, 0.0, 0.5 + PERIOD / 0.7),
        ({"idle_time": 2.0, "released": 1.0}, 0.0, 0.5 + PERIOD / 0.3),
    ],
)
def test_the_weight_moves_no_faster_than_its_rate(changes, weight, expected):
    state = AuthorityState.initial(2, idle_time=0.0)
    state.weight = 0.5
    for name, value in changes.items():
        setattr(state, name, value)
    assert limited_weight(Authority(), state, weight, PERIOD) == pytest.approx(expected)


def test_the_floor_is_the_least_weight():
    state = AuthorityState.initial(2, idle_time=0.0)
    assert limited_weight(Authority(floor=0.4, weight_rate=None), state, 0.1, PERIOD) == 0.4


@pytest.mark.parametrize("size", [1, 3])
def test_the_command_moves_straight_toward_its_target_at_its_rate(size):
    target = np.linspace(8.0, 4.0, size)
    moved = limited_command(Authority(command_rate=40.0), [0.0] * size, target.tolist(), PERIOD)
    np.testing.assert_allclose(moved, target * 2.0 / 8.0)
    assert limited_command(Authority(command_rate=40.0), [7.0], [8.0], PERIOD) == [8.0]
    assert limited_command(Authority(command_rate=None), [0.0], [99.0], PERIOD) == [99.0]


def test_the_state_survives_its_list():
    state = AuthorityState(0.4, 0.1, 0.2, 1.0, math.inf, [1.0, 2.0, 3.0])
    assert AuthorityState.from_list(state.to_list()) == state
