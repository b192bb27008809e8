"""The feedback loop over generations: its data, its rows and its claims."""

import numpy as np
import pytest

from drake_shared.common.errors import RunError
from drake_shared.experiments import common, generations
from drake_shared.experiments.training import PRESETS


@pytest.fixture(scope="module")
def brief(short_training):
    """One generation, and an operator who succeeds in spite of the learners."""
    with short_training() as patch:
        patch.setattr(generations, "OPERATOR", "primary")
        patch.setattr(generations, "QUICK_GENERATIONS", 1)
        yield


@pytest.fixture(scope="module")
def results(brief, run_plan, tiny):
    return run_plan(generations, tiny, only="paper")


def made_up(*, loss=0.0, error=0.0, gap=0.0):
    """Rows of eight repeats in which the shared arm is worse than the frozen one by these amounts."""
    return [
        {
            "preset": preset,
            "repeat": repeat,
            "arm": arm,
            "generation": generation,
            "intent_success": 0.8 - (loss + 0.002 * repeat) * (arm == "shared") * generation,
            "human_effort": 50.0,
            "disagreement": 500.0 + (repeat + gap) * (arm == "shared") * generation,
            "mean_human_weight": 0.5,
            "expected_calibration_error": 0.1 + (error + 0.0003 * repeat) * (arm == "shared") * generation,
            "confident_and_wrong": 0.0,
            "stalled": False,
            "autonomy_share": 0.25 if arm == "shared" else 0.0,
        }
        for preset in PRESETS
        for repeat in range(8)
        for arm in generations.ARMS
        for generation in (0, 1)
    ]


def test_each_generation_adds_three_runs_to_the_fed_arms_and_none_to_the_frozen_one(results):
    rows = [row for result in results for row in result]
    assert len(rows) == 2 * 2 * 3 * 2
    for row in rows:
        fed = row["arm"] != "frozen"
        assert row["demonstrations"] == 3 + 3 * row["generation"] * fed


def test_autonomy_has_a_share_in_shared_runs_only(results):
    for row in (row for result in results for row in result):
        if row["arm"] == "shared" and row["generation"]:
            # The base demonstrations are by the human alone.
            assert 0.0 < row["autonomy_share"] < 1.0 - 1.0 / (1 + row["generation"])
        else:
            assert row["autonomy_share"] == 0.0


def test_all_arms_start_with_the_frozen_learner(results):
    rows = [row for result in results for row in result]
    for preset in PRESETS:
        for repeat in (0, 1):
            own = [row for row in rows if (row["preset"], row["repeat"]) == (preset, repeat)]
            same = [row for row in own if row["arm"] == "frozen" or row["generation"] == 0]
            values = {(row["disagreement"], row["confidence_gain"], row["human_effort"]) for row in same}
            assert len(values) == 1
            grown = [row for row in own if row not in same]
            assert len(grown) == len({row["confidence_gain"] for row in grown} - {same[0]["confidence_gain"]})


def test_the_same_task_gives_the_same_rows(brief, results):
    found = generations.run_repeats(None, "paper", [0, 1], 0, 1)
    assert found == [row for row in results[0] if row["generation"] == 0]


def test_a_repeat_in_which_the_operator_fails_is_stalled_and_counts(brief, monkeypatch, tiny):
    def demonstrate(scenario, teaching):
        driven = common.demonstrate(scenario, teaching)
        return [
            RunError("stuck") if one.learner is not None else found
            for one, found in zip(teaching, driven, strict=True)
        ]

    monkeypatch.setattr(generations, "demonstrate", demonstrate)
    rows = generations.run_repeats(None, "paper", [0], 1, 1)
    assert [row["stalled"] for row in rows] == [False] * 3 + [row["arm"] == "shared" for row in rows[3:]]
    last = {row["arm"]: row for row in rows[3:]}
    assert last["shared"] == last["frozen"] | {"arm": "shared", "stalled": True}
    assert last["human"]["demonstrations"] == 6
    made = [row for row in made_up() if row["preset"] == "default"]
    text = " ".join(generations.report(None, tiny, [made, rows]).text)
    assert "with preset default autonomy made 25% of the shared arm's data" in text
    assert ": 1 with preset paper, arm shared (" in text


def test_the_report_shows_the_rows(results, tiny):
    section = generations.report(None, tiny, results)
    assert len(section.pictures) == 2
    assert [len(table.rows) for table in section.tables] == [2 * 3, 2 * 3]
    assert [claim.estimate.count for claim in section.claims] == [2] * 6


@pytest.mark.parametrize(
    ("cost", "verdicts"),
    [
        ({}, ["holds", "equivalent", "holds"]),
        ({"loss": 0.1, "error": 0.05, "gap": 50.0}, ["reversed"] * 3),
        ({"loss": -0.1, "error": -0.05, "gap": -50.0}, ["holds"] * 3),
    ],
)
def test_verdicts_follow_from_the_rows(cost, verdicts):
    claims = generations.claims(made_up(**cost), 1)
    assert [claim.verdict for claim in claims] == list(np.repeat(verdicts, 2))
