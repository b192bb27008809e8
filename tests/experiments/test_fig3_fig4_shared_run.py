"""A shared run: seeds, the run that is shown, and what follows from the rows."""

import dataclasses

import numpy as np
import pytest

from drake_shared.analysis.ambiguity import Ambiguity
from drake_shared.experiments import setting, shared_run
from drake_shared.experiments.section import QUICK

SIZE = dataclasses.replace(QUICK, learners=2, trials=1)


@pytest.fixture(scope="module")
def results():
    short = {name: dataclasses.replace(setting.STUDIED[name], iterations=20) for name in setting.STUDIED}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(setting, "STUDIED", short)
        yield [task.run() for task in shared_run.tasks(None, SIZE)]


def test_every_learner_has_its_trials_and_both_presets_the_same_seeds(results):
    rows = [row for result in results for row in result["rows"]]
    seeds = {preset: [r["seed"] for r in rows if r["preset"] == preset] for preset in ("paper", "default")}
    assert seeds["paper"] == seeds["default"] == [1_100_000, 1_100_100]


def test_the_intentions_shown_are_of_the_trial_shown(results):
    for result in results:
        columns, moments = result["shown"]["columns"], result["shown"]["moments"]
        for moment in moments:
            assert columns["t"][moment["row"]] == pytest.approx(moment["time"], abs=1e-6)
            assert np.isfinite(moment["mean"]).all()


def test_the_section_has_a_page_for_either_preset(results):
    section = shared_run.report(None, SIZE, results)
    assert len(section.pictures) == 3
    assert len(section.replays) == 2
    for page in section.replays.values():
        assert page.lstrip().lower().startswith("<!doctype html>")
        assert 1e5 < len(page) < 5e6


def test_clear_steps_count_only_before_an_ambiguous_one():
    part = Ambiguity(
        ambiguous=np.array([True, False, False, True, False]),
        clear=np.array([False, True, True, False, True]),
        human_weight=np.zeros(5),
    )
    assert shared_run._clear_before(part) == 2
    none = dataclasses.replace(part, ambiguous=np.zeros(5, dtype=bool))
    assert shared_run._clear_before(none) == 0


def test_verdicts_follow_from_the_learners():
    learners = [
        {
            "preset": preset,
            "learner": index,
            "weight_where_ambiguous": 0.9,
            "weight_where_clear": clear + 0.001 * index,
            "area": area,
            "clock_area": 0.8,
        }
        for preset, clear, area in (("paper", 0.88, 0.5), ("default", 0.1, 1.0))
        for index in range(6)
    ]
    verdicts = [claim.verdict for claim in shared_run._claims(learners)]
    assert verdicts == ["equivalent", "holds", "reversed", "holds", "equivalent", "holds"]
