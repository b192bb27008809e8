"""Each metric by hand, on constructed trials of five rows."""

import dataclasses
import json
import math

import numpy as np
import pytest

from drake_shared.analysis.metrics import metrics, sides_passed, sparc, summarize
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.robots.description import RobotDescription
from drake_shared.simulation.config import config_for
from drake_shared.simulation.log import log_columns
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings

PERIOD = 0.1


@pytest.fixture
def make(scenario):
    """Makes a trial that ends at the goal; columns that are not given are 0."""

    def trial(status="reached", metadata=None, **given) -> Trial:
        rows = max((len(values) for values in given.values()), default=5)
        columns = {"t": PERIOD * np.arange(rows)}
        columns |= {name: np.zeros(rows) for name in log_columns(DiffDrive())}
        columns |= {"clearance": np.ones(rows), "contact": np.zeros(rows, dtype=bool)}
        columns["x"] = np.linspace(0.0, 5.0, rows)
        columns |= {name: np.asarray(values) for name, values in given.items()}
        common = {"scenario": json.loads(json.dumps(dataclasses.asdict(scenario))), "status": status}
        return Trial(columns=columns, metadata=common | {"mode": "shared", "route": None} | (metadata or {}))

    return trial


def test_human_effort_is_the_integral_of_the_norm_of_the_human_command(make):
    trial = make(human_left=[3.0, 0.0, 6.0, 0.0, 99.0], human_right=[4.0, 0.0, 8.0, 1.0, 99.0])
    assert metrics(trial)["human_effort"] == pytest.approx((5.0 + 0.0 + 10.0 + 1.0) * PERIOD)


def test_excess_effort_is_that_beyond_the_shared_command(make):
    trial = make(human_left=[3.0, 0.0, 6.0, 0.0, 99.0], shared_left=[3.0, 0.0, 2.0, 1.0, 99.0])
    assert metrics(trial)["excess_effort"] == pytest.approx((0.0 + 0.0 + 4.0 - 1.0) * PERIOD)


def test_input_work_sums_the_changes_of_the_human_command(make):
    trial = make(human_left=[0.0, 3.0, 3.0, 0.0, 99.0], human_right=[0.0, 4.0, 4.0, 4.0, 99.0])
    assert metrics(trial)["input_work"] == pytest.approx(5.0 + 0.0 + 3.0)


def test_corrections_are_turning_points_that_stand_out(make):
    # Of the left wheel two peaks and the valley between them; the right one hardly moves.
    left = [0.0, 4.0, 0.0, 4.0, 0.0, 0.0]
    assert metrics(make(human_left=left, human_right=0.01 * np.array(left)))["corrections"] == 1.5
    assert metrics(make(human_left=np.arange(6.0)))["corrections"] == 0.0


def test_obstacles_behind_the_goal_do_not_decide_the_intent(make, scenario):
    def behind(y):
        trial = make(y=[0.0, 0.8, 0.8, 0.8, y], metadata={"route": "left_left"})
        beyond = {**trial.metadata["scenario"]["obstacles"][0], "name": "beyond", "x": 6.0, "y": 0.0}
        trial.metadata["scenario"]["obstacles"].append(beyond)
        for route in trial.metadata["scenario"]["routes"]:
            route["sides"]["beyond"] = "left"
        return metrics(trial)["intent_success"]

    assert behind(0.01)
    assert behind(-0.01)


def test_mean_human_weight_leaves_out_the_last_row(make):
    measured = metrics(make(human_weight=[1.0, 0.5, 0.5, 0.0, 1.0]))
    assert measured["mean_human_weight"] == pytest.approx(0.5)
    assert measured["human_weight_variance"] == pytest.approx(0.125)


def test_disagreement_sums_the_absolute_differences_of_both_wheels(make):
    trial = make(
        human_left=[1.0, 2.0, 3.0, 4.0, 99.0],
        human_right=[3.0, 1.0, 1.0, 1.0, 99.0],
        autonomous_left=[0.0, 4.0, 3.0, 4.0, 0.0],
        autonomous_right=[1.0, 1.0, -1.0, 1.0, 0.0],
    )
    measured = metrics(trial)
    assert measured["disagreement"] == pytest.approx((1 + 2) + 2 + 2 + 0)
    assert measured["disagreement_rate"] == pytest.approx(7 / 4)


def test_disagreement_without_an_agent_is_nan(make):
    nan = np.full(5, math.nan)
    measured = metrics(make(autonomous_left=nan, autonomous_right=nan))
    assert math.isnan(measured["disagreement"])
    assert math.isnan(measured["agreement"])
    assert measured["agreement_share"] == 0.0


def test_dissimilarity_is_the_mean_distance_of_the_human_command_from_the_shared_one(make):
    trial = make(
        human_left=[3.0, 0.0, 0.0, 0.0, 9.0],
        shared_right=[4.0, 0.0, 0.0, 2.0, 9.0],
    )
    assert metrics(trial)["dissimilarity"] == pytest.approx((5.0 + 2.0) / 4)


def test_agreement_is_the_mean_cosine_over_steps_with_both_commands(make):
    trial = make(
        human_left=[1.0, 2.0, 1.0, 0.0, 1.0],
        human_right=[0.0, 2.0, 0.0, 0.0, 1.0],
        autonomous_left=[0.0, 5.0, -3.0, 1.0, 1.0],
        autonomous_right=[7.0, 5.0, 0.0, 1.0, 1.0],
    )
    measured = metrics(trial)
    assert measured["agreement"] == pytest.approx((0.0 + 1.0 - 1.0) / 3)
    assert measured["agreement_share"] == pytest.approx(3 / 4)


def test_continuity_is_the_largest_change_in_one_step(make):
    trial = make(
        shared_left=[0.0, 1.0, 1.5, 1.5, 99.0],
        shared_right=[0.0, 0.0, -2.5, -2.5, 99.0],
        human_weight=[1.0, 0.9, 0.2, 0.3, 0.0],
    )
    measured = metrics(trial)
    assert measured["command_continuity"] == pytest.approx(2.5)
    assert measured["weight_continuity"] == pytest.approx(0.7)


def test_intervention_and_saturation_are_shares_of_the_steps(make, scenario):
    limit = scenario.robot.max_wheel_speed
    measured = metrics(
        make(human_left=[0.0, 0.0, 0.0, 2.0, 1.0], autonomous_right=[-limit, 0.0, limit, 0.0, limit])
    )
    assert measured["intervention_share"] == 0.25
    assert measured["saturated_share"] == 0.5


def test_the_smallest_command_counts_as_an_intervention(make):
    measured = metrics(make(human_left=[0.0, 1e-3, 0.0, 0.0, 1.0], human_right=[0.0, 0.0, 0.0, -1e-3, 1.0]))
    assert measured["intervention_share"] == 0.5


def test_path_length_is_the_sum_of_all_steps(make):
    trial = make(x=[0.0, 3.0, 3.0, 3.0, 3.0], y=[0.0, 4.0, 4.0, 5.0, 3.0], status="timed_out")
    assert metrics(trial)["path_length"] == pytest.approx(5.0 + 1.0 + 2.0)


def test_clearance_is_given_as_minimum_and_mean(make):
    measured = metrics(make(clearance=[0.5, 0.3, 0.1, 0.6, 1.0]))
    assert measured["clearance"] == pytest.approx(0.1)
    assert measured["mean_clearance"] == pytest.approx(0.5)


def test_clearance_is_none_without_obstacles(make):
    measured = metrics(make(clearance=np.full(5, math.inf)))
    assert measured["clearance"] is None
    assert measured["mean_clearance"] is None


@pytest.mark.parametrize(
    ("status", "touched", "success", "collision", "timeout"),
    [
        ("reached", False, True, False, False),
        ("reached", True, False, True, False),
        ("timed_out", False, False, False, True),
        ("timed_out", True, False, True, True),
        ("stopped", False, False, False, False),
    ],
)
def test_success_is_reaching_the_goal_without_contact(make, status, touched, success, collision, timeout):
    measured = metrics(make(status=status, contact=np.array([False, False, touched, False, False])))
    assert (measured["success"], measured["collision"], measured["timeout"]) == (success, collision, timeout)


def test_a_contact_in_the_last_step_is_a_collision(make):
    assert metrics(make(contact=np.array([False] * 4 + [True])))["collision"]


def test_completion_time_runs_from_the_first_command_of_the_human_to_the_goal(make):
    commands = [0.0, 0.0, 1.0, 0.0, 1.0]
    assert metrics(make(human_left=commands))["completion_time"] == pytest.approx(0.2)
    agent = make(human_left=commands, metadata={"mode": "agent"})
    assert metrics(agent)["completion_time"] == pytest.approx(0.4)
    assert metrics(make())["completion_time"] == pytest.approx(0.4)
    assert math.isnan(metrics(make(status="timed_out", human_left=commands))["completion_time"])


def test_completion_time_does_not_count_the_time_spent_at_the_goal(make):
    trial = make(x=[0.0, 2.0, 4.81, 5.0, 5.0, 5.0], human_left=np.ones(6))
    assert metrics(trial)["completion_time"] == pytest.approx(0.2)


def test_completion_time_does_not_depend_on_whether_the_trial_continues_at_the_goal(human_trial, scenario):
    longer = Simulation(scenario, config=config_for(None, end="duration")).run(
        TrialSettings(route="left_right", seed=5)
    )
    assert metrics(longer)["completion_time"] == metrics(human_trial)["completion_time"]


def path(*sides: str) -> dict[str, np.ndarray]:
    """A path past both obstacles on these sides."""
    y = [0.8 if side == "left" else -0.8 for side in sides]
    return {"x": np.array([0.0, 1.4, 2.5, 3.6, 5.0]), "y": np.array([0.0, y[0], 0.0, y[1], 0.0])}


@pytest.mark.parametrize(
    "driven", [("left", "right"), ("right", "left"), ("left", "left"), ("right", "right")]
)
def test_sides_are_those_on_which_the_robot_passed(make, driven):
    assert sides_passed(make(**path(*driven))) == {"first": driven[0], "second": driven[1]}


@pytest.mark.parametrize(
    ("driven", "intended", "success"),
    [
        (("left", "right"), "left_right", True),
        (("left", "right"), "left_left", False),
        (("right", "left"), "right_left", True),
        (("left", "left"), "left_right", False),
    ],
)
def test_intent_success_is_success_on_the_sides_of_the_intended_route(make, driven, intended, success):
    trial = make(**path(*driven), metadata={"route": intended})
    assert metrics(trial)["success"]
    assert metrics(trial)["intent_success"] is success


def test_an_operator_who_changes_the_route_intends_the_second_one(make):
    trial = make(**path("left", "left"), metadata={"route": "left_right", "then": "left_left"})
    assert metrics(trial)["intent_success"] is True


def test_intent_success_needs_success(make):
    trial = make(**path("left", "right"), metadata={"route": "left_right"}, status="timed_out")
    assert metrics(trial)["intent_success"] is False


def test_intent_success_is_none_without_a_route(make):
    assert metrics(make())["intent_success"] is None


@pytest.mark.parametrize("rows", [[2], [4], [0, 1, 2, 3, 4]])
@pytest.mark.parametrize("column", ["x", "y", "human_left", "shared_right"])
def test_nan_in_a_log_makes_only_what_follows_from_it_nan(make, column, rows):
    values = make(**path("left", "right"))[column].copy()
    values[rows] = math.nan
    columns = {**path("left", "right"), column: values}
    measured = metrics(make(**columns, metadata={"route": "left_right"}))
    moved = column in ("x", "y")
    assert math.isnan(measured["path_length"]) == math.isnan(measured["smoothness"]) == moved
    assert measured["clearance"] == 1.0
    applied = rows != [4]
    assert math.isnan(measured["human_effort"]) == (column == "human_left" and applied)
    assert math.isnan(measured["dissimilarity"]) == (not moved and applied)


def test_sides_are_judged_from_the_finite_positions(make):
    columns = path("left", "left")
    columns["x"][2] = math.nan
    assert sides_passed(make(**columns)) == {"first": "left", "second": "left"}
    assert sides_passed(make(x=np.full(5, math.nan))) == {}


@pytest.mark.parametrize("rows", [1, 2])
def test_logs_of_one_or_two_rows_have_metrics(make, rows):
    measured = metrics(make(status="stopped", x=np.zeros(rows)))
    assert measured["path_length"] == 0.0
    assert measured["human_effort"] == 0.0
    assert measured["command_continuity"] == measured["weight_continuity"] == 0.0
    assert not measured["success"]


def test_metrics_of_a_simulated_trial_are_plain_numbers(human_trial):
    measured = metrics(human_trial)
    assert all(value is None or isinstance(value, bool | int | float) for value in measured.values())
    assert measured["intent_success"] is True
    assert measured["mean_human_weight"] == 1.0
    assert measured["dissimilarity"] == 0.0
    assert measured["path_length"] == pytest.approx(5.9, abs=0.3)


def test_metrics_take_positions_commands_and_limits_of_any_robot(make, scenario):
    robot = RobotDescription(
        type="Quadrotor",
        configuration_names=("x", "y", "z"),
        position_names=("x", "y", "z"),
        command_names=("vx", "vy", "vz"),
        command_units=("m/s",) * 3,
        command_limits=(2.0, 2.0, 1.0),
        speed_names=(),
    )
    goal = {"x": 5.0, "y": 0.0, "z": 4.0, "radius": 0.1}
    columns = {"z": [0.0, 4.0, 4.0], "x": [0.0, 3.0, 5.0], "y": np.zeros(3)}
    for who in ("human", "autonomous", "shared"):
        columns |= {f"{who}_v{axis}": np.zeros(3) for axis in "xyz"}
    columns |= {"human_vx": [1.0, 0.0, 9.0], "human_vy": [2.0, 0.0, 9.0], "human_vz": [2.0, 0.5, 9.0]}
    world = {**dataclasses.asdict(scenario), "goal": goal}
    measured = metrics(make(**columns, metadata={"robot": robot.to_json(), "scenario": world}))
    assert measured["path_length"] == pytest.approx(5.0 + 2.0)
    assert measured["completion_time"] == pytest.approx(2 * PERIOD)
    assert measured["human_effort"] == pytest.approx((3.0 + 0.5) * PERIOD)
    assert measured["saturated_share"] == 0.5


BELL = np.sin(np.linspace(0, np.pi, 101)) ** 2


def test_sparc_does_not_depend_on_the_amplitude():
    assert sparc(7.3 * BELL, 0.05) == pytest.approx(sparc(BELL, 0.05), rel=1e-9)


def test_sparc_of_a_smooth_movement_is_nearer_to_0_than_of_a_jerky_one():
    jerky = BELL * (1 + 0.5 * np.sin(np.linspace(0, 16 * np.pi, 101)))
    two_bells = np.concatenate([BELL, np.zeros(20), BELL])
    assert sparc(jerky, 0.05) < sparc(BELL, 0.05) - 0.2
    assert sparc(two_bells, 0.05) < sparc(BELL, 0.05) - 0.2
    assert sparc(BELL, 0.05) < -1.0


def test_sparc_does_not_depend_on_the_duration_of_the_same_movement():
    assert sparc(BELL, 0.1) == pytest.approx(sparc(BELL, 0.02), rel=1e-9)


def test_sparc_is_the_arc_length_of_the_normalised_spectrum():
    period, size = 0.05, 2 ** (math.ceil(math.log2(101)) + 4)
    frequency = np.arange(size // 2 + 1) / (size * period)
    spectrum = np.abs([np.sum(BELL * np.exp(-2j * np.pi * f * period * np.arange(101))) for f in frequency])
    spectrum /= spectrum[0]
    last = np.flatnonzero((spectrum >= 0.05) & (frequency <= 10.0))[-1] + 1
    arc = np.hypot(np.diff(frequency[:last]) / frequency[last - 1], np.diff(spectrum[:last])).sum()
    assert sparc(BELL, period) == pytest.approx(-arc, rel=1e-9)


def test_sparc_without_motion_or_with_nan_is_nan():
    assert math.isnan(sparc(np.zeros(50), 0.05))
    assert math.isnan(sparc(np.where(np.arange(50) == 7, math.nan, 1.0), 0.05))
    assert math.isnan(sparc(np.ones(1), 0.05))


def test_summary_of_a_metric_is_its_mean_with_students_interval():
    summary = summarize([{"path_length": value} for value in (1.0, 2.0, 3.0, 6.0)])["path_length"]
    # t(0.975; 3) = 3.182, s = 2.160.
    assert summary["mean"] == 3.0
    assert summary["high"] - 3.0 == pytest.approx(3.182 * 2.1602 / 2, abs=1e-3)
    assert 3.0 - summary["low"] == pytest.approx(summary["high"] - 3.0)


def test_summary_of_a_share_has_wilsons_interval():
    summary = summarize([{"success": index < 9} for index in range(10)])["success"]
    # Wilson 1927 for 9 of 10.
    assert summary["mean"] == pytest.approx(0.9)
    assert (summary["low"], summary["high"]) == pytest.approx((0.5958, 0.9821), abs=1e-4)


def test_interval_of_a_share_of_1_has_a_width():
    summary = summarize([{"success": True}] * 10)["success"]
    assert summary["mean"] == summary["high"] == 1.0
    assert summary["low"] == pytest.approx(0.7225, abs=1e-4)


def test_undefined_values_do_not_count_in_a_summary():
    rows = [{"completion_time": 2.0}, {"completion_time": math.nan}, {"completion_time": 4.0}]
    assert (summarize(rows)["completion_time"]["mean"], summarize(rows)["completion_time"]["n"]) == (3.0, 2)
    assert summarize([{"intent_success": None}, {"intent_success": True}])["intent_success"]["mean"] == 1.0
    assert summarize([{"clearance": None}])["clearance"] == {"mean": None, "low": None, "high": None, "n": 0}


def test_one_trial_has_no_interval_and_no_trials_are_refused():
    assert summarize([{"path_length": 2.0}])["path_length"] == {
        "mean": 2.0,
        "low": None,
        "high": None,
        "n": 1,
    }
    with pytest.raises(InputError, match="trials"):
        summarize([])


def test_reaching_another_goal_than_the_one_meant_is_no_intent_success(make):
    def ended_at(y, **metadata):
        goals = [{"name": "shelf", "x": 5.0, "y": 1.0, "radius": 0.2}]
        goals += [{"name": "dock", "x": 5.0, "y": -1.0, "radius": 0.2}]
        trial = make(y=[0.0, y, y, y, y], metadata={"route": "to_shelf", **metadata})
        routes = [
            {"name": f"to_{goal['name']}", "waypoints": [[0.0, 0.0], [goal["x"], goal["y"]]], "sides": {}}
            for goal in goals
        ]
        trial.metadata["scenario"] |= {"goal": goals[0], "goals": goals, "routes": routes}
        return metrics(trial)

    assert (ended_at(1.0)["intent_success"], ended_at(1.0)["wrong_goal"]) == (True, False)
    assert (ended_at(-1.0)["intent_success"], ended_at(-1.0)["wrong_goal"]) == (False, True)
    assert ended_at(-1.0, then="to_dock")["intent_success"]
    assert ended_at(-1.0, route=None)["wrong_goal"] is None
    missed = ended_at(0.0, status="timed_out")
    assert (missed["intent_success"], missed["wrong_goal"]) == (False, False)
