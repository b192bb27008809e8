"""Plain and weighted learners: the observed points, and the claims from rows."""

import dataclasses
import itertools

import numpy as np
import pytest

from drake_shared.experiments import fig2_weighting as weighting
from drake_shared.experiments.section import QUICK

SIZE = dataclasses.replace(QUICK, learners=3, paper=None)


def row(preset, seed, condition, model, **measures):
    values = {"to_best": 0.4, "to_average": 0.1, "missed": 0.0, "plain_to_weighted": 0.1, "ignores": False}
    common = condition == "the start"
    values |= {"preset": preset, "learner": seed, "condition": condition, "common": common, "model": model}
    values["missed"] += 0.001 * seed
    return values | {"to_route": None if common else 0.02 + 0.001 * seed} | measures


def made_up(**changed):
    """Rows of six seeds, with the weighted path closer to the best by 0.1 m; the last row is changed."""
    rows = [
        row(preset, seed, condition, model, to_best=0.4 if model == "plain" else 0.3 + 0.001 * seed)
        for preset, seed, condition, model in itertools.product(
            ("paper", "default"), range(6), ("the start", "a point"), ("plain", "weighted")
        )
    ]
    rows[-1] |= changed
    return rows


def test_points_are_the_start_and_where_two_demonstrations_are_farthest_from_the_others():
    t = np.linspace(0.0, 1.0, 11)
    ways = np.stack([np.stack([t, height * np.sin(np.pi * t)], axis=1) for height in (1.0, 0.9, -1.0)])
    start, one, other = weighting.conditions(ways)
    assert (start.step, start.route) == (0, None)
    # The first two are close to each other everywhere, so only one of them is chosen beside the third.
    assert {one.route, other.route} == {0, 2}
    assert other.step == 5


def test_every_pair_of_each_preset_is_trained_once():
    seeds = {preset: [] for preset in ("paper", "default")}
    for one in weighting.plan(None, SIZE):
        seeds[one.task.arguments["preset"]] += one.task.arguments["learners"]
        assert one.seconds > 0
    assert seeds == {"paper": [0, 1, 2], "default": [0, 1, 2]}


@pytest.mark.parametrize(("missed", "verdict"), [(0.0, "holds"), (0.3, "open")])
def test_a_path_that_misses_a_point_counts_against_the_claim(missed, verdict):
    claims = weighting.claims(made_up(missed=missed))
    assert [claim.verdict for claim in claims[:3]] == ["holds"] * 3
    assert claims[3].verdict == verdict
    assert claims[3].estimate.mean == pytest.approx(0.05 - missed / 6 - 0.0025, abs=0.002)


def test_a_repeated_task_gives_the_same_rows_and_the_report_shows_them(short_training, run_plan, tiny):
    with short_training():
        results = run_plan(weighting, tiny)
        assert weighting.plan(None, tiny)[0].task.run() == results[0]
    # Two presets, seeds, models and three points.
    assert sum(len(result["rows"]) for result in results) == 2 * 2 * 2 * 3
    section = weighting.report(None, tiny, results)
    assert section.pictures[0].svg.startswith("<svg")
    assert len(section.claims) == 6
    assert len(section.tables[0].rows) == 2 * 2 * 2
