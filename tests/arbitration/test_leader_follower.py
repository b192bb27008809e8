"""Leader and follower: who chooses the direction, and whose pace counts."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from drake_shared.arbitration.leader_follower import LeaderFollower
from drake_shared.arbitration.rule import ArbiterInputs
from drake_shared.common.errors import InputError
from drake_shared.systems.leader_follower import LeaderFollower as LeaderFollowerSystem

LIMITS = (12.0, 12.0)
speeds = st.floats(-12.0, 12.0)
commands = st.tuples(speeds, speeds)


def apply(human, autonomous, *, human_leads, share):
    rule = LeaderFollower(human_leads=human_leads, share=share, limits=LIMITS)
    unused = np.ones(1)
    given = ArbiterInputs(
        human=np.reshape(human, (2, 1)),
        autonomous=np.reshape(autonomous, (2, 1)),
        confidence=unused,
        pose=np.empty((0, 1)),
        clearance=unused,
    )
    weight, command, _ = rule.step(rule.initial_state(1), given)
    return weight.item(), command[:, 0]


@given(commands, commands, st.booleans(), st.floats(0.0, 1.0))
def test_the_leader_chooses_the_direction_and_the_pace_lies_between_both(human, agent, human_leads, share):
    weight, command = apply(human, agent, human_leads=human_leads, share=share)
    leader, follower = (human, agent) if human_leads else (agent, human)
    left, right = command
    # The ratio of the wheels, and so the curvature, is the leader's.
    assert left * leader[1] == pytest.approx(right * leader[0], abs=1e-9)
    assert np.dot(command, leader) >= 0.0
    paces = [max(map(abs, each)) for each in (leader, follower)]
    if paces[0] > 0.0:
        assert min(paces) - 1e-9 <= max(abs(command)) <= max(paces) + 1e-9
    assert weight == pytest.approx(1.0 - share if human_leads else share)


@given(commands, commands, st.booleans())
def test_a_follower_without_a_share_has_no_effect(human, agent, human_leads):
    _, command = apply(human, agent, human_leads=human_leads, share=0.0)
    np.testing.assert_allclose(command, human if human_leads else agent, atol=1e-12)


def test_an_agent_that_leads_stops_once_a_human_with_the_whole_pace_lets_go():
    _, command = apply((0.0, 0.0), (5.0, 6.0), human_leads=False, share=1.0)
    np.testing.assert_array_equal(command, [0.0, 0.0])


@pytest.mark.parametrize(
    ("field", "options"),
    [("leader", {"leader": "robot"}), ("share", {"share": 1.5}), ("share", {"share": "x"})],
)
def test_options_out_of_range_are_refused(field, options):
    with pytest.raises(InputError) as caught:
        LeaderFollowerSystem(**options)
    assert caught.value.field == field
