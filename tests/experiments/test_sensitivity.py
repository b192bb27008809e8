import dataclasses

import pytest

from drake_shared.experiments import sensitivity, setting
from drake_shared.experiments.paired_trials import by_learner
from drake_shared.experiments.section import Size

TINY = Size(name="quick", repeats=1, other_repeats=0, all_arms=False, learners=2, trials=1)


@pytest.fixture(scope="module")
def results():
    """Of barely trained learners, at two K and with two numbers of demonstrations."""
    brief = {
        name: dataclasses.replace(one, iterations=20, restarts=0) for name, one in setting.STUDIED.items()
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(setting, "STUDIED", brief)
        patch.setattr(sensitivity, "FACTORS", (0.1, 1.0, 10.0))
        patch.setattr(sensitivity, "COUNTS", (3, 4))
        yield [task.run() for task in sensitivity.tasks(None, TINY)]


def test_along_a_curve_only_k_or_the_demonstrations_differ(results):
    rows = [row for result in results for row in result]
    assert len(rows) == 2 * 2 * 2 * (3 + 1)
    for preset in sensitivity.PRESETS:
        for learner in (0, 1):
            own = [row for row in rows if row["preset"] == preset and row["learner"] == learner]
            assert len({(row["route"], row["seed"]) for row in own}) == 1
            gains = {row["factor"]: row["confidence_gain"] for row in own if row["demonstrations"] == 3}
            assert gains[0.1] == pytest.approx(0.01 * gains[10.0])


def test_more_k_leaves_more_to_the_human(results):
    rows = [row for result in results for row in result]
    low, high = (
        by_learner(rows, "mean_human_weight", preset="paper", demonstrations=3, factor=factor)
        for factor in (0.1, 10.0)
    )
    assert (high > low).all()


def test_the_report_follows_the_rows(results):
    section = sensitivity.report(None, TINY, results)
    assert len(section.pictures) == len(section.tables) == 2
    assert [len(table.rows) for table in section.tables] == [4 * 3, 4 * 2]
    rows = [dict(row) for result in results for row in result]
    for row in rows:
        row["intent_success"] = row["factor"] <= 1.0
    told = " ".join(sensitivity.report(None, TINY, [rows]).text)
    assert "−100 points [−100, −100] for unskilled" in told
