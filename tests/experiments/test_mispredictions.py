"""Mispredictions: their cases, trials, claims and report."""

import math

import numpy as np
import pytest

from drake_shared.experiments import misprediction_cases, mispredictions
from drake_shared.scenario import check_scenario, clearance_scorer, load_scenario
from drake_shared.simulation.trial import Trial


@pytest.fixture(scope="module")
def results(short_training, run_plan, tiny):
    with short_training(5):
        yield run_plan(mispredictions, tiny, only="default")


def rows_of(results):
    return [dict(row) for result in results for row in result["rows"]]


def trial_of(weights, *, period=0.5):
    columns = {"t": period * np.arange(len(weights)), "human_weight": np.array(weights)}
    return Trial(columns=columns, metadata={})


@pytest.mark.parametrize(
    ("weights", "weight", "recovery"),
    [
        ([0.0, 0.9, 0.8, 0.9, 0.9, 0.9, 0.1, 0.9], "above", math.nan),
        ([0.0, 0.9, 0.2, 0.3, 0.9, 0.1, 0.1, 0.1], "back", 1.5),
        ([0.9, 0.5, 0.5, 0.6, 0.9, 0.1, 0.1, 0.1], "back", 1.0),
        ([0.9, 0.9, 0.5, 0.4, 0.3, 0.1, 0.1, 0.1], "never", math.nan),
    ],
)
def test_the_weight_has_recovered_when_it_is_above_one_half_again(weights, weight, recovery):
    found = misprediction_cases.recovery(trial_of(weights), 0.5)
    assert found["weight"] == weight
    assert found["recovery"] == pytest.approx(recovery, nan_ok=True)


def test_trials_without_the_misprediction_are_counted_separately():
    trial = trial_of([0.9, 0.1, 0.9])
    assert misprediction_cases.recovery(trial, None)["weight"] == "unmet"
    assert misprediction_cases.recovery(trial, 20.0)["weight"] == "unmet"


@pytest.mark.parametrize("scenario", ["two_obstacles", "doorway"])
def test_the_new_obstacle_blocks_the_demonstrated_route_and_not_the_new_one(scenario):
    world = load_scenario(scenario)
    for changed in misprediction_cases.variants(scenario):
        check_scenario(changed)
        (route,) = changed.routes
        taught = world.route(route.name).path(world.start)
        along = taught.position(np.linspace(0.0, taught.length, 300))
        assert clearance_scorer(world)(along) > 0.0
        assert clearance_scorer(changed)(along) < 0.0
        assert {**world.route(route.name).sides, "new_obstacle": route.sides["new_obstacle"]} == route.sides


def test_all_arms_have_the_same_routes_and_seeds(results):
    rows = rows_of(results)
    assert len(rows) == 2 * 4 * 2 * (1 + 2 * 2)
    for learner in (0, 1):
        for case in misprediction_cases.CASES:
            own = [row for row in rows if row["learner"] == learner and row["case"] == case]
            assert len({(row["route"], row["seed"]) for row in own}) == 1
    world = load_scenario()
    untaught = {row["learner"]: row["route"] for row in rows if row["case"] == "unseen"}
    assert untaught == {0: world.routes[0].name, 1: world.routes[1].name}


def test_the_route_left_out_has_no_demonstration(monkeypatch):
    given = []
    monkeypatch.setattr(
        mispredictions, "train_all", lambda sets, seeds, *, preset: given.extend(sets) or list(sets)
    )
    ((whole, partial),) = mispredictions.train_pairs(None, "default", [1])
    routes = [route.name for route in load_scenario().routes]
    assert [item.provenance["route"] for item in whole.items] == routes
    assert [item.provenance["route"] for item in partial.items] == [routes[0], routes[2]]
    assert len(given) == 2


def test_the_human_alone_stays_close_to_the_route_and_keeps_the_weight(results):
    alone = [row for row in rows_of(results) if row["arm"] == "human"]
    assert all(row["intent_success"] and row["strayed"] < 0.2 for row in alone)
    assert {row["weight"] for row in alone} == {"above"}


def test_only_one_arm_has_authority(results):
    rows = [row for row in rows_of(results) if row["arm"] != "human"]
    assert rows
    weights = {
        arm: [row["mean_human_weight"] for row in rows if row["arm"] == arm]
        for arm in misprediction_cases.ARMS
    }
    assert not np.allclose(weights["on"], weights["off"])


def rows_of_20_learners(results):
    """Ten copies of the rows of both learners."""
    return [{**row, "learner": row["learner"] + 2 * copy} for copy in range(10) for row in rows_of(results)]


def success(share, row):
    return share + 0.005 * (row["learner"] % 5)


def test_verdicts_follow_from_the_rows(results):
    rows = rows_of_20_learners(results)
    for row in rows:
        row.update(intent_success=success(0.97, row), collision=False)
    assert {claim.verdict for claim in mispredictions.claims(rows)} == {"holds"}
    guarded = [row for row in rows if row["arm"] == "on" and row["preset"] == "paper"]
    for row in guarded:
        row["collision"] = row["case"] in ("unseen", "changed") and row["learner"] % 2 == 0
    *_, routes, obstacles, default_routes, default_obstacles = mispredictions.claims(rows)
    assert [one.verdict for one in (routes, obstacles)] == ["reversed", "holds"]
    assert [one.verdict for one in (default_routes, default_obstacles)] == ["holds", "holds"]
    assert "40 of 80 trials" in routes.text
    # Collisions that the human alone has too do not count.
    for row in rows:
        row["collision"] |= row["arm"] == "human"
    assert mispredictions.claims(rows)[-4].verdict == "holds"


def test_a_claim_does_not_hold_below_the_required_success(results):
    rows = rows_of_20_learners(results)
    for row in rows:
        row["intent_success"] = success(0.97 if row["case"] in ("unseen", "changed") else 0.9, row)
    verdicts = {claim.text: claim.verdict for claim in mispredictions.claims(rows) if "Intent" in claim.text}
    assert len(verdicts) == 8
    for text, verdict in verdicts.items():
        assert (verdict == "holds") == ("route" in text)


def test_the_report_contains_every_case_and_arm(results, tiny):
    section = mispredictions.report(None, tiny, results)
    assert len(section.pictures) == 3
    assert [len(table.rows) for table in section.tables] == [4 * 5] * 2
    assert len(section.data["mispredictions"]) == 80
