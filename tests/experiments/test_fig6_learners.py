"""Second learners: pairs within a repeat, failures, and the claims from rows."""

import dataclasses
from collections import Counter

import numpy as np
import pytest

from drake_shared.common.errors import RunError
from drake_shared.experiments import common, fig6_learners as second_learners, section as sizes, training
from drake_shared.experiments.fig6_comparison import (
    ARMS,
    CRITERIA,
    PRIMARY_ARM,
    SETUPS,
    Cell,
    compare,
    repeat_means,
)
from drake_shared.experiments.section import FULL
from drake_shared.experiments.training import PRESETS
from drake_shared.operators.named import OPERATORS

QUICK = dataclasses.replace(sizes.QUICK, repeats=10, paper=None)
HERE = {"scenario": None, "preset": "default"}


@pytest.fixture
def trainings(short_training):
    """The demonstrations, seed, weighting and learner of each training."""
    recorded = []

    def train_all(sets, seeds, **options):
        trained = training.train_all(sets, seeds, **options)
        weighted = options.get("weighted", [True] * len(sets))
        recorded.extend(zip(sets, seeds, weighted, trained, strict=True))
        return trained

    with short_training(40) as patch:
        patch.setattr(second_learners, "train_all", train_all)
        yield recorded


def row(setup="shared", **changes):
    """A trial, by default of the primary operator in the primary arm."""
    usual = {"disagreement": 500.0, "mean_human_weight": 0.5, "intent_success": True}
    usual |= {"disagreement_rate": 2.5, "human_effort": 80.0, "clearance": 0.1, "unmatched_drives": 0}
    cell = {"preset": "paper", "operator": "primary", "arm": PRIMARY_ARM, "repeat": 0}
    return {**cell, "setup": setup, **usual, **changes}


def made_up(size, **shifts):
    """Rows of all repeats of a size; Setup 2 differs from Setup 1 by the shifts and some noise."""
    rng = np.random.default_rng(0)
    rows = []
    for one in second_learners.plan(None, size):
        given = one.task.arguments
        for operator in given["operators"]:
            for repeat in given["repeats"]:
                for setup, arm in second_learners.conditions_of(given["setups"], given["arms"]):
                    cell = {"preset": given["preset"], "operator": operator, "arm": arm, "repeat": repeat}
                    trial = row(setup, **cell)
                    for name, noise in {"disagreement": 5.0, "human_effort": 0.5, "clearance": 0.002}.items():
                        trial[name] += rng.normal(0.0, noise)
                    for name, shift in shifts.items() if setup == "human" else ():
                        trial[name] += shift
                    rows.append(trial)
    return rows


def claims_of(section, text):
    return [claim for claim in section.claims if claim.text.startswith(text)]


@pytest.mark.parametrize("size", [FULL, sizes.QUICK])
def test_every_repeat_is_run_once(size):
    found = Counter()
    for one in second_learners.plan(None, size):
        given = one.task.arguments
        assert one.seconds > 0
        assert given["trials"] == 10
        for operator in given["operators"]:
            found.update((given["preset"], operator, repeat) for repeat in given["repeats"])
            primary = operator == "primary" and size.of(given["preset"]).all_arms
            assert given["setups"] == (list(SETUPS) if primary else ["shared", "human"])
            assert given["arms"] == (list(ARMS) if primary else [PRIMARY_ARM])
    assert set(found.values()) == {1}
    counts = Counter((preset, operator) for preset, operator, _ in found)
    others = {(preset, name): size.of(preset).other_repeats for preset in PRESETS for name in OPERATORS}
    expected = others | {(preset, "primary"): size.of(preset).repeats for preset in PRESETS}
    assert counts == Counter({key: count for key, count in expected.items() if count})


def test_seeds_are_unique():
    starts = [
        second_learners.seed_of(repeat, purpose) + index
        for repeat in range(FULL.repeats)
        for purpose, count in ((0, 3), (10, 3), (30, 3), (50, second_learners.TRIALS))
        for index in range(count)
    ]
    assert len(set(starts)) == len(starts)


def test_setups_and_arms_of_a_repeat_differ_only_in_what_is_compared(trainings):
    arms = [PRIMARY_ARM, "even, K anew"]
    arguments = {"operators": ["switching"], "repeats": [0], "arms": arms, "setups": SETUPS, "trials": 2}
    rows = second_learners.run_repeats(**HERE, **arguments)
    first, *second = trainings
    # The control has only the primary arm.
    driven = {}
    for one in rows:
        driven.setdefault((one["arm"], one["setup"]), []).append((one["seed"], one["route"]))
    assert set(driven) == {(arm, setup) for arm in arms for setup in SETUPS} - {(arms[1], "more")}
    assert len({tuple(trials) for trials in driven.values()}) == 1
    assert len(set(driven[PRIMARY_ARM, "shared"])) == 2
    assert {seed for _, seed, _, _ in trainings} == {0}
    # Each set starts with the base demonstrations, and added runs have the same scores in all setups.
    for taught, _, _, _ in second:
        assert [item.score for item in taught[:3]] == [item.score for item in first[0]]
    assert len({tuple(item.score for item in taught[3:]) for taught, *_ in second}) == 1
    modes = Counter(taught[3].provenance["mode"] for taught, *_ in second)
    assert modes == {"shared": 2, "human": 3}
    # Both setups have the same noise, and the control another.
    seeds = Counter(tuple(item.provenance["seed"] for item in taught[3:]) for taught, *_ in second)
    assert sorted(seeds.values()) == [1, 4]
    assert Counter(weighted for _, _, weighted, _ in second) == {True: 3, False: 2}


def test_k_is_that_of_the_first_learner_or_its_own(trainings, monkeypatch):
    gains = []

    def run_all(scenario, learners, settings):
        for learner, given in zip(learners, settings, strict=True):
            gains.append((learner.confidence_gain, given.confidence_gain))
        return common.run_all(scenario, learners, settings)

    monkeypatch.setattr(second_learners, "run_all", run_all)
    arms = ["weighted, K kept", "weighted, K anew"]
    arguments = {"operators": ["primary"], "repeats": [1], "arms": arms, "setups": SETUPS[:2], "trials": 1}
    rows = second_learners.run_repeats(**HERE, **arguments)
    first, *second = [learner.confidence_gain for *_, learner in trainings]
    assert sorted(gains[:2]) == sorted((own, first) for own in second)
    assert sorted(gains[2:]) == sorted((own, None) for own in second)
    assert len({first, *second}) == 3
    trainings.clear()
    assert second_learners.run_repeats(**HERE, **arguments) == rows


def test_repeats_in_which_an_operator_fails_are_reported_as_missing(trainings, monkeypatch):
    hopeless = OPERATORS["unskilled"].behaviour
    lost = second_learners.seed_of(4, 0)

    def demonstrate(scenario, teaching):
        driven = common.demonstrate(scenario, teaching)
        return [
            RunError("the simulated operator fails")
            if one.seed == lost or one.behaviour == hopeless
            else found
            for one, found in zip(teaching, driven, strict=True)
        ]

    monkeypatch.setattr(second_learners, "demonstrate", demonstrate)
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
    # One repeat is not enough for a verdict.
    assert {claim.verdict for claim in section.claims} == {"open"}


def test_repeats_with_unmatched_runs_are_reported():
    rows = made_up(QUICK)
    for one in rows:
        one["unmatched_drives"] = int(one["repeat"] in (2, 5) and one["preset"] == "paper")
    assert "In 2 repeats" in second_learners.report(None, QUICK, [rows]).text[-1]


def test_the_unit_is_the_repeat_and_not_the_trial():
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


def test_differences_are_positive_where_setup_1_is_better():
    shifts = {"disagreement": 40.0, "human_effort": -5.0, "clearance": -0.05}
    found = {one.measure: one for one in compare(repeat_means(made_up(QUICK, **shifts)))}
    assert found["disagreement"].estimate.mean == pytest.approx(40.0, abs=5.0)
    assert found["human_effort"].estimate.mean == pytest.approx(-5.0, abs=0.5)
    assert found["clearance"].estimate.mean == pytest.approx(0.05, abs=0.002)
    assert [found[name].verdict for name in ("disagreement", "human_effort", "clearance")] == [
        "holds",
        "reversed",
        "holds",
    ]


@pytest.mark.parametrize(("shift", "verdict"), [(40.0, "holds"), (-40.0, "reversed"), (2.0, "equivalent")])
def test_verdicts_follow_from_the_rows(shift, verdict):
    section = second_learners.report(None, QUICK, [made_up(QUICK, disagreement=shift)])
    claims = claims_of(section, "Disagreement is lower with Setup 1")
    assert [claim.verdict for claim in claims] == [verdict] * 2
    assert all(claim.estimate.count == QUICK.repeats for claim in claims)
    assert sum(f": {verdict}" in paragraph for paragraph in section.text) == 2
    assert any(paragraph.startswith("With 10 repeats") for paragraph in section.text)
    # The human weight never differs; how often it may is bounded.
    assert any("mean human weight" in text and "up to 26% of repeats" in text for text in section.text)
    assert [claim.verdict for claim in claims_of(section, "Mean human weight")] == ["open"] * 2


@pytest.mark.parametrize(
    ("measure", "lost", "verdict"),
    [("mean_human_weight", 0, "holds"), ("mean_human_weight", 12, "open"), ("disagreement", 1, "holds")],
)
def test_a_verdict_stands_only_if_missing_repeats_cannot_change_it(measure, lost, verdict):
    # Where w is lower by 0.2 with Setup 1, missing repeats may be those in which it is higher by 1.
    rows = made_up(dataclasses.replace(QUICK, repeats=40, paper=None), disagreement=40.0)
    rng = np.random.default_rng(1)
    for one in rows:
        one["mean_human_weight"] = 0.5 + 0.2 * (one["setup"] == "human") + rng.normal(0.0, 0.02)
    missing = [{"preset": "paper", "operator": "primary"}] * lost
    found = {(one.cell.preset, one.measure): one for one in compare(repeat_means(rows), missing)}
    assert found["paper", measure].verdict == verdict
    assert found["default", measure].verdict == "holds"
    assert found["paper", "mean_human_weight"].estimate.mean == pytest.approx(0.2, abs=0.02)


def test_a_full_report_contains_all_operators_arms_and_the_control():
    size = dataclasses.replace(FULL, repeats=6, other_repeats=4, paper=None)
    section = second_learners.report(None, size, [made_up(size, disagreement=30.0)])
    # Bars, points of each repeat, and two measures over operators and arms.
    assert len(section.pictures) == 4
    means, primary, rest = (table.rows for table in section.tables)
    cells = 2 * (4 + len(OPERATORS) - 1)
    assert len(means) == 2 * cells + 2
    assert len(primary) == 2 * 2 * len(CRITERIA)
    assert len(rest) == 2 * (cells - 2)
    against = Counter(line[3] for line in primary)
    assert against == dict.fromkeys(["Setup 2", "the control"], 2 * len(CRITERIA))
    assert len(section.claims) == 2 * len(CRITERIA)
    assert len(section.data["second_learners_differences"]) == (cells + 2) * len(CRITERIA)


def test_more_operators_widen_the_adjusted_interval_of_the_primary_one():
    size = dataclasses.replace(FULL, repeats=8, other_repeats=8, paper=None)
    some = ("primary", "noisy", "unskilled")
    rows = [one for one in made_up(size, disagreement=3.0) if one["operator"] in some]
    alone = [one for one in rows if one["operator"] == "primary"]
    (few, many) = (
        next(one for one in compare(repeat_means(chosen)) if one.cell.is_primary) for chosen in (alone, rows)
    )
    assert few.measure == many.measure == "disagreement"
    assert few.plain == many.plain
    assert few.claim.p <= many.claim.p
    assert many.estimate.low < few.estimate.low
