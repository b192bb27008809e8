"""The arm in the report: its trials, claims and section."""

import numpy as np
import pytest

from drake_shared.experiments import manipulator, manipulator_trials
from drake_shared.experiments.common import scenario_of
from drake_shared.experiments.manipulator_trials import AGENT, ALONE, CONTROLS, CUPS, SHARED
from drake_shared.experiments.section import FULL, QUICK
from drake_shared.robots import Arm
from drake_shared.simulation.config import config_for_robot
from drake_shared.systems.arbiters import make_arbiter

CASES = [
    {"operator": operator, "control": control, "keeps_clear": keeps_clear, "trials": 1}
    for operator, control, keeps_clear in [
        ("steady", ALONE, False),
        ("steady", AGENT, False),
        ("noisy, two axes", ALONE, True),
        ("noisy, two axes", SHARED, True),
    ]
]


@pytest.fixture(scope="module")
def results(short_training):
    """Of one learner that is barely trained."""
    with short_training():
        return [
            manipulator_trials.run_cups(0, CASES, 1),
            manipulator_trials.run_targets(0, ["steady"], 1),
        ]


def made_up(*, gain=0.45, less=0.5, contact=0.0, learners=20):
    """Rows in which shared control adds ``gain`` to success and takes ``less`` off switches and time."""
    rng = np.random.default_rng(0)
    rows = []
    for learner in range(learners):
        for case in manipulator.cases_of(1):
            shared, varies = case.control == SHARED, 0.02 * rng.standard_normal()
            rows.append(
                {**case.condition().columns, "learner": learner, "seed": learner}
                | {"intent_success": 0.4 + gain * shared + varies, "wrong_goal": 0.0}
                | {"collision": contact, "mean_human_weight": 0.5}
                | dict.fromkeys(("completion_time", "plane_switches"), 9.0 - less * shared + varies)
            )
    return rows


def plants(rms, learners=20):
    return [{"learner": one, "rms": rms * (1.0 + 0.01 * (one % 5))} for one in range(learners)]


def test_each_way_to_share_control_has_the_same_routes_and_seeds(results):
    rows = results[0]["trials"]
    assert len({(row["route"], row["seed"]) for row in rows}) == 1
    alone, agent = (
        next(row for row in rows if row["control"] == control and row["operator"] == "steady")
        for control in (ALONE, AGENT)
    )
    assert (alone["mean_human_weight"], agent["mean_human_weight"]) == (1.0, 0.0)
    assert alone["intent_success"]


def test_an_arm_that_keeps_clear_does(results):
    kept = [row for row in results[0]["trials"] if row["keeps_clear"]]
    assert len(kept) == 2
    assert all(row["clearance"] > manipulator_trials.CLEARANCE - 0.0005 for row in kept)


def test_both_plants_follow_the_same_commands(results):
    (row,) = results[0]["plants"]
    assert 0.0 < row["rms"] < 0.005


def test_a_steady_operator_alone_selects_the_target(results):
    alone, _ = results[1]
    assert (alone["control"], alone["selected"]) == (ALONE, 1.0)
    assert np.isnan(alone["throughput"])  # One selection has no effective width.


def test_an_arm_can_have_the_arbiters_that_are_compared():
    for config in CONTROLS.values():
        make_arbiter(config.arbitration, robot=Arm(), scenario=scenario_of(CUPS))


@pytest.mark.parametrize(
    ("control", "angle"), [("conflict angle 0.5 rad", 0.5), ("conflict angle 1.6 rad", 1.6), (SHARED, 1.2)]
)
def test_conflict_angles_are_those_of_the_arm_that_runs(control, angle):
    assert config_for_robot(CONTROLS[control], Arm()).authority.conflict_angle == angle


def test_claims_follow_the_rows():
    assert {claim.verdict for claim in manipulator.claims(made_up(), plants(0.001))} == {"holds"}
    worse = manipulator.claims(made_up(gain=-0.2, less=-0.5, contact=1.0), plants(0.006))
    assert {claim.verdict for claim in worse} == {"reversed"}


def test_the_report_shows_every_case_and_every_plan_is_that_of_the_arm(results):
    section = manipulator.report(None, QUICK, results)
    assert len(section.tables[0].rows) == len(CASES)
    assert len(section.tables[2].rows) == 2
    assert section.data["manipulator_targets"] == results[1]
    for size, most in ((FULL, 720.0), (QUICK, 40.0)):
        plan = manipulator.plan("doorway", size)
        assert plan == manipulator.plan(None, size)
        assert sum(one.seconds for one in plan) < most
