"""The frozen benchmark: its scenes, its trials, and its table from known results."""

import dataclasses
import json
import math

import pytest

from drake_shared.common.errors import InputError
from drake_shared.experiments import compare_trials
from drake_shared.experiments.compare import QUICK, Plan, claims, compare, report, scene_set_hash
from drake_shared.experiments.compare_figure import losses, table
from drake_shared.experiments.compare_scenes import COUNT, KINDS, SCENES, TUNING, generate, write_scenes
from drake_shared.experiments.compare_trials import CONDITIONS, MEASURES, run_case
from drake_shared.experiments.compare_tuning import BUDGET, candidates
from drake_shared.learners import load_learner
from drake_shared.scenario import load_scenario
from drake_shared.scenario.files import scene_set

HASH = "64c3bc492206"


def test_the_scenes_are_frozen():
    assert scene_set_hash() == HASH
    assert len(scene_set(SCENES)) == 2 * (COUNT + len(TUNING))


@pytest.mark.parametrize("number", [0, 5])
def test_a_seed_gives_the_stored_scene_again(number, tmp_path):
    stored = list(scene_set(SCENES).values())[2 * number : 2 * number + 2]
    scenes = generate(number)
    assert [scene.name for scene in scenes] == [scene["name"] for scene in stored]
    for scene, kept in zip(scenes, stored, strict=True):
        assert scene == load_scenario(f"{SCENES}/{kept['name']}")


def test_a_file_of_scenes_is_written_as_it_is_read(tmp_path):
    write_scenes(tmp_path / "few.json", 1)
    written = json.loads((tmp_path / "few.json").read_text())
    assert written == list(scene_set(SCENES).values())[:2]


def test_every_scene_is_a_task_with_several_goals_and_a_way_to_each():
    for number in range(0, COUNT, 7):
        kind = KINDS[number % len(KINDS)]
        scene = load_scenario(f"{SCENES}/scene_{number:02d}")
        changed = load_scenario(f"{SCENES}/scene_{number:02d}_{kind}")
        for one in (scene, changed):
            assert len(one.goals) in (2, 3)
            assert {one.goal_of(route).name for route in one.routes} == {goal.name for goal in one.goals}
        assert len(scene.obstacles) in (3, 4, 5)
        new = [item for item in changed.obstacles if item not in scene.obstacles]
        assert len(new) == 1
        assert (bool(new[0].path), new[0].mapped) == (kind == "moving", kind != "unmapped")


def test_scenes_for_tuning_are_not_scored():
    scored = {case["scene"] for case in Plan().cases()}
    assert not scored & {f"{SCENES}/{name}" for name in TUNING}
    assert len({(case["scene"], case["index"], case["demonstrations"]) for case in Plan().cases()}) == 330


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"arbiters": ("blendd",)}, "arbiters"),
        ({"scenes": 51}, "scenes"),
        ({"scenes": 0, "learners": 0}, "learners"),
        ({"demonstrations": (0,)}, "demonstrations"),
    ],
)
def test_a_plan_out_of_range_is_refused(given, field):
    with pytest.raises(InputError) as caught:
        Plan(**given)
    assert caught.value.field == field


def row(case, arbiter, condition, success, **values):
    measures = dict.fromkeys(MEASURES, 0.0) | {"intent_success": success, "recovery": None} | values
    world = {"scene": "s", "learner": case, "demonstrations": 3, "world": "as taught"}
    return {"case": case, "arbiter": arbiter, "condition": condition, "trials": 4, **world, **measures}


@pytest.fixture
def rows():
    """Eight cases: the blend gains 50 points with noise, and loses 25 points when switching."""
    found = []
    for case in range(8):
        wobble = 0.01 * (case % 2)
        for condition, alone, blend in (("noise 1.2", 0.4, 0.9), ("switching", 1.0, 0.75)):
            found.append(row(case, "human", condition, alone - wobble, human_effort=10.0))
            found.append(row(case, "blend", condition, blend - 2 * wobble, human_effort=8.0, recovery=1.5))
    return found


def test_the_table_shows_means_over_cases_and_every_loss(rows):
    shown = table(rows)
    human, blend = (dict(zip(shown.head, line, strict=True)) for line in shown.rows)
    assert human["intent success, %"].startswith("69.5 ")
    assert blend["intent success, %"].startswith("81.5 ")
    assert blend["human effort, rad"].startswith("8 ")
    assert human["losses"] == "none"
    assert losses(rows, "blend") == ["switching (−25.5)"]


def test_a_gain_over_the_human_alone_is_tested_in_pairs(rows):
    (claim,) = claims(rows)
    assert claim.verdict == "holds"
    assert claim.estimate.mean == pytest.approx(12.0)
    assert claim.effect > 1.0


def test_the_report_names_the_scenes_and_draws_every_cell(rows):
    section = report(rows, [{"arbiter": "traded:threshold=0.7", "tried": {}}])
    assert HASH in " ".join(section.text)
    assert "traded:threshold=0.7" in " ".join(section.text)
    assert len(section.pictures) == 1


def test_each_arbiter_gets_the_same_budget_of_settings():
    assert candidates("halves", "two_obstacles") == ["halves"]
    found = candidates("traded", "two_obstacles")
    assert found[0] == "traded"
    assert len(found) == len(set(found)) == BUDGET
    assert found == candidates("traded", "two_obstacles")


def test_all_arbiters_drive_the_same_trials(monkeypatch):
    monkeypatch.setattr(compare_trials, "learner_of", lambda *_: load_learner("two_obstacles"))
    found = run_case("two_obstacles", {}, ["human", "agent", "blend"], 3, 0, ["primary", "switching"])
    assert [(one["arbiter"], one["condition"], one["trials"]) for one in found] == [
        (arbiter, condition, 3 if condition == "primary" else 2)
        for arbiter in ("human", "agent", "blend")
        for condition in ("primary", "switching")
    ]
    human, agent, blend = found[::2]
    assert human["intent_success"] == blend["intent_success"] == 1.0
    assert agent["intent_success"] == pytest.approx(1.0 / 3.0)
    assert agent["wrong_route"] == pytest.approx(2.0 / 3.0)
    assert found[1]["recovery"] == 0.0
    assert human["recovery"] is None


def test_a_run_is_resumed_with_the_same_report(monkeypatch, tmp_path):
    monkeypatch.setattr(compare_trials, "learner_of", lambda *_: load_learner("two_obstacles"))
    plan = dataclasses.replace(QUICK, scenes=0, arbiters=("halves",))
    plan = dataclasses.replace(plan, conditions=("primary",))
    monkeypatch.setattr("drake_shared.experiments.compare.SHIPPED", ("two_obstacles",))
    monkeypatch.setattr("drake_shared.experiments.compare_tuning.CONDITIONS", ("primary",))
    monkeypatch.setattr("drake_shared.experiments.compare.TUNING", TUNING[:1])
    first = compare(tmp_path / "out", plan)
    report_file = tmp_path / "out" / "report.json"
    kept = json.loads(report_file.read_text())
    assert kept["about"]["hash of the scenes"] == HASH
    report_file.unlink()
    again = compare(tmp_path / "out", plan, resume=True)
    assert again.tables == first.tables
    assert [claim.verdict for claim in again.claims] == ["open"]
    assert all(math.isfinite(one["intent_success"]) for one in again.data["compare"])
    assert set(CONDITIONS) > {one["condition"] for one in again.data["compare"]}
