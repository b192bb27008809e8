import dataclasses
import math

import numpy as np
import pytest

from drake_shared.experiments import mispredicted_cases, mispredictions, setting
from drake_shared.experiments.section import Size
from drake_shared.scenario import check_scenario, clearance_scorer, load_scenario
from drake_shared.simulation.trial import Trial

TINY = Size(name="quick", repeats=1, other_repeats=0, all_arms=False, learners=2, trials=1)


@pytest.fixture(scope="module")
def results():
    """Of barely trained learners."""
    brief = {
        name: dataclasses.replace(one, iterations=5, restarts=0) for name, one in setting.STUDIED.items()
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(setting, "STUDIED", brief)
        yield [task.run() for task in mispredictions.tasks(None, TINY)]


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
def test_the_weight_is_back_where_it_rises_above_a_half_after_it_fell(weights, weight, recovery):
    found = mispredicted_cases.recovery(trial_of(weights), 0.5)
    assert found["weight"] == weight
    assert found["recovery"] == pytest.approx(recovery, nan_ok=True)


def test_a_moment_that_never_came_is_counted_apart():
    trial = trial_of([0.9, 0.1, 0.9])
    assert mispredicted_cases.recovery(trial, None)["weight"] == "unmet"
    assert mispredicted_cases.recovery(trial, 20.0)["weight"] == "unmet"


@pytest.mark.parametrize("scenario", ["two_obstacles", "doorway"])
def test_the_new_obstacle_blocks_the_route_as_it_was_taught_and_not_as_it_is_driven(scenario):
    world = load_scenario(scenario)
    for changed in mispredicted_cases.variants(scenario):
        check_scenario(changed)
        (route,) = changed.routes
        taught = world.route(route.name).path(world.start)
        along = taught.position(np.linspace(0.0, taught.length, 300))
        assert clearance_scorer(world)(along) > 0.0
        assert clearance_scorer(changed)(along) < 0.0
        assert {**world.route(route.name).sides, "new_obstacle": route.sides["new_obstacle"]} == route.sides


def test_all_arms_drive_the_same_routes_and_seeds(results):
    rows = rows_of(results)
    assert len(rows) == 2 * 4 * 2 * (1 + 2 * 2)
    for learner in (0, 1):
        for case in mispredicted_cases.CASES:
            own = [row for row in rows if row["learner"] == learner and row["case"] == case]
            assert len({(row["route"], row["seed"]) for row in own}) == 1
    world = load_scenario()
    untaught = {row["learner"]: row["route"] for row in rows if row["case"] == "unseen"}
    assert untaught == {0: world.routes[0].name, 1: world.routes[1].name}


def test_the_route_never_taught_is_in_no_demonstration(monkeypatch):
    given = []
    monkeypatch.setattr(
        mispredictions, "train_all", lambda sets, seeds, *, preset: given.extend(sets) or list(sets)
    )
    ((whole, partial),) = mispredictions._trained(None, "default", [1])
    routes = [route.name for route in load_scenario().routes]
    assert [item.provenance["route"] for item in whole.items] == routes
    assert [item.provenance["route"] for item in partial.items] == [routes[0], routes[2]]
    assert len(given) == 2


def test_the_human_alone_strays_little_and_meets_every_moment(results):
    alone = [row for row in rows_of(results) if row["arm"] == "human"]
    assert all(row["intent_success"] and row["strayed"] < 0.2 for row in alone)
    assert {row["weight"] for row in alone} == {"above"}


def test_authority_takes_part_in_its_arm_only(results):
    rows = [row for row in rows_of(results) if row["arm"] != "human"]
    assert rows
    weights = {
        arm: [row["mean_human_weight"] for row in rows if row["arm"] == arm]
        for arm in mispredicted_cases.ARMS
    }
    assert not np.allclose(weights["on"], weights["off"])


def rows_of_six_learners(results):
    """The rows of both as if they were those of six: fewer have no verdict."""
    return [{**row, "learner": row["learner"] + 2 * copy} for copy in range(3) for row in rows_of(results)]


def test_the_verdicts_follow_from_the_rows(results):
    rows = rows_of_six_learners(results)
    for row in rows:
        row.update(intent_success=True, collision=False)
    assert {claim.verdict for claim in mispredictions.claims(rows)} == {"holds"}
    guarded = [row for row in rows if row["arm"] == "on" and row["preset"] == "paper"]
    guarded[0]["collision"] = True
    *_, ways, obstacles, default_ways, default_obstacles = mispredictions.claims(rows)
    assert [one.verdict for one in (ways, obstacles)] == ["reversed", "holds"]
    assert [one.verdict for one in (default_ways, default_obstacles)] == ["holds", "holds"]
    assert "1 of 24 trials" in ways.text
    key = {name: guarded[0][name] for name in ("case", "operator", "learner", "seed")}
    (alone,) = (row for row in rows if row["arm"] == "human" and key.items() <= row.items())
    alone["collision"] = True
    assert mispredictions.claims(rows)[-4].verdict == "holds"


def test_less_success_than_asked_for_does_not_hold(results):
    rows = rows_of_six_learners(results)
    for row in rows:
        row["intent_success"] = row["case"] in ("unseen", "changed")
    verdicts = {claim.text: claim.verdict for claim in mispredictions.claims(rows) if "Intent" in claim.text}
    assert len(verdicts) == 8
    for text, verdict in verdicts.items():
        assert (verdict == "holds") == ("route" in text)


def test_the_report_shows_every_case_and_arm(results):
    section = mispredictions.report(None, TINY, results)
    assert len(section.pictures) == 3
    assert [len(table.rows) for table in section.tables] == [4 * 5] * 2
    assert len(section.data["mispredictions"]) == 80
