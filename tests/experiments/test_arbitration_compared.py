"""Arbitration methods are compared on the same trials."""

import dataclasses

import numpy as np
import pytest

from drake_shared.experiments import arbitration_compared


@pytest.fixture(scope="module")
def tiny(tiny):
    return dataclasses.replace(tiny, learners=1)


@pytest.fixture(scope="module")
def results(short_training, run_plan, tiny):
    """Of a learner of each kind, one trial in each arm, of the primary operator only."""
    with short_training() as patch:
        patch.setattr(arbitration_compared, "OPERATORS", ("primary",))
        return run_plan(arbitration_compared, tiny)


def made_up(*, gain=0.2, mixture=0.0, disagreement=1.0, learners=20):
    """Rows of trials in which shared control adds ``gain`` to success, and the mixture ``mixture`` more."""
    rng = np.random.default_rng(0)
    rows = []
    for learner in range(learners):
        for operator in arbitration_compared.OPERATORS:
            base = 0.5 + 0.05 * rng.standard_normal()
            for kind, arms in arbitration_compared.ARMS_OF_LEARNERS.items():
                more = {"none": 0.0, "mixture": gain + mixture}.get(kind, gain)
                for arm in arms:
                    noise = 0.01 * rng.standard_normal()
                    row = {measure.name: base + more + noise for measure in arbitration_compared.MEASURES}
                    row["disagreement_rate"] = 5.0 + rng.normal(0, 0.1)
                    row["disagreement_rate"] -= disagreement * (kind == "mixture")
                    rows.append(row | {"arm": arm, "kind": kind, "operator": operator, "learner": learner})
    return rows


def verdicts(rows):
    found = [claim.verdict for claim in arbitration_compared.claims(rows)]
    count = len(arbitration_compared.OPERATORS)
    return set(found[:count]), set(found[count : 2 * count]), set(found[2 * count : -1])


def test_arms_have_the_same_routes_and_seeds(results, tiny):
    rows = [row for result in results for row in result]
    arms = {(row["kind"], row["arm"]) for row in rows}
    assert len(arms) == sum(map(len, arbitration_compared.ARMS_OF_LEARNERS.values()))
    for learner in range(tiny.learners):
        routes = {(row["route"], row["seed"]) for row in rows if row["learner"] == learner}
        assert len(routes) == tiny.trials
    assert len({row["seed"] for row in rows}) == tiny.learners * tiny.trials
    weight = {row["arm"]: row["mean_human_weight"] for row in rows}
    assert (weight["human"], weight["agent"], weight["halves"]) == (1.0, 0.0, 0.5)


def test_a_repeated_task_gives_the_same_rows_and_the_report_shows_them(results, monkeypatch, tiny):
    monkeypatch.setattr(arbitration_compared, "OPERATORS", ("primary",))
    assert str(arbitration_compared.plan(None, tiny)[0].task.run()) == str(results[0])
    rows = [{**row, "operator": "unskilled"} for result in results for row in result]
    section = arbitration_compared.report(None, tiny, [*results, rows])
    assert len(section.pictures) == len(section.tables) == 1
    assert len(section.data["arbitration_compared"]) == 2 * len(rows)


def test_claims_follow_the_rows():
    assert verdicts(made_up()) == ({"holds"}, {"holds"}, {"holds"})
    worse = made_up(gain=-0.2, mixture=-0.1, disagreement=-1.0)
    assert verdicts(worse) == ({"reversed"}, {"reversed"}, {"reversed"})
    assert verdicts(made_up(gain=0.05))[2] == {"reversed"}


@pytest.mark.parametrize(("share", "verdict"), [(0.95, "holds"), (0.8, "reversed")])
def test_the_share_of_the_gain_that_human_authority_keeps(share, verdict):
    rows = made_up()
    alone = {
        (row["operator"], row["learner"]): row["intent_success"] for row in rows if row["arm"] == "human"
    }
    for row in rows:
        if row["arm"] == "guarded":
            row["intent_success"] = alone[row["operator"], row["learner"]] + share * 0.2
            row["intent_success"] += 0.002 * (row["learner"] % 5 - 2)
        elif row["arm"] == "blend" and row["kind"] == "default":
            row["intent_success"] = alone[row["operator"], row["learner"]] + 0.2
    last = arbitration_compared.claims(rows)[-1]
    assert last.verdict == verdict
    assert last.estimate.mean == pytest.approx(20.0 * (share - 0.9), abs=0.05)
