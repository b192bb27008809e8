"""Sensitivity to K and to the number of demonstrations."""

import re

import pytest

from drake_shared.experiments import sensitivity
from drake_shared.experiments.measures import by_learner
from drake_shared.experiments.training import PRESETS


@pytest.fixture(scope="module")
def results(short_training, run_plan, tiny):
    """Of learners with three multiples of K and two numbers of demonstrations."""
    with short_training() as patch:
        patch.setattr(sensitivity, "FACTORS", (0.1, 1.0, 10.0))
        patch.setattr(sensitivity, "COUNTS", (3, 4))
        yield run_plan(sensitivity, tiny, only="paper")


def test_only_k_or_the_demonstrations_differ_along_a_curve(results):
    rows = [row for result in results for row in result]
    assert len(rows) == 2 * 2 * 2 * (3 + 1)
    for preset in PRESETS:
        for learner in (0, 1):
            own = [row for row in rows if row["preset"] == preset and row["learner"] == learner]
            assert len({(row["route"], row["seed"]) for row in own}) == 1
            gains = {row["factor"]: row["confidence_gain"] for row in own if row["demonstrations"] == 3}
            assert gains[0.1] == pytest.approx(0.01 * gains[10.0])


def test_a_larger_k_gives_the_human_more_weight(results):
    rows = [row for result in results for row in result]
    low, high = (
        by_learner(rows, "mean_human_weight", preset="paper", demonstrations=3, factor=factor)
        for factor in (0.1, 10.0)
    )
    assert (high > low).all()


def test_the_report_shows_the_rows(results, tiny):
    section = sensitivity.report(None, tiny, results)
    assert len(section.pictures) == len(section.tables) == 2
    assert [len(table.rows) for table in section.tables] == [4 * 3, 4 * 2]
    rows = [dict(row) for result in results for row in result]
    for row in rows:
        row["intent_success"] = row["factor"] <= 1.0
    text = " ".join(sensitivity.report(None, tiny, [rows]).text)
    # Of two learners all of whose trials change, no interval is narrower than this.
    assert re.search("−100 points .* for unskilled", text)
