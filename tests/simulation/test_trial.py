"""One run: how it ends, that it repeats to the bit, what its log says, and its file."""

import json
import math
import os

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pydrake.systems.framework import DiscreteStateIndex, LeafSystem

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations, write_demonstrations
from drake_shared.simulation.config import SharedControlConfig, config_for
from drake_shared.simulation.trial import (
    RunningTrial,
    Simulation,
    Trial,
    TrialSettings,
    read_log,
    run_trial,
    write_log,
)
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.surrogate_operator import Behaviour


class StraightOn(LeafSystem):
    """Drives straight on, and samples its input faster than the loop, as a mouse does."""

    def __init__(self):
        super().__init__()
        self.DeclareDiscreteState([8.0, 8.0])
        self.DeclareStateOutputPort("human_command", DiscreteStateIndex(0))
        self.DeclarePeriodicDiscreteUpdateEvent(0.005, 0.0, lambda context, state: None)


def assert_same_bits(one: Trial, other: Trial) -> None:
    assert list(one.columns) == list(other.columns)
    for name in one.columns:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


@pytest.fixture(scope="module")
def simulation(_two_obstacles, route_learner) -> Simulation:
    variance = np.linspace(0.2, 0.001, 151)[:, None]
    return Simulation(_two_obstacles, learner=route_learner(_two_obstacles, variance=variance))


def test_same_seed_same_log_bit_for_bit(simulation, scenario):
    settings = TrialSettings(seed=11, route="left_right")
    first = simulation.run(settings)
    # Whatever ran in between, and in a diagram of its own.
    simulation.run(TrialSettings(seed=12, route="left_left", driver="human", confidence_gain=3.0))
    again = simulation.run(settings)
    elsewhere = Simulation(scenario, learner=simulation.learner).run(settings)
    assert_same_bits(first, again)
    assert_same_bits(first, elsewhere)
    assert first.metadata == again.metadata == elsewhere.metadata


def test_another_seed_is_another_log(simulation):
    one, other = (simulation.run(TrialSettings(seed=seed, route="left_right")) for seed in (1, 2))
    assert not np.array_equal(one["human_left"][:50], other["human_left"][:50])


def test_in_small_pieces_a_trial_runs_as_in_one(simulation):
    settings = TrialSettings(seed=3, route="left_right")
    running = simulation.begin(settings)
    pieces = 0
    while running.status is None:
        running.advance(running.time + 0.017)
        pieces += 1
    assert pieces > 500
    assert_same_bits(running.finish(), simulation.run(settings))


def test_ends_as_soon_as_the_goal_is_reached(human_trial, scenario):
    away = np.hypot(*(human_trial.positions - (5.0, 0.0)).T)
    assert human_trial.status == "reached"
    assert away[-1] <= scenario.goal.radius
    assert np.all(away[:-1] > scenario.goal.radius)


def test_or_goes_on_until_the_time_is_over(scenario):
    simulation = Simulation(scenario, config=SharedControlConfig(end="duration"))
    trial = simulation.run(TrialSettings(route="left_right"))
    assert len(trial["t"]) == 301
    assert trial["t"][-1] == pytest.approx(15.0)
    assert trial.status == "reached"


def test_times_out_where_the_goal_is_not_reached(scenario):
    trial = Simulation(scenario, operator=RecordedInput()).run(TrialSettings(driver="human"))
    assert trial.status == "timed_out"
    assert len(trial["t"]) == 301
    np.testing.assert_array_equal(trial.positions, 0.0)


def test_the_last_row_shows_the_robot_at_the_goal_whatever_the_operators_period(open_floor):
    trial = Simulation(open_floor, operator=StraightOn()).run(TrialSettings(driver="human"))
    assert trial.status == "reached"
    assert abs(trial["x"][-1] - 4.0) <= 0.2 < abs(trial["x"][-2] - 4.0)
    np.testing.assert_allclose(trial["t"], 0.05 * np.arange(len(trial["t"])), atol=1e-12)


def test_a_trial_broken_off_keeps_what_happened_and_says_why(simulation):
    running = simulation.begin(TrialSettings(route="left_right"))
    assert running.status is None
    running.advance(1.0)
    assert running.time == 1.0
    trial = running.finish("stopped by the driver", operator_name="ann")
    assert trial.status == "stopped by the driver"
    assert trial.metadata["operator_name"] == "ann"
    assert trial["t"][-1] == pytest.approx(1.0)
    assert isinstance(running, RunningTrial)
    assert running.finish().status == "stopped"


def test_a_trial_that_is_over_does_not_run_on(simulation):
    running = simulation.begin(TrialSettings(driver="human", route="left_right"))
    running.advance(99.0)
    time = running.time
    running.advance(99.0)
    assert running.status == "reached"
    assert running.time == time


@pytest.mark.parametrize("route", ["left_right", "right_left", "left_left"])
def test_the_route_is_the_one_that_the_operator_drives(simulation, scenario, route):
    trial = simulation.run(TrialSettings(driver="human", route=route))
    path = scenario.route(route).path(scenario.start)
    way = path.position(np.linspace(0, path.length, 1000))
    assert np.linalg.norm(trial.positions[:, None] - way, axis=2).min(axis=1).max() < 0.15


def test_mode_agent_drives_by_the_agents_command_alone(simulation):
    trial = simulation.run(TrialSettings(driver="agent", route="right_left"))
    np.testing.assert_array_equal(trial["human_weight"], 0.0)
    np.testing.assert_array_equal(trial.commands("shared"), trial.commands("autonomous"))
    assert trial.status == "reached"


def test_the_agent_alone_does_not_depend_on_the_operator(simulation):
    one, other = (simulation.run(TrialSettings(driver="agent", route=r)) for r in ("right_left", "left_left"))
    np.testing.assert_array_equal(one.positions, other.positions)


def test_k_is_a_setting(simulation):
    simulation = Simulation(simulation.scenario, learner=simulation.learner, config=config_for("paper"))
    usual, sure = (simulation.run(TrialSettings(confidence_gain=k)) for k in (None, 1e-3))
    np.testing.assert_array_equal(sure["human_weight"], 0.0)
    assert usual["human_weight"].max() > 0.5
    assert usual.metadata["confidence_gain"] == simulation.learner.confidence_gain
    assert sure.metadata["confidence_gain"] == 1e-3


def test_behaviour_is_a_setting(simulation):
    trial = simulation.run(TrialSettings(behaviour=Behaviour(late_start=2.0)))
    assert np.flatnonzero(trial["human_left"])[0] == 41
    assert trial.metadata["behaviour"]["late_start"] == 2.0


def test_a_driver_who_gives_no_command_counts_as_at_the_controls_for_the_first_second(
    scenario, route_learner
):
    learner = route_learner(scenario, variance=1e-6)
    simulation = Simulation(scenario, learner=learner, operator=RecordedInput())
    running = simulation.begin(TrialSettings())
    reasons = []
    for time in (0.0, 0.9, 1.1):
        running.advance(time)
        reasons.append(simulation.parts.release_reason(running.root))
    assert reasons == [None, None, "hands_off"]


def test_predictions_of_nan_leave_the_human_to_drive_alone(scenario, route_learner):
    silent = route_learner(scenario, variance=math.nan)
    silent.demonstrations = np.full_like(silent.demonstrations, math.nan)
    simulation = Simulation(scenario, learner=route_learner(scenario))
    trial = simulation.run(TrialSettings(seed=5, route="left_right"), learner=silent)
    alone = Simulation(scenario).run(TrialSettings(seed=5, route="left_right", driver="human"))
    np.testing.assert_array_equal(trial.positions, alone.positions)
    np.testing.assert_array_equal(trial["human_weight"], 1.0)
    assert np.isnan(trial["confidence"]).all()
    assert np.isnan(trial["autonomous_left"]).all()
    assert np.isfinite(trial.commands("shared")).all()


def test_predictions_of_nan_on_the_way_hand_over_to_the_human(scenario, route_learner):
    learner = route_learner(scenario, "left_right", variance=1e-4)
    simulation = Simulation(scenario, learner=learner, config=config_for("paper", end="duration"))
    learner.demonstrations[0, 75:] = math.nan
    trial = simulation.run(TrialSettings(route="left_right"))
    assert trial["human_weight"][0] == 0.0
    assert trial["human_weight"][-1] == 1.0
    assert trial.status == "reached"


def test_a_recorded_human_drives_the_same_way_bit_for_bit(human_trial, scenario):
    recorded = Simulation(scenario, operator=RecordedInput(period=0.05)).run(
        TrialSettings(driver="human", recording=human_trial.commands("human")[:-1])
    )
    for name in ("x", "y", "yaw", "wheel_left", "wheel_right", "clearance"):
        np.testing.assert_array_equal(recorded[name], human_trial[name])
    np.testing.assert_array_equal(recorded.commands("human")[:-1], human_trial.commands("human")[:-1])


def test_the_metadata_says_all_that_matters_and_is_json(simulation, scenario):
    trial = simulation.run(TrialSettings(seed=4, route="left_left", driver="human"))
    told = json.loads(json.dumps(trial.metadata))
    assert told["scenario"]["name"] == "two_obstacles"
    assert told["scenario"]["obstacles"][0] == {
        "name": "first",
        "x": 1.4,
        "y": 0.0,
        "radius": 0.25,
        "z": 0.0,
        "height": 0.0,
        "path": [],
        "mapped": True,
    }
    assert (told["learner"], told["preset"], told["learner_id"]) == ("fake", "test", "fake")
    assert (told["operator"], told["mode"], told["route"]) == ("SurrogateOperator", "human", "left_left")
    assert (told["seed"], told["end"], told["look_ahead"]) == (4, "reached", 0.6)
    assert told["behaviour"]["delay"] == 0.2
    assert told["software"]["drake"].startswith("1.")


def test_the_metadata_name_a_recording_by_its_content_where_it_is_played(simulation, scenario):
    played = Simulation(scenario, operator=RecordedInput())
    rows = np.array([[1.0, 2.0], [3.0, 4.0]])

    def name(simulation, recording):
        return simulation.describe(TrialSettings(recording=recording)).get("recording")

    assert name(played, rows) == name(played, np.asfortranarray(rows)) != name(played, rows.T)
    assert name(played, None) is name(simulation, rows) is None


def test_run_trial_is_the_short_way(human_trial, scenario):
    assert_same_bits(run_trial(scenario, driver="human", route="left_right", seed=5), human_trial)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"route": "up"}, "has no route 'up'"),
        ({"then": "down"}, "has no route 'down'"),
        ({"driver": "both"}, "driver"),
        ({"confidence_gain": 0.0}, "confidence_gain must be positive and finite"),
        ({"confidence_gain": math.nan}, "confidence_gain must be positive and finite"),
    ],
)
def test_settings_that_mean_nothing_are_refused(simulation, settings, said):
    with pytest.raises(InputError, match=said):
        simulation.run(TrialSettings(**settings))


def test_a_log_comes_back_as_it_was_written(simulation, tmp_path):
    for trial in (simulation.run(TrialSettings(route="left_left")), run_trial(simulation.scenario)):
        write_log(trial, tmp_path / "logs" / "trial.parquet")
        back = read_log(tmp_path / "logs" / "trial.parquet")
        assert_same_bits(back, trial)
        assert all(back[name].dtype == trial[name].dtype for name in trial.columns)
        assert back.metadata == json.loads(json.dumps(trial.metadata))
        assert back.status == trial.status


@pytest.mark.parametrize("durable", [False, True])
def test_writing_a_log_waits_for_the_disk_only_where_that_is_asked(
    human_trial, tmp_path, monkeypatch, durable
):
    waits = []
    monkeypatch.setattr(os, "fsync", waits.append)
    write_log(human_trial, tmp_path / "trial.parquet", **({"durable": True} if durable else {}))
    assert bool(waits) == durable


def test_a_log_is_parquet_with_its_metadata_as_json_under_our_key(human_trial, tmp_path):
    write_log(human_trial, tmp_path / "trial.parquet")
    schema = pq.read_schema(tmp_path / "trial.parquet")
    assert json.loads(schema.metadata[b"drake_shared"])["format"] == "drake_shared.log"
    assert schema.field("contact").type == pa.bool_()
    assert schema.field("t").type == pa.float64()


def rewritten(trial: Trial, path, *, without=(), **metadata):
    columns = {name: values for name, values in trial.columns.items() if name not in without}
    write_log(Trial(columns=columns, metadata=dict(trial.metadata) | metadata), path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "drake_shared.demonstrations"}, "format must be 'drake_shared.log'"),
        ({"version": 99}, "version must be .*, got 99"),
        ({"without": ("wheel_left", "clearance")}, "columns must include wheel_left, clearance"),
        ({"without": ("t",)}, "columns must include t"),
        ({"scenario": None}, "scenario must be an object with name, goal"),
        ({"scenario": {"name": "x"}}, "scenario must be an object with name, goal"),
        ({"status": None}, "status must be given"),
        ({"route": "up"}, "route must be one of left_right, right_left, left_left, got 'up'"),
        ({"then": "up"}, "then must be one of left_right, right_left, left_left, got 'up'"),
    ],
)
def test_a_log_that_is_not_what_it_must_be_is_refused(human_trial, tmp_path, change, said):
    rewritten(human_trial, tmp_path / "trial.parquet", **change)
    with pytest.raises(InputError, match=said) as caught:
        read_log(tmp_path / "trial.parquet")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "trial.parquet"))


def test_a_log_with_words_for_numbers_is_refused(human_trial, tmp_path):
    words = np.array(["x"] * len(human_trial["t"]))
    write_log(
        Trial(columns=human_trial.columns | {"yaw": words}, metadata=human_trial.metadata), tmp_path / "t"
    )
    with pytest.raises(InputError, match="yaw must hold numbers"):
        read_log(tmp_path / "t")


def test_a_log_without_rows_is_refused(human_trial, tmp_path):
    columns = {name: values[:0] for name, values in human_trial.columns.items()}
    write_log(Trial(columns=columns, metadata=human_trial.metadata), tmp_path / "t")
    with pytest.raises(InputError, match="must hold at least one row"):
        read_log(tmp_path / "t")


def test_a_log_whose_time_does_not_increase_is_refused(human_trial, tmp_path):
    times = human_trial["t"].copy()
    times[3] = math.nan
    write_log(
        Trial(columns=human_trial.columns | {"t": times}, metadata=human_trial.metadata), tmp_path / "t"
    )
    with pytest.raises(InputError, match="t must increase"):
        read_log(tmp_path / "t")


def test_a_log_cut_short_is_refused(human_trial, tmp_path):
    write_log(human_trial, tmp_path / "whole")
    (tmp_path / "half").write_bytes((tmp_path / "whole").read_bytes()[:3000])
    with pytest.raises(InputError, match="half cannot be read as a log"):
        read_log(tmp_path / "half")


def test_what_is_no_log_is_refused(tmp_path):
    with pytest.raises(InputError, match="none must be a log; there is no such file"):
        read_log(tmp_path / "none")
    with pytest.raises(InputError, match="must be a log; there is no such file"):
        read_log(tmp_path)
    (tmp_path / "text").write_text("t,x,y\n0,0,0\n")
    with pytest.raises(InputError, match="text cannot be read as a log"):
        read_log(tmp_path / "text")
    pq.write_table(pa.table({"t": [0.0]}), tmp_path / "plain")
    with pytest.raises(InputError, match="plain: format must be"):
        read_log(tmp_path / "plain")
    table = pa.table({"t": [0.0]}).replace_schema_metadata({"drake_shared": "{"})
    pq.write_table(table, tmp_path / "broken")
    with pytest.raises(InputError, match="broken: metadata must be JSON"):
        read_log(tmp_path / "broken")
    taught = Demonstration(times=[0.0, 1.0], positions=np.zeros((2, 2)))
    write_demonstrations(tmp_path / "demos", Demonstrations(items=(taught,)))
    with pytest.raises(InputError, match="demos: format must be"):
        read_log(tmp_path / "demos")


def test_a_log_that_cannot_be_written_is_said_so(human_trial, tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="taken must be a folder"):
        write_log(human_trial, tmp_path / "taken" / "trial.parquet")


def test_the_representation_of_a_trial_is_short(human_trial):
    assert len(repr(human_trial)) < 80
    assert "two_obstacles" in repr(human_trial)


def test_a_log_of_version_0_1_0_is_that_of_a_differential_drive(human_trial, tmp_path):
    metadata = {name: value for name, value in human_trial.metadata.items() if name != "robot"}
    write_log(Trial(columns=human_trial.columns, metadata=metadata), tmp_path / "old.parquet")
    back = read_log(tmp_path / "old.parquet")
    assert back.robot == human_trial.robot
    np.testing.assert_array_equal(back.commands("shared"), human_trial.commands("shared"))
