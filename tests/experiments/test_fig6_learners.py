"""Second learners: what is matched in a repeat, what becomes of failures, and what follows from rows."""

import dataclasses
from collections import Counter

import numpy as np
import pytest

from drake_shared.common.errors import RunError
from drake_shared.experiments import second_learners, setting
from drake_shared.experiments.fig6_comparison import (
    ARMS,
    MEASURES,
    PRESETS,
    PRIMARY_ARM,
    SETUPS,
    Cell,
    compare,
    repeat_means,
)
from drake_shared.experiments.section import FULL, QUICK
from drake_shared.operators.named import OPERATORS

HERE = {"scenario": None, "preset": "default"}


@pytest.fixture
def brief(monkeypatch):
    """Learners that are barely trained; what they were taught is noted."""
    noted = []
    short = {
        name: dataclasses.replace(one, iterations=40, restarts=0) for name, one in setting.STUDIED.items()
    }
    monkeypatch.setattr(setting, "STUDIED", short)

    def train_all(taught, seeds, **options):
        trained = setting.train_all(taught, seeds, **options)
        weighted = options.get("weighted", [True] * len(taught))
        noted.extend(zip(taught, seeds, weighted, trained, strict=True))
        return trained

    monkeypatch.setattr(second_learners, "train_all", train_all)
    return noted


def row(setup="shared", **told):
    """A trial, of the primary operator where nothing else is said."""
    usual = {"disagreement": 500.0, "mean_human_weight": 0.5, "intent_success": True}
    usual |= {"disagreement_rate": 2.5, "human_effort": 80.0, "clearance": 0.1, "unmatched_drives": 0}
    cell = {"preset": "paper", "operator": "primary", "arm": PRIMARY_ARM, "repeat": 0}
    return {**cell, "setup": setup, **usual, **told}


def made_up(size, **shifts):
    """Rows of all repeats of a size; Setup 2 differs from Setup 1 by the shifts and a little noise."""
    rng = np.random.default_rng(0)
    rows = []
    for task in second_learners.tasks(None, size):
        given = task.arguments
        for operator in given["operators"]:
            for repeat in given["repeats"]:
                for setup, arm in second_learners._conditions(given["setups"], given["arms"]):
                    told = {"preset": given["preset"], "operator": operator, "arm": arm, "repeat": repeat}
                    one = row(setup, **told)
                    one["disagreement"] += rng.normal(0.0, 5.0)
                    for name, shift in shifts.items() if setup == "human" else ():
                        one[name] += shift
                    rows.append(one)
    return rows


def claims_of(section, text):
    return [claim for claim in section.claims if claim.text.startswith(text)]


@pytest.mark.parametrize("size", [FULL, QUICK])
def test_every_repeat_is_made_once(size):
    found = Counter()
    for task in second_learners.tasks(None, size):
        given = task.arguments
        assert second_learners.cost(task) > 0
        assert given["trials"] == 10
        for operator in given["operators"]:
            found.update((given["preset"], operator, repeat) for repeat in given["repeats"])
            primary = operator == "primary" and size.all_arms
            assert given["setups"] == (list(SETUPS) if primary else ["shared", "human"])
            assert given["arms"] == (list(ARMS) if primary else [PRIMARY_ARM])
    assert set(found.values()) == {1}
    counts = Counter((preset, operator) for preset, operator, _ in found)
    others = {(preset, name): size.other_repeats for preset in PRESETS for name in OPERATORS}
    expected = others | {(preset, "primary"): size.repeats for preset in PRESETS}
    assert counts == Counter({key: count for key, count in expected.items() if count})


def test_no_seed_serves_two_purposes():
    starts = [
        second_learners._seed(repeat, purpose) + index
        for repeat in range(FULL.repeats)
        for purpose, count in ((0, 3), (10, 3), (30, 3), (50, second_learners.TRIALS))
        for index in range(count)
    ]
    assert len(set(starts)) == len(starts)


def test_in_a_repeat_all_is_the_same_but_what_is_compared(brief):
    arms = [PRIMARY_ARM, "even, K anew"]
    arguments = {"operators": ["switching"], "repeats": [0], "arms": arms, "setups": SETUPS, "trials": 2}
    rows = second_learners.run_repeats(**HERE, **arguments)
    first, *second = brief
    # The control is of the primary arm alone.
    driven = {}
    for one in rows:
        driven.setdefault((one["arm"], one["setup"]), []).append((one["seed"], one["route"]))
    assert set(driven) == {(arm, setup) for arm in arms for setup in SETUPS} - {(arms[1], "more")}
    assert len({tuple(trials) for trials in driven.values()}) == 1
    assert len(set(driven[PRIMARY_ARM, "shared"])) == 2
    assert {seed for _, seed, _, _ in brief} == {0}
    # Each begins with the base demonstrations, and what is added has the same scores in all setups.
    for taught, _, _, _ in second:
        assert [item.score for item in taught[:3]] == [item.score for item in first[0]]
    assert len({tuple(item.score for item in taught[3:]) for taught, *_ in second}) == 1
    modes = Counter(taught[3].provenance["mode"] for taught, *_ in second)
    assert modes == {"shared": 2, "human": 3}
    # Of both setups the same noise, of the control another.
    seeds = Counter(tuple(item.provenance["seed"] for item in taught[3:]) for taught, *_ in second)
    assert sorted(seeds.values()) == [1, 4]
    assert Counter(weighted for _, _, weighted, _ in second) == {True: 3, False: 2}


def test_k_is_that_of_the_first_learner_or_of_each(brief, monkeypatch):
    gains = []

    def run(scenario, learner, *, confidence_gain, **settings):
        gains.append((learner.confidence_gain, confidence_gain))
        return setting.run(scenario, learner, confidence_gain=confidence_gain, **settings)

    monkeypatch.setattr(second_learners, "run", run)
    arms = ["weighted, K kept", "weighted, K anew"]
    arguments = {"operators": ["primary"], "repeats": [1], "arms": arms, "setups": SETUPS[:2], "trials": 1}
    rows = second_learners.run_repeats(**HERE, **arguments)
    first, *second = [learner.confidence_gain for *_, learner in brief]
    assert sorted(gains[:2]) == sorted((own, first) for own in second)
    assert sorted(gains[2:]) == sorted((own, None) for own in second)
    assert len({first, *second}) == 3
    del brief[:]
    assert second_learners.run_repeats(**HERE, **arguments) == rows


def test_an_operator_that_fails_is_missed_and_breaks_nothing(brief, monkeypatch):
    hopeless = OPERATORS["unskilled"].behaviour
    lost = second_learners._seed(4, 0)

    def drives(scenario, *, seed, behaviour=None, **options):
        if seed == lost or behaviour == hopeless:
            raise RunError("the simulated operator fails")
        return setting.drives(scenario, seed=seed, behaviour=behaviour, **options)

    monkeypatch.setattr(second_learners, "drives", drives)
    rows = second_learners.run_repeats(
        **HERE,
        operators=["primary", "unskilled"],
        repeats=[3, 4],
        arms=[PRIMARY_ARM],
        setups=SETUPS[:2],
        trials=1,
    )
    missing = [(one["operator"], one["repeat"]) for one in rows if "failed" in one]
    assert sorted(missing) == [("primary", 4), ("unskilled", 3), ("unskilled", 4)]
    made = {(one["operator"], one["repeat"], one["setup"]) for one in rows if "failed" not in one}
    assert made == {("primary", 3, "shared"), ("primary", 3, "human")}
    section = second_learners.report(None, QUICK, [rows])
    assert "3 repeats are missing" in section.text[-1]
    assert "unskilled 2, primary 1" in section.text[-1]
    assert len(section.data["second_learners_missing"]) == 3
    # One repeat says nothing of any other.
    assert {claim.verdict for claim in section.claims} == {"open"}


def test_drives_with_other_seeds_are_told():
    rows = made_up(QUICK)
    for one in rows:
        one["unmatched_drives"] = int(one["repeat"] in (2, 5) and one["preset"] == "paper")
    assert "In 2 repeats that happened to one setup" in second_learners.report(None, QUICK, [rows]).text[-1]


def test_a_repeat_counts_once_however_many_trials_it_has():
    rows = [row(disagreement=value) for value in (1.0, 2.0, 6.0)] + [row("human", disagreement=4.0)]
    rows += [row(setup, repeat=1, clearance=None) for setup in SETUPS[:2]]
    rows += [row(repeat=2)]
    means = repeat_means(rows)
    (cell,) = means
    assert cell == Cell(preset="paper", operator="primary", arm=PRIMARY_ARM)
    assert means[cell][0]["shared"]["disagreement"] == pytest.approx(3.0)
    assert np.isnan(means[cell][1]["shared"]["clearance"])
    found = {one.measure: one for one in compare(means)}
    # The third repeat has no Setup 2.
    np.testing.assert_allclose(found["disagreement"].differences, [1.0, 0.0])
    assert found["clearance"].estimate.count == 1


def test_better_is_lower_or_higher_as_the_measure_has_it():
    shifts = {"disagreement": 40.0, "human_effort": -5.0, "clearance": -0.05}
    found = {one.measure: one for one in compare(repeat_means(made_up(QUICK, **shifts)))}
    assert found["disagreement"].estimate.mean == pytest.approx(40.0, abs=5.0)
    assert found["human_effort"].estimate.mean == pytest.approx(-5.0)
    assert found["clearance"].estimate.mean == pytest.approx(0.05)
    assert [found[name].verdict for name in ("disagreement", "human_effort", "clearance")] == [
        "holds",
        "reversed",
        "holds",
    ]


@pytest.mark.parametrize(("shift", "said"), [(40.0, "holds"), (-40.0, "reversed"), (2.0, "equivalent")])
def test_the_verdict_follows_from_the_rows(shift, said):
    section = second_learners.report(None, QUICK, [made_up(QUICK, disagreement=shift)])
    claims = claims_of(section, "disagreement is lower with Setup 1")
    assert [claim.verdict for claim in claims] == [said] * 2
    assert all(claim.estimate.count == QUICK.repeats for claim in claims)
    assert sum(f": {said}" in paragraph for paragraph in section.text) == 2
    assert any(paragraph.startswith("With 10 repeats intervals") for paragraph in section.text)
    # Nothing differs in the weight, which ten repeats do not prove.
    assert any("mean human weight" in text and "up to 30% of repeats" in text for text in section.text)
    assert [claim.verdict for claim in claims_of(section, "mean human weight")] == ["equivalent"] * 2


def test_a_full_report_shows_all_operators_arms_and_the_control():
    size = dataclasses.replace(FULL, repeats=6, other_repeats=4)
    section = second_learners.report(None, size, [made_up(size, disagreement=30.0)])
    # The bars, the points of each repeat, and two measures over operators and arms.
    assert len(section.pictures) == 4
    means, primary, rest = (table.rows for table in section.tables)
    cells = 2 * (4 + len(OPERATORS) - 1)
    assert len(means) == 2 * cells + 2
    assert len(primary) == 2 * 2 * len(MEASURES)
    assert len(rest) == 2 * (cells - 2)
    against = Counter(line[3] for line in primary)
    assert against == dict.fromkeys(["Setup 2", "the control"], 2 * len(MEASURES))
    assert len(section.claims) == 2 * len(MEASURES)
    assert len(section.data["second_learners_differences"]) == (cells + 2) * len(MEASURES)


def test_more_operators_make_the_primary_answer_harder():
    rows = made_up(dataclasses.replace(FULL, repeats=8, other_repeats=8), disagreement=3.0)
    alone = [one for one in rows if one["operator"] == "primary"]
    (few, many) = (
        next(one for one in compare(repeat_means(chosen)) if one.cell.is_primary) for chosen in (alone, rows)
    )
    assert few.measure == many.measure == "disagreement"
    assert few.plain == many.plain
    assert few.p < many.p
    assert many.estimate.low < few.estimate.low
