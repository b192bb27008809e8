"""Recorded human input under another arbiter: the same bits under the same one, open loop under others."""

import json
import re

import numpy as np
import pytest

from drake_shared.analysis.counterfactual import MAX_DEVIATION, play_open_loop
from drake_shared.analysis.metrics import metrics
from drake_shared.arbitration.authority import Authority
from drake_shared.cli.main import main
from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings, write_log
from drake_shared.systems.surrogate_operator import Behaviour

SHIPPED = str(models_directory() / "learners" / "two_obstacles_default.safetensors")


@pytest.fixture(scope="module")
def learner(_two_obstacles, route_learner):
    variance = np.linspace(0.2, 0.001, 151)[:, None]
    return route_learner(_two_obstacles, "left_right", variance=variance)


@pytest.fixture(scope="module")
def recorded(_two_obstacles, learner) -> Trial:
    """A trial shared with an agent that expects another route, under the blend."""
    settings = TrialSettings(route="left_left", seed=3, behaviour=Behaviour(noise=0.5))
    return Simulation(_two_obstacles, learner=learner).run(settings)


def test_the_recorded_arbiter_repeats_the_trial_bit_for_bit(recorded, learner):
    played = play_open_loop(recorded, learner=learner)
    assert played.left_at is None
    for name in recorded.columns:
        # The last row of a log is not applied, and its command is not replayed.
        last = None if name in ("t", "x", "y", "yaw", "contact") else -1
        np.testing.assert_array_equal(played.trial[name][:last], recorded[name][:last], err_msg=name)
    assert played.until_left is played.trial
    assert played.metrics()["intent_success"] == metrics(recorded)["intent_success"]


@pytest.mark.parametrize("authority", [Authority(enabled=False), Authority(floor=0.4)])
def test_the_authority_is_the_recorded_one_by_default(scenario, learner, authority):
    simulation = Simulation(scenario, learner=learner, config=SharedControlConfig(authority=authority))
    recorded = simulation.run(TrialSettings(route="left_right"))
    played = play_open_loop(recorded, learner=learner)
    assert played.trial.metadata["arbitration"] == recorded.metadata["arbitration"]
    np.testing.assert_array_equal(played.trial.positions, recorded.positions)
    other = play_open_loop(recorded, config=SharedControlConfig(), learner=learner)
    assert other.trial.metadata["arbitration"] != recorded.metadata["arbitration"]


def test_under_another_arbiter_metrics_end_where_the_recorded_path_is_left(recorded, learner):
    played = play_open_loop(recorded, config=SharedControlConfig(driver="agent"), learner=learner)
    trial, part = played.trial, played.until_left
    assert trial.metadata["open_loop"] is True
    assert trial.metadata["left_recorded_pose_at"] == played.left_at
    assert trial.metadata["recorded"]["arbitration"]["name"] == "blend"
    rows = len(part["t"])
    deviation = np.hypot(*(trial.positions[:rows] - recorded.positions[:rows]).T)
    assert np.all(deviation[:-1] < MAX_DEVIATION)
    assert deviation[-1] >= MAX_DEVIATION
    assert part["t"][-1] == played.left_at < trial["t"][-1]
    measured = played.metrics()
    assert measured["path_length"] == metrics(part)["path_length"] < metrics(trial)["path_length"]
    assert measured["mean_human_weight"] == 0.0
    assert measured["success"] is measured["intent_success"] is measured["completion_time"] is None


def test_starts_where_the_recording_starts(recorded, learner):
    moved = {**recorded.columns, "x": recorded["x"] + 0.4, "yaw": recorded["yaw"] + 0.2}
    played = play_open_loop(
        Trial(columns=moved, metadata=recorded.metadata),
        config=SharedControlConfig(driver="human"),
        learner=learner,
    )
    assert played.trial["x"][0] == pytest.approx(0.4)
    assert played.trial["yaw"][0] == pytest.approx(0.2)


def test_ends_with_the_recording(recorded, learner):
    cut = Trial(columns={k: v[:41] for k, v in recorded.columns.items()}, metadata=recorded.metadata)
    played = play_open_loop(cut, config=SharedControlConfig(arbitration="halves"), learner=learner)
    assert played.trial["t"][-1] == pytest.approx(2.0)
    assert played.trial.status == "record_ended"


@pytest.mark.parametrize(
    ("metadata", "named"),
    [
        ({"scenario": {"name": "x"}}, "the log's scenario"),
        ({"arbitration": {"name": "blend"}}, "arbitration"),
        ({"look_ahead": -1.0}, "look_ahead"),
        ({"look_ahead": "far"}, "look_ahead"),
        ({"confidence_gain": float("nan")}, "confidence_gain"),
    ],
)
def test_invalid_metadata_are_refused(recorded, learner, metadata, named):
    # A log of version 0.1.0 holds the config in parts.
    parts = {name: value for name, value in recorded.metadata.items() if name != "config"}
    broken = Trial(columns=recorded.columns, metadata={**parts, **metadata})
    with pytest.raises(InputError, match=named):
        play_open_loop(broken, learner=learner)


def trial_in(page: str) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="trial">(.*?)</script>', page)[1])


def test_replay_marks_page_and_json_as_open_loop_and_prints_no_figure_of_a_path_that_left_the_recording(
    human_trial, tmp_path, capsys
):
    log, out = tmp_path / "log.parquet", tmp_path / "played.html"
    write_log(human_trial, log)
    arguments = ["replay", str(log), "--arbitration", "agent", "--model", SHIPPED, "--out", str(out)]
    assert main([*arguments, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["open_loop"] is True
    assert result["metrics"]["success"] is None
    page = out.read_text(encoding="utf-8")
    note = re.search(r'<p id="note"[^>]*>(.*?)</p>', page)[1]
    assert "Open loop" in note
    assert f"{result['left_recorded_pose_at']:.2f} s" in note
    assert trial_in(page)["open_loop"] is True
    assert trial_in(page)["left_recorded_pose_at"] == result["left_recorded_pose_at"]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert f"{result['left_recorded_pose_at']:.2f} s" in printed
    assert "path_length" not in printed


def test_a_plain_replay_is_not_marked(human_trial, tmp_path):
    write_log(human_trial, tmp_path / "log.parquet")
    assert main(["replay", str(tmp_path / "log.parquet"), "--out", str(tmp_path / "plain.html")]) == 0
    page = (tmp_path / "plain.html").read_text(encoding="utf-8")
    assert 'id="note"' not in page
    assert "open_loop" not in trial_in(page)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--arbitration", "blend"), "--model"),
        (("--arbitration", "coin", "--model", SHIPPED), "coin"),
    ],
)
def test_replay_that_is_impossible_has_status_2_and_writes_nothing(
    human_trial, tmp_path, capsys, arguments, named
):
    write_log(human_trial, tmp_path / "log.parquet")
    out = tmp_path / "played.html"
    assert main(["replay", str(tmp_path / "log.parquet"), "--out", str(out), *arguments]) == 2
    assert named in capsys.readouterr().err
    assert not out.exists()
