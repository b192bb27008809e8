"""Designs: every field is checked, orders are balanced, and the protocol keeps what was declared."""

import itertools
import json
from collections import Counter
from pathlib import Path

import pytest
import yaml

import drake_shared.study
from drake_shared.common.errors import InputError
from drake_shared.study.design import load_study, study_from_json
from drake_shared.study.orders import assign_groups, assign_orders, imbalance, williams_square
from drake_shared.study.protocol import changes_between, open_planned, plan, read_protocol
from drake_shared.study.questionnaires import load_questionnaire
from drake_shared.study.steps import end_of_trials, expected_minutes, participants_of, steps_of

TEMPLATES = Path(drake_shared.study.__file__).parent / "templates"


@pytest.fixture
def data():
    return yaml.safe_load((TEMPLATES / "assistance.yaml").read_text())


@pytest.fixture
def folder(tmp_path, data):
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(data))
    return tmp_path


@pytest.mark.parametrize("count", range(1, 8))
def test_williams_square_has_each_condition_in_each_place_and_each_pair_before_and_after(count):
    rows = williams_square(count)
    places = Counter((place, item) for row in rows for place, item in enumerate(row))
    pairs = Counter(pair for row in rows for pair in itertools.pairwise(row))
    assert set(places.values()) == {len(rows) // count}
    assert len(pairs) == count * (count - 1)
    assert len(set(pairs.values())) <= 1
    assert imbalance(rows) == (0, 0)


@pytest.mark.parametrize(("order", "participants"), [("williams", 12), ("permutations", 24)])
def test_assigned_orders_are_balanced_and_follow_from_the_seed(order, participants):
    orders = assign_orders(order, 4, participants, seed=3)
    assert imbalance(orders) == (0, 0)
    assert orders == assign_orders(order, 4, participants, seed=3)
    assert orders != assign_orders(order, 4, participants, seed=4)


def test_random_orders_may_be_unbalanced_and_this_is_measured():
    assert imbalance([(0, 1), (0, 1), (1, 0)]) == (1, 1)


@pytest.mark.parametrize(
    ("make", "participants"),
    [
        (lambda n: assign_orders("williams", 3, n, 1), 10),
        (lambda n: assign_orders("permutations", 3, n, 1), 8),
        (lambda n: assign_groups(3, n, 1), 10),
    ],
)
def test_numbers_of_participants_that_cannot_be_balanced_are_refused(make, participants):
    with pytest.raises(InputError) as caught:
        make(participants)
    assert caught.value.field == "participants"


def test_groups_have_equal_sizes():
    assert set(Counter(assign_groups(3, 12, seed=1)).values()) == {4}


def test_templates_are_studies(tmp_path, data):
    for template in TEMPLATES.glob("*.yaml"):
        study = yaml.safe_load(template.read_text())
        if template.stem == "paper_setups":
            for name in study["conditions"]:
                study["conditions"][name]["learner"] = "two_obstacles_paper"
        found = study_from_json(study, source=template)
        assert found.name == template.stem
        assert 3.0 < expected_minutes(found, found.load_scenario()) < 30.0


def changed(data, path, value):
    *parents, last = path
    inner = data
    for name in parents:
        inner = inner[name]
    inner[last] = value
    return data


@pytest.mark.parametrize(
    ("path", "value", "field"),
    [
        (["particpants"], 3, "particpants"),
        (["participants"], "twelve", "participants"),
        (["participants"], 5, "participants"),
        (["participants"], True, "participants"),
        (["trials"], 7, "trials"),
        (["order"], "latin", "order"),
        (["routes"], ["nowhere"], "routes[0]"),
        (["conditions", "shared", "config"], {"arbitraton": "blend"}, "conditions.shared.config.arbitraton"),
        (["conditions", "shared", "config"], {"look_ahead": -1}, "conditions.shared.config.look_ahead"),
        (["conditions", "shared", "learner"], "gone.safetensors", "conditions.shared.learner"),
        (["conditions", "shared", "page"], {"walls": True}, "conditions.shared.page.walls"),
        (["learner"], None, "conditions.shared.learner"),
        (["conditions"], {"one": {}}, "conditions"),
        (["texts"], {}, "texts.consent"),
        (["questionnaires", "block"], ["mdmt"], "questionnaires"),
        (["measures", "primary"], [], "measures.primary"),
        (["measures", "primary", 0, "name"], "speed", "measures.primary[0].name"),
        (["measures", "primary", 0, "smallest_effect"], 0, "measures.primary[0].smallest_effect"),
        (["measures", "primary", 1, "name"], "completion_time", "measures.primary[1].name"),
        (["exclusions", 0], {"measure": "late_share"}, "exclusions[0].above"),
        (["exclusions", 0], {"measure": "luck", "above": 1}, "exclusions[0].measure"),
        (["name"], "My study", "name"),
        (["seed"], -1, "seed"),
        (["folder"], "x", "folder"),
    ],
)
def test_mistakes_are_named_by_their_field(data, path, value, field):
    with pytest.raises(InputError) as caught:
        study_from_json(changed(data, path, value), source="study.yaml")
    assert (caught.value.source, caught.value.field) == ("study.yaml", field)
    assert "\n" not in str(caught.value)


def test_each_participant_meets_every_condition_and_drives_each_route_as_often(folder):
    study = load_study(folder / "study.yaml")
    for participant in participants_of(study):
        steps = steps_of(study, participant)
        driven = [step for step in steps if step.kind == "trial" and step.block]
        assert set(Counter((step.condition, step.route) for step in driven).values()) == {2}
        assert [step.index for step in steps] == list(range(len(steps)))
        assert [step.name for step in steps] == sorted({step.name for step in steps})
        assert [step.kind for step in steps[:2]] == ["consent", "introduction"]
        assert steps[-1].kind == "thanks"
    seeds = [step.seed for who in participants_of(study) for step in steps_of(study, who) if step.seed]
    assert len(set(seeds)) == len(seeds)


def test_trials_end_where_a_questionnaire_or_another_block_follows(folder, data):
    for asked, length in ((["sus"], 1), ([], 6)):
        study = study_from_json(
            data | {"questionnaires": {"trial": asked, "block": ["raw_tlx"]}}, source=folder / "study.yaml"
        )
        steps = steps_of(study, "P01")
        trials = [step for step in steps if step.kind == "trial"]
        practice, driven = trials[0], trials[2]
        found = [end_of_trials(steps, first) - first.index for first in (practice, driven)]
        assert found == [2, length]


def test_workload_and_usability_are_scored_from_0_to_100():
    tlx, sus = (load_questionnaire(name, Path()) for name in ("raw_tlx", "sus"))
    assert tlx.score({item["name"]: 20 for item in tlx.items})["workload"] == pytest.approx(100.0)
    assert tlx.score({item["name"]: 0 for item in tlx.items})["workload"] == 0.0
    best = {f"item{number}": 5 if number % 2 else 1 for number in range(1, 11)}
    worst = {f"item{number}": 1 if number % 2 else 5 for number in range(1, 11)}
    assert sus.score(best)["usability"] == 100.0
    assert sus.score(worst)["usability"] == 0.0
    for answers, field in [(best | {"item1": 6}, "item1"), ({"item1": 3}, "item2"), (best | {"x": 1}, "x")]:
        with pytest.raises(InputError) as caught:
            sus.check(answers)
        assert caught.value.field == field


def test_protocol_is_hashed_and_shows_later_changes(folder, data):
    first, changes = plan(folder)
    assert not changes
    assert plan(folder)[0] == first
    open_planned(folder)
    (folder / "study.yaml").write_text(yaml.safe_dump(data | {"trials": 9}))
    with pytest.raises(InputError) as caught:
        open_planned(folder)
    assert caught.value.field == "study.trials"
    second, changes = plan(folder)
    assert changes == ["study.trials: 6 -> 9"]
    assert second["hash"] != first["hash"]
    assert second["amendments"] == []


def test_after_the_first_participant_a_change_needs_a_reason_and_is_logged(folder, data):
    first, _ = plan(folder)
    (folder / "data" / "P01").mkdir(parents=True)
    (folder / "data" / "P01" / "000_consent.json").write_text("{}")
    (folder / "study.yaml").write_text(yaml.safe_dump(data | {"trials": 9}))
    for reason in (None, " "):
        with pytest.raises(InputError):
            plan(folder, amend=reason)
    assert read_protocol(folder) == first
    second, _ = plan(folder, amend="too few trials in the pilot")
    (amendment,) = second["amendments"]
    assert amendment["from"] == first["hash"]
    assert amendment["changes"] == ["study.trials: 6 -> 9"]


def test_a_protocol_that_was_edited_is_refused(folder):
    protocol, _ = plan(folder)
    protocol["content"]["study"]["seed"] = 2
    (folder / "protocol.json").write_text(json.dumps(protocol))
    with pytest.raises(InputError) as caught:
        read_protocol(folder)
    assert caught.value.field == "hash"


def test_changes_name_the_path_of_each_field():
    assert changes_between({"a": {"b": 1, "c": 2}}, {"a": {"b": 1, "c": 3}, "d": 4}) == [
        "a.c: 2 -> 3",
        "d: null -> 4",
    ]
