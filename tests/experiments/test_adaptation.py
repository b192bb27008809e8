"""Where the estimate of the noise starts: rows, verdicts and the report."""

import numpy as np
import pytest

from drake_shared.experiments import adaptation
from drake_shared.experiments.section import FULL, QUICK
from drake_shared.operators.named import OPERATORS


def made_up(learners=8):
    """Rows in which the own prior halves the error, and all of somebody else's are noticed."""
    rng = np.random.default_rng(0)
    rows = []
    for learner in range(learners):
        for operator in ("primary", "noisy", "unskilled"):
            for arm in adaptation.ARMS:
                error = (0.1 if arm.startswith("own") else 0.2) + 0.001 * rng.standard_normal()
                noticed = float(arm == "mistaken")
                success = 0.5 if (operator, arm) == ("unskilled", "others") else 1.0
                rows.append(
                    {"arm": arm, "operator": operator, "learner": learner, "stopped_early": False}
                    | {"intent_success": success, "collision": 1.0 - success, "noticed": noticed}
                    | {"noise_error": np.nan if operator == "noisy" else error, "first_error": error}
                    | {"notice_time": 2.0 if noticed else np.nan}
                )
    return rows


def test_verdicts_are_those_of_the_rows():
    verdicts = [claim.verdict for claim in adaptation.claims(made_up())]
    # The own prior halves the error of none and of others, and the first drive gives as good a prior as six.
    assert verdicts[3:6] == ["holds", "holds", "equivalent"]


def test_the_report_names_the_worst_operator():
    section = adaptation.report(None, QUICK, [made_up()])
    lines = {line[0]: line for line in section.tables[0].rows}
    assert lines[adaptation.ARMS["others"]][2] == "50 (unskilled)"
    assert len(section.tables[1].rows) == 3 * len(adaptation.ARMS)


def test_the_arms_have_the_same_trials_and_another_driver_is_noticed(short_training):
    with short_training():
        rows = adaptation.run_operator(None, "primary", 1, ["primary", "unskilled"])
    trials = [[(row["route"], row["seed"]) for row in rows if row["arm"] == arm] for arm in adaptation.ARMS]
    assert all(one == trials[0] for one in trials)
    own, mistaken = ([row for row in rows if row["arm"] == arm] for arm in ("own", "mistaken"))
    assert not any(row["noticed"] for row in own)
    assert all(row["noticed"] and 0.5 < row["notice_time"] < 8.0 for row in mistaken)
    assert np.mean([row["first_error"] for row in own]) < np.mean([row["first_error"] for row in mistaken])


@pytest.mark.parametrize(("size", "operators"), [(FULL, len(OPERATORS)), (QUICK, 4)])
def test_each_operator_is_a_task(size, operators):
    assert len(adaptation.plan(None, size)) == operators
