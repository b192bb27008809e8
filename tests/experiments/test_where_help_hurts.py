import dataclasses

import numpy as np

from drake_shared.experiments import setting, where_help_hurts
from drake_shared.experiments.paired_trials import by_learner, groups, settings, taught
from drake_shared.experiments.section import FULL, QUICK

GRID = {"skills": [0.2, 1.0], "delay": [0.1], "noise": [0.0, 1.2]}


def made_up(learners=6):
    """Rows in which help costs the skilled a third of their successes, and gives it to the others."""
    rng = np.random.default_rng(0)
    rows = []
    for learner in range(learners):
        for name in where_help_hurts.RANGES:
            for skill in GRID["skills"]:
                for value in GRID[name]:
                    base = 0.5 + 0.02 * rng.standard_normal()
                    for arm in ("alone", *where_help_hurts.PRESETS):
                        more = 0.0 if arm == "alone" else (-0.3 if skill == 1.0 else 0.3)
                        more += 0.01 * rng.standard_normal()
                        rows.append(
                            {"map": name, "skill": skill, "value": value, "arm": arm, "learner": learner}
                            | {"seed": learner, "intent_success": base + more, "human_effort": 30.0}
                        )
    return rows


def test_cells_that_hurt_are_found_and_told():
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


def test_alone_and_assisted_have_the_same_routes_and_seeds(monkeypatch):
    brief = {
        name: dataclasses.replace(one, iterations=20, restarts=0) for name, one in setting.STUDIED.items()
    }
    monkeypatch.setattr(setting, "STUDIED", brief)
    rows = where_help_hurts.run_maps(None, [1], 2, GRID)
    meant = {
        arm: [(row["map"], row["route"], row["seed"]) for row in rows if row["arm"] == arm]
        for arm in ("alone", *where_help_hurts.PRESETS)
    }
    assert meant["alone"] == meant["paper"] == meant["default"]
    assert len(meant["alone"]) == 2 * 6
    good = [row for row in rows if row["arm"] == "alone" and row["skill"] == 1.0 and row["value"] < 1.0]
    assert all(row["intent_success"] for row in good)


def test_grids():
    full, quick = (where_help_hurts.tasks(None, size) for size in (FULL, QUICK))
    assert [len(values) for values in full[0].arguments["grid"].values()] == [5, 5, 5]
    assert [len(values) for values in quick[0].arguments["grid"].values()] == [3, 3, 3]
    assert [len(task.arguments["learners"]) for task in (*full, *quick)] == [4, 4, 2]


def test_fewer_demonstrations_are_the_first_of_more():
    few, more = taught(None, 3, count=3), taught(None, 3, count=4)
    assert all(
        (one.positions == other.positions).all() for one, other in zip(list(few), list(more)[:3], strict=True)
    )


def test_no_two_trials_share_a_seed():
    seeds = [
        settings(None, "primary", learner, trial)["seed"] for learner in range(20) for trial in range(10)
    ]
    assert len(set(seeds)) == len(seeds)
    assert "then" in settings(None, "switching", 0, 0)


def test_means_by_learner():
    rows = [{"learner": 1, "x": True}, {"learner": 0, "x": None}, {"learner": 1, "x": False}]
    np.testing.assert_array_equal(by_learner(rows, "x"), [np.nan, 0.5])
    assert groups(5, 2) == [[0, 1], [2, 3], [4]]
