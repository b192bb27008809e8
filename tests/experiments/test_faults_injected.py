"""Injected faults: their trials, claims and report."""

import dataclasses

import numpy as np
import pytest

from drake_shared.experiments import faults_injected
from drake_shared.experiments.common import simulation_of
from drake_shared.experiments.section import FULL, QUICK
from drake_shared.learners.no_learner import NoLearner
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.faults import Faults
from drake_shared.simulation.trial import Trial, TrialSettings


@pytest.fixture(scope="module")
def rows(short_training, run_plan, tiny):
    """Of one learner, each fault at its largest severity."""
    with short_training():
        (rows,) = run_plan(faults_injected, dataclasses.replace(tiny, learners=1))
    return rows


def made_up(*, assisted, reached=0):
    """Rows of 20 learners in which assistance adds about ``assisted`` to the success with each fault."""
    rows = [
        {"fault": fault, "severity": severity, "arm": arm, "learner": learner, "not_finite": 0}
        | {
            "intent_success": 0.5
            + (assisted + 0.01 * (learner % 5 - 2)) * (arm == "assisted" and severity > 0.0)
        }
        for fault, severity in [("", 0.0), *((name, values[-1]) for name, values in FAULTS.items())]
        for arm in faults_injected.arms_of(fault)
        for learner in range(20)
    ]
    for row in rows:
        row["not_finite"] = reached * (row["fault"] == "pose_nan")
    return rows


FAULTS = faults_injected.FAULTS


def test_each_fault_has_an_effect_on_otherwise_equal_trials(rows):
    assert len({(row["route"], row["seed"]) for row in rows}) == 1
    alone = {row["fault"]: row["human_effort"] for row in rows if row["arm"] == "alone"}
    assert set(alone) == {"", *(name for name in FAULTS if "learner" not in name)}
    assert all(effort != alone[""] for fault, effort in alone.items() if fault)
    assisted = {row["fault"]: row["mean_human_weight"] for row in rows if row["arm"] == "assisted"}
    assert set(assisted) == {"", *FAULTS}


def test_nan_never_reaches_the_plant(rows):
    assert {row["not_finite"] for row in rows} == {0}
    columns = {name: np.zeros(5) for name in ("x", "yaw", "wheel_left", "shared_right", "received_left")}
    columns["x"][1] = columns["wheel_left"][1] = np.nan
    columns["yaw"][3] = np.inf
    columns["shared_right"][4] = np.nan
    columns["received_left"][0] = np.nan  # Not an input of the plant.
    assert faults_injected.count_not_finite(Trial(columns=columns, metadata={})) == 3


@pytest.mark.parametrize("fault", ["human_nan", "pose_nan", "learner_nan"])
def test_faults_that_inject_nan_do(fault):
    simulation = simulation_of(None, SharedControlConfig(faults=faults_injected.faults_of(fault, 0.25)))
    trial = simulation.run(TrialSettings(), learner=NoLearner(15.0))
    column = {"human_nan": "received_left", "pose_nan": "seen_x", "learner_nan": "heard_confidence"}[fault]
    assert 0.1 < np.isnan(trial[column]).mean() < 0.4


def test_faults_have_the_severity_of_their_field():
    assert faults_injected.faults_of("", 0.0) == Faults()
    assert faults_injected.faults_of("delay", 0.2) == Faults(delay=0.2)
    assert faults_injected.faults_of("pose_noise", 0.1) == Faults(pose_noise=0.1, yaw_noise=0.1)
    assert faults_injected.faults_of("freeze", 2.0) == Faults(freeze=2.0, freeze_time=3.0)


def test_claims_follow_the_rows():
    *success, finite = faults_injected.claims(made_up(assisted=0.1))
    assert {claim.verdict for claim in (*success, finite)} == {"holds"}
    assert len(success) == len(FAULTS)
    *success, finite = faults_injected.claims(made_up(assisted=-0.2, reached=1))
    assert {claim.verdict for claim in (*success, finite)} == {"reversed"}


def test_the_report_has_a_table_for_each_fault(rows, tiny):
    section = faults_injected.report(None, tiny, [rows])
    assert [len(table.rows) for table in section.tables] == [4] * 9 + [3] * 2
    assert len(section.data["faults"]) == len(rows)


def test_a_quick_run_takes_less_than_a_tenth_of_the_time():
    full, quick = (faults_injected.plan(None, size) for size in (FULL, QUICK))
    assert sum(len(one.task.arguments["learners"]) for one in full) == FULL.learners
    assert full[0].task.arguments["severities"] == {name: list(values) for name, values in FAULTS.items()}
    assert sum(one.seconds for one in quick) < 0.1 * sum(one.seconds for one in full)
