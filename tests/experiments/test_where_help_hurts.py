"""Where assistance hurts, and the seeds of paired trials."""

import numpy as np

from drake_shared.experiments import where_help_hurts
from drake_shared.experiments.measures import by_learner
from drake_shared.experiments.paired_trials import demonstrations_of, groups, settings_of
from drake_shared.experiments.section import FULL, QUICK
from drake_shared.experiments.training import PRESETS

GRID = {"skills": [0.2, 1.0], "delay": [0.1], "noise": [0.0, 1.2]}


def made_up(learners=6):
    """Rows in which assistance lowers the success of skilled operators by 0.3, and raises that of others."""
    rng = np.random.default_rng(0)
    rows = []
    for learner in range(learners):
        for name in where_help_hurts.RANGES:
            for skill in GRID["skills"]:
                for value in GRID[name]:
                    base = 0.5 + 0.02 * rng.standard_normal()
                    for arm in ("alone", *PRESETS):
                        more = 0.0 if arm == "alone" else (-0.3 if skill == 1.0 else 0.3)
                        more += 0.01 * rng.standard_normal()
                        rows.append(
                            {"map": name, "skill": skill, "value": value, "arm": arm, "learner": learner}
                            | {"seed": learner, "intent_success": base + more, "human_effort": 30.0}
                        )
    return rows


def test_cells_in_which_assistance_hurts_are_listed():
    cells = where_help_hurts.differences(made_up())
    assert len(cells) == 2 * 2 * (2 * 1 + 2 * 2)
    success = [cell for cell in cells if cell["measure"] == "intent_success"]
    for cell in success:
        assert where_help_hurts.hurts(cell) == (cell["skill"] == 1.0)
        assert where_help_hurts.helps(cell) == (cell["skill"] == 0.2)
    effort = [cell for cell in cells if cell["measure"] == "human_effort"]
    assert not any(where_help_hurts.hurts(cell) or where_help_hurts.helps(cell) for cell in effort)
    text = " ".join(where_help_hurts.report(None, QUICK, [made_up()]).text)
    assert "helps in 3 of 6 cells and hurts in 3: skill 1 with delay 0.1 s" in text
    assert "helps in 0 of 6 cells and hurts in none" in text


def test_more_effort_hurts():
    cell = {"measure": "human_effort", "low": 1.0, "high": 2.0}
    assert where_help_hurts.hurts(cell)
    assert not where_help_hurts.helps(cell)
    assert where_help_hurts.helps({**cell, "low": -2.0, "high": -1.0})


def test_alone_and_assisted_have_the_same_routes_and_seeds(short_training):
    with short_training():
        rows = where_help_hurts.run_maps(None, [1], 2, GRID)
    trials = {
        arm: [(row["map"], row["route"], row["seed"]) for row in rows if row["arm"] == arm]
        for arm in ("alone", *PRESETS)
    }
    assert trials["alone"] == trials["paper"] == trials["default"]
    assert len(trials["alone"]) == 2 * 6
    good = [row for row in rows if row["arm"] == "alone" and row["skill"] == 1.0 and row["value"] < 1.0]
    assert all(row["intent_success"] for row in good)


def test_a_quick_run_has_a_coarser_grid():
    full, quick = ([one.task for one in where_help_hurts.plan(None, size)] for size in (FULL, QUICK))
    assert [len(values) for values in full[0].arguments["grid"].values()] == [5, 5, 5]
    assert [len(values) for values in quick[0].arguments["grid"].values()] == [3, 3, 3]
    assert [len(task.arguments["learners"]) for task in (*full, *quick)] == [5, 5, 2]


def test_a_smaller_set_of_demonstrations_is_the_start_of_a_larger_one():
    ((few,), (more,)) = (demonstrations_of(None, [3], count=count) for count in (3, 4))
    assert all(
        (one.positions == other.positions).all() for one, other in zip(list(few), list(more)[:3], strict=True)
    )


def test_seeds_of_trials_are_unique():
    seeds = [
        settings_of(None, "primary", learner, trial).seed for learner in range(20) for trial in range(10)
    ]
    assert len(set(seeds)) == len(seeds)
    assert settings_of(None, "switching", 0, 0).then is not None


def test_means_by_learner():
    rows = [{"learner": 1, "x": True}, {"learner": 0, "x": None}, {"learner": 1, "x": False}]
    np.testing.assert_array_equal(by_learner(rows, "x"), [np.nan, 0.5])
    assert groups(5, 2) == [[0, 1], [2, 3], [4]]
