"""Trials that qualify become demonstrations."""

import dataclasses

import numpy as np
import pytest

from drake_shared.cockpit.teach import DemonstrationCollector


def test_collects_trials_that_reach_the_goal_without_contact(human_trial, scenario):
    collector = DemonstrationCollector(scenario, wanted=2)
    missed = dataclasses.replace(human_trial, metadata={**human_trial.metadata, "status": "stopped"})
    touched = dataclasses.replace(
        human_trial, columns={**human_trial.columns, "contact": np.ones_like(human_trial["contact"])}
    )
    assert [collector(trial) for trial in (human_trial, missed, touched)] == [False] * 3
    assert collector(human_trial)
    assert len(collector.demonstrations) == 2
    demonstration = collector.demonstrations[0]
    np.testing.assert_array_equal(demonstration.positions, human_trial.positions)
    assert demonstration.score == pytest.approx(human_trial["clearance"].min(), abs=0.01)
