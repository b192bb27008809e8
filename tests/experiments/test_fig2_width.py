"""The weighted path for several widths of the density over the scores."""

import pytest

from drake_shared.experiments import fig2_width
from drake_shared.experiments.common import Teaching, demonstrated
from drake_shared.experiments.training import PRESETS


@pytest.fixture(scope="module")
def results(short_training, run_plan, tiny):
    with short_training(40):
        yield run_plan(fig2_width, tiny, only="paper")


def test_a_narrow_density_leaves_only_the_best_demonstration(results):
    rows = [row for result in results for row in result["rows"]]
    assert len(rows) == 2 * 2 * 2
    for preset in PRESETS:
        probabilities = {row["width"]: row["probability"] for row in rows if row["preset"] == preset}
        assert 0.4 < probabilities["2"] < 0.5
        assert probabilities["0.25"] > 0.999


def test_widths_are_in_deviations_of_the_scores_or_in_m():
    (demonstrations,) = demonstrated(None, [Teaching(seed=fig2_width.SEED)])
    deviations, scaled = fig2_width.scores_and_width(demonstrations, "1 m")
    assert deviations * scaled.scores.std() == pytest.approx(1_000.0)
    assert fig2_width.scores_and_width(demonstrations, "0.5")[0] == 0.5


def test_the_report_names_the_first_width_whose_paths_are_free(results, tiny):
    made = [
        {"rows": [row | {"free": row["width"] == "0.25"} for row in result["rows"]]}
        | {name: result[name] for name in ("paths", "routes")}
        for result in results
    ]
    section = fig2_width.report(None, tiny, made)
    assert "With preset paper the path of every learner is free from a width of 0.25 on" in " ".join(
        section.text
    )
    assert len(section.pictures) == 2
