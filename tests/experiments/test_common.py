"""Trials of experiments run together, and are those of the Drake diagram."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import RunError
from drake_shared.experiments import common
from drake_shared.experiments.common import (
    Teaching,
    demonstrate,
    demonstrated,
    run_all,
    simulation_of,
)
from drake_shared.experiments.paired_trials import Condition, run_conditions, settings_of
from drake_shared.learners import load_learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.simulation.config import SharedControlConfig, blend_for
from drake_shared.simulation.faults import Faults


@pytest.mark.parametrize("config", [None, SharedControlConfig(faults=Faults(pose_noise=0.05))])
def test_trials_are_those_of_the_diagram(config):
    learner = load_learner("two_obstacles")
    learners = [learner, None, learner]
    settings = [settings_of(None, operator, 0, 1) for operator in ("primary", "primary", "switching")]
    trials = list(run_all(None, learners, settings, config=config))
    simulation = simulation_of(None, config or blend_for(learner.preset))
    for trial, given, taking_part in zip(trials, settings, learners, strict=True):
        expected = simulation.run(given, learner=taking_part)
        assert trial.status == expected.status
        np.testing.assert_allclose(trial.positions, expected.positions, atol=1e-9)
    # The lock-step engine has no noisy poses.
    engines = {trial.metadata.get("engine") for trial in trials}
    assert engines == ({"lockstep"} if config is None else {None})


def test_each_learner_has_the_same_trials_in_each_condition():
    learner = load_learner("two_obstacles")
    kinds = {
        "usual": {},
        "alone": {"alone": True},
        "unsure": {"gain_factor": 10.0},
        "halves": {"config": SharedControlConfig(arbitration="halves")},
    }
    conditions = [Condition(columns={"kind": kind}, **given) for kind, given in kinds.items()]
    rows = run_conditions(None, {0: learner, 3: learner}, conditions, 2, measure=lambda _: {"more": 1})
    driven = {
        kind: {(row["learner"], row["seed"], row["route"]) for row in rows if row["kind"] == kind}
        for kind in kinds
    }
    assert len(driven["usual"]) == 4
    assert all(trials == driven["usual"] for trials in driven.values())
    weights = {kind: {row["mean_human_weight"] for row in rows if row["kind"] == kind} for kind in kinds}
    assert weights["alone"] == {1.0}
    assert weights["halves"] == {0.5}
    assert sum(weights["unsure"]) > sum(weights["usual"])
    assert {row["more"] for row in rows} == {1}


def test_a_drive_that_fails_is_repeated_with_another_seed():
    clumsy = Behaviour(skill=0.6, noise=0.9)
    (items,) = demonstrated(None, [Teaching(seed=23, count=6, behaviour=clumsy)])
    assert [item.provenance["route"] for item in list(items)[:3]] == [
        item.provenance["route"] for item in list(items)[3:]
    ]
    attempts = [(item.provenance["seed"] - 23 - index) // 1_000_003 for index, item in enumerate(items)]
    assert max(attempts) > 0
    assert min(attempts) == 0
    assert min(item.score for item in items) > 0.0
    # A set does not depend on the others.
    few = demonstrate(None, [Teaching(seed=700), Teaching(seed=23, count=2, behaviour=clumsy)])[1]
    for one, other in zip(few, list(items)[:2], strict=True):
        np.testing.assert_allclose(one.positions, other.positions, atol=1e-9)


def test_a_set_that_cannot_be_driven_leaves_the_others(monkeypatch):
    monkeypatch.setattr(common, "ATTEMPTS", 2)
    hopeless = dataclasses.replace(Behaviour(), noise=6.0, skill=0.05)
    failed, made = demonstrate(None, [Teaching(seed=0, count=1, behaviour=hopeless), Teaching(seed=0)])
    assert isinstance(failed, RunError)
    assert len(made) == 3
