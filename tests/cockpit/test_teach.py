"""Which driven trials become demonstrations."""

import dataclasses

import numpy as np
import pytest

from drake_shared.cockpit.teach import Keeper


def test_keeps_what_reached_the_goal_without_contact_until_there_is_enough(human_trial, scenario):
    keeper = Keeper(scenario, wanted=2)
    missed = dataclasses.replace(human_trial, metadata={**human_trial.metadata, "status": "stopped"})
    touched = dataclasses.replace(
        human_trial, columns={**human_trial.columns, "contact": np.ones_like(human_trial["contact"])}
    )
    assert [keeper(trial) for trial in (human_trial, missed, touched)] == [False] * 3
    assert keeper(human_trial)
    assert len(keeper.driven) == 2
    demonstration = keeper.driven[0]
    np.testing.assert_array_equal(demonstration.positions, human_trial.positions)
    assert demonstration.score == pytest.approx(human_trial["clearance"].min(), abs=0.01)
