import dataclasses

import numpy as np
import pytest

from drake_shared.experiments import faults_injected, setting
from drake_shared.experiments.section import FULL, QUICK, Size
from drake_shared.learners.no_learner import NoLearner
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.faults import Faults
from drake_shared.simulation.trial import Trial, TrialSettings

TINY = Size(name="quick", repeats=1, other_repeats=0, all_arms=False, learners=2, trials=1)


@pytest.fixture(scope="module")
def rows():
    """Of two barely trained learners, each fault at its worst."""
    brief = {
        name: dataclasses.replace(one, iterations=20, restarts=0) for name, one in setting.STUDIED.items()
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(setting, "STUDIED", brief)
        return [row for task in faults_injected.tasks(None, TINY) for row in task.run()]


def made_up(*, assisted, reached=0):
    """Rows of six learners in which assistance adds ``assisted`` to each fault's success at its worst."""
    rows = [
        {"fault": fault, "severity": severity, "arm": arm, "learner": learner, "not_finite": 0}
        | {"intent_success": 0.5 + assisted * (arm == "assisted" and severity > 0.0)}
        for fault, severity in [("", 0.0), *((name, values[-1]) for name, values in FAULTS.items())]
        for arm in faults_injected.arms_of(fault)
        for learner in range(6)
    ]
    next(row for row in rows if row["fault"] == "pose_nan")["not_finite"] = reached
    return rows


FAULTS = faults_injected.FAULTS


def test_each_fault_strikes_and_all_else_is_the_same(rows):
    for learner in (0, 1):
        own = [row for row in rows if row["learner"] == learner]
        assert len({(row["route"], row["seed"]) for row in own}) == 1
        alone = {row["fault"]: row["human_effort"] for row in own if row["arm"] == "alone"}
        assert set(alone) == {"", *(name for name in FAULTS if "learner" not in name)}
        assert all(effort != alone[""] for fault, effort in alone.items() if fault)
        assisted = {row["fault"]: row["mean_human_weight"] for row in own if row["arm"] == "assisted"}
        assert set(assisted) == {"", *FAULTS}


def test_nothing_that_is_no_number_reaches_the_plant(rows):
    assert {row["not_finite"] for row in rows} == {0}
    columns = {name: np.zeros(5) for name in ("x", "yaw", "wheel_left", "shared_right", "received_left")}
    columns["x"][1] = columns["wheel_left"][1] = np.nan
    columns["yaw"][3] = np.inf
    columns["shared_right"][4] = np.nan
    columns["received_left"][0] = np.nan  # On the way there; it must end before the plant.
    assert faults_injected.not_finite(Trial(columns=columns, metadata={})) == 3


@pytest.mark.parametrize("fault", ["human_nan", "pose_nan", "learner_nan"])
def test_a_fault_that_is_to_send_what_is_no_number_does(fault):
    simulation = setting.simulation_of(
        None, SharedControlConfig(faults=faults_injected.faults_of(fault, 0.25))
    )
    trial = simulation.run(TrialSettings(), learner=NoLearner(15.0))
    column = {"human_nan": "received_left", "pose_nan": "seen_x", "learner_nan": "heard_confidence"}[fault]
    assert 0.1 < np.isnan(trial[column]).mean() < 0.4


def test_faults_are_those_of_their_name():
    assert faults_injected.faults_of("", 0.0) is None
    assert faults_injected.faults_of("delay", 0.2) == Faults(delay=0.2)
    assert faults_injected.faults_of("pose_noise", 0.1) == Faults(pose_noise=0.1, yaw_noise=0.1)
    assert faults_injected.faults_of("freeze", 2.0) == Faults(freeze=2.0, freeze_time=3.0)


def test_claims_follow_the_rows():
    *success, finite = faults_injected.claims(made_up(assisted=0.1))
    assert {claim.verdict for claim in (*success, finite)} == {"holds"}
    assert len(success) == len(FAULTS)
    *success, finite = faults_injected.claims(made_up(assisted=-0.2, reached=1))
    assert {claim.verdict for claim in (*success, finite)} == {"reversed"}


def test_the_report_has_a_table_for_each_fault(rows):
    section = faults_injected.report(None, TINY, [rows])
    assert [len(table.rows) for table in section.tables] == [4] * 9 + [3] * 2
    assert len(section.data["faults"]) == len(rows)


def test_sizes():
    full, quick = (faults_injected.tasks(None, size) for size in (FULL, QUICK))
    assert sum(len(task.arguments["learners"]) for task in full) == FULL.learners
    assert full[0].arguments["severities"] == {name: list(values) for name, values in FAULTS.items()}
    assert sum(map(faults_injected.cost, quick)) < 0.1 * sum(map(faults_injected.cost, full))
