"""A shared run: seeds, the run in the figures, and the claims from rows."""

import dataclasses

import numpy as np
import pytest

from drake_shared.analysis.ambiguity import Ambiguity
from drake_shared.experiments import fig3_fig4_shared_run as shared_run


@pytest.fixture(scope="module")
def results(short_training, run_plan, tiny):
    with short_training():
        yield run_plan(shared_run, tiny)


def test_both_presets_have_the_same_seeds(results):
    rows = [row for result in results for row in result["rows"]]
    seeds = {preset: [r["seed"] for r in rows if r["preset"] == preset] for preset in ("paper", "default")}
    assert seeds["paper"] == seeds["default"] == [1_100_000, 1_100_100]


def test_the_intentions_in_the_figure_belong_to_its_trial(results):
    for result in results:
        columns, moments = result["shown"]["columns"], result["shown"]["moments"]
        for moment in moments:
            assert columns["t"][moment["row"]] == pytest.approx(moment["time"], abs=1e-6)
            assert np.isfinite(moment["mean"]).all()


def test_the_section_has_a_replay_for_each_preset(results, tiny):
    section = shared_run.report(None, tiny, results)
    assert len(section.pictures) == 3
    assert len(section.replays) == 2
    for page in section.replays.values():
        assert page.lstrip().lower().startswith("<!doctype html>")
        assert 1e5 < len(page) < 5e6


def test_clear_steps_are_counted_before_the_last_ambiguous_one():
    part = Ambiguity(
        ambiguous=np.array([True, False, False, True, False]),
        clear=np.array([False, True, True, False, True]),
        human_weight=np.zeros(5),
    )
    assert shared_run.count_clear_before_ambiguous(part) == 2
    none = dataclasses.replace(part, ambiguous=np.zeros(5, dtype=bool))
    assert shared_run.count_clear_before_ambiguous(none) == 0


def test_verdicts_follow_from_the_rows():
    learners = [
        {
            "preset": preset,
            "learner": index,
            "weight_where_ambiguous": 0.9 - 0.002 * index,
            "weight_where_clear": clear + 0.001 * index,
            "area": area - 0.001 * index,
            "clock_area": 0.8,
            "decision_area": area - 0.001 * index,
            "decision_clock_area": 0.8,
        }
        for preset, clear, area in (("paper", 0.88, 0.5), ("default", 0.1, 1.0))
        for index in range(6)
    ]
    verdicts = [claim.verdict for claim in shared_run.claims(learners)]
    assert verdicts == ["equivalent", "holds", *["reversed", "holds"] * 2, "equivalent", "holds"]
