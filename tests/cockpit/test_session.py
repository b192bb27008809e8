"""Trials in real time without a browser: how they start, end and are saved."""

import dataclasses
import itertools
import os
import shutil
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from drake_shared.analysis.metrics import metrics
from drake_shared.arbitration.authority import Authority
from drake_shared.cockpit import drive, open_session
from drake_shared.cockpit.driver_lock import LOST, RELEASED
from drake_shared.cockpit.messages import Move, Setup
from drake_shared.common.errors import InputError
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import read_log


class Driver:
    """Holds the driver lock as a page does, and sends a sample every 20 ms."""

    def __init__(self, driver_lock, page: int = 1):
        self._driver_lock = driver_lock
        self._page = page
        self._move = Move(x=0, y=0, forward=0, turn=0)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._send)

    def __enter__(self):
        assert self._driver_lock.engage(self._page)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self.stop_sending()

    def push(self, forward: float = 0.0, turn: float = 0.0):
        self._move = Move(x=0, y=0, forward=forward, turn=turn)

    def leave(self, reason: str = RELEASED):
        self.stop_sending()
        self._driver_lock.release(self._page, reason)

    def stop_sending(self):
        self._stopped.set()
        self._thread.join()

    def _send(self):
        while not self._stopped.wait(0.02):
            self._driver_lock.move(self._page, self._move)


def deceleration(trial) -> float:
    """Returns the largest wheel acceleration, in [rad/s^2]."""
    wheels = np.stack([trial["wheel_left"], trial["wheel_right"]], axis=-1)
    return float(np.abs(np.diff(wheels, axis=0) / np.diff(trial["t"])[:, None]).max())


def assert_at_rest(trial):
    assert abs(trial["wheel_left"][-1]) <= 1e-6
    assert abs(trial["wheel_right"][-1]) <= 1e-6


def test_pushing_forward_reaches_the_goal_and_the_trial_is_saved(cockpit):
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        trial = cockpit.next_trial()
    assert trial.status == "reached"
    assert np.hypot(trial["x"][-1] - 0.5, trial["y"][-1]) <= cockpit.scenario.goal.radius
    np.testing.assert_allclose(np.diff(trial["t"]), 0.05, atol=1e-9)
    assert trial["stick_forward"].max() == 1.0
    assert trial["engaged"].max() == 1.0
    assert cockpit.driver_lock.holder is None
    (path,) = cockpit.record.iterdir()
    saved = read_log(path)
    assert saved.metadata == trial.metadata
    assert saved.metadata["operator"] == "ProbedMouse"
    assert saved.metadata["mode"] == "shared"
    assert saved.metadata["end"] == "reached"
    assert saved.metadata["driver"]["gain"] == cockpit.driver_lock.latest().stick.gain
    timing = {"wall_time", "late_steps", "worst_lateness", "put_off", "paused"}
    assert timing == set(saved.metadata["real_time"])
    np.testing.assert_array_equal(saved["mouse_age"], trial["mouse_age"])
    assert np.all(trial["mouse_age"] >= 0)


def test_the_trial_starts_at_the_first_move(long_cockpit, until):
    cockpit = long_cockpit
    with Driver(cockpit.driver_lock) as driver:
        time.sleep(0.3)
        assert not cockpit.mouse.readings
        driver.push(forward=0.6)
        until(lambda: len(cockpit.mouse.readings) > 80, "the trial to run")
        driver.leave()
        trial = cockpit.next_trial()
    # The command answers the driver from the first row on that follows a sample.
    recent = trial["mouse_age"][2:5] < 0.1
    assert np.all(trial["human_left"][2:5][recent] > 0)


def test_engaging_without_a_move_leaves_no_trial(cockpit, until):
    with Driver(cockpit.driver_lock) as driver:
        driver.leave()
    with Driver(cockpit.driver_lock, page=2) as driver:
        driver.push(forward=1.0)
        cockpit.next_trial()
    assert len(cockpit.trials) == 1


def test_trials_run_in_real_time(start_cockpit, open_floor, monkeypatch):
    open_floor.duration = 1.0
    cockpit = start_cockpit(open_floor)
    with Driver(cockpit.driver_lock) as driver:
        driver.push(turn=1.0)
        trial = cockpit.next_trial()
    assert trial.status == "timed_out"
    assert trial["t"][-1] == pytest.approx(1.0)
    assert len(trial["t"]) == 21
    # How far behind it may be is a matter of the machine; see test_pacer.py.
    assert trial.metadata["real_time"]["wall_time"] >= 0.999


@pytest.mark.parametrize(("reason", "status"), [(RELEASED, "stopped"), (LOST, "page_closed")])
def test_without_a_driver_the_robot_brakes_to_rest_and_the_agent_does_not_drive(long_cockpit, reason, status):
    cockpit = long_cockpit
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        cockpit.wait_for_time(0.6)
        left = time.monotonic()
        driver.leave(reason)
        trial = cockpit.next_trial()
    assert trial.status == status
    readings = list(cockpit.mouse.readings)
    stopped = next(now for now, _, command, _ in readings if now > left and not command.any())
    stall = max(b[0] - a[0] for a, b in itertools.pairwise(readings))
    assert stopped - left <= 0.2 + stall
    assert_at_rest(trial)
    robot = cockpit.scenario.robot
    assert deceleration(trial) <= robot.max_acceleration / robot.wheel_radius + 1e-6
    assert trial["human_weight"][-1] == 1.0
    assert cockpit.driver_lock.holder is None


def test_a_driver_who_stops_sending_is_stopped_and_loses_the_lock(long_cockpit):
    cockpit = long_cockpit
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        cockpit.wait_for_time(0.5)
        driver.stop_sending()
        trial = cockpit.next_trial()
    readings = list(cockpit.mouse.readings)
    last = readings[-1][1]
    stopped = next(now for now, arrival, command, _ in readings if arrival == last and not command.any())
    stall = max(b[0] - a[0] for a, b in itertools.pairwise(readings))
    assert stopped - last <= 0.2 + stall
    assert all(now - arrival <= 0.151 for now, arrival, command, _ in readings if command.any())
    assert trial.status == "page_closed"
    assert_at_rest(trial)
    assert trial["human_weight"][-1] == 1.0
    assert cockpit.driver_lock.holder is None


def test_a_short_silence_only_brakes(long_cockpit, until):
    cockpit = long_cockpit
    lock = cockpit.driver_lock
    assert lock.engage(1)

    def driven() -> bool:
        lock.move(1, Move(x=0, y=-200, forward=0, turn=0))
        return cockpit.command.any()

    until(driven, "the robot to be driven")
    until(lambda: not cockpit.command.any(), "the silence to be noticed")
    until(driven, "the robot to be driven again")
    lock.release(1)
    trial = cockpit.next_trial()
    assert trial.status == "stopped"


def test_hands_off_stops_the_robot_and_is_published(long_cockpit, until, monkeypatch):
    cockpit = long_cockpit
    published = []
    publish = cockpit.session.server.publish

    def listen(topic, content):
        if topic == "now":
            published.append(content)
        publish(topic, content)

    monkeypatch.setattr(cockpit.session.server, "publish", listen)
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        cockpit.wait_for_time(0.5)
        assert {now["let_go"] for now in published} == {None}
        driver.push()
        until(
            lambda: published[-1]["let_go"] == "hands_off" and not any(published[-1]["shared"]),
            "the robot to stop",
        )
        driver.push(forward=1.0)
        until(lambda: published[-1]["let_go"] is None and all(published[-1]["shared"]), "the robot to go on")
        driver.leave()
        assert cockpit.next_trial().status == "stopped"


def test_authority_and_safety_clearance_are_applied(start_cockpit, short_floor, route_learner):
    config = SharedControlConfig(authority=Authority(enabled=False), safety_clearance=0.1)
    cockpit = start_cockpit(short_floor, route_learner(short_floor), config=config)
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        trial = cockpit.next_trial()
    assert trial.metadata["arbitration"]["configuration"]["authority"] is None
    assert trial.metadata["safety_clearance"] == 0.1
    assert np.all(np.isfinite(trial.commands("safe")))


def test_each_trial_starts_from_the_initial_state(cockpit):
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        first = cockpit.next_trial(1)
    assert cockpit.driver_lock.set_assist(9, False)
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        second = cockpit.next_trial(2)
    assert (first.metadata["mode"], second.metadata["mode"]) == ("shared", "human")
    assert second["x"][0] == 0.0
    assert second["mouse_x"][0] == 0.0
    assert np.all(second["human_weight"] == 1.0)
    assert len(list(cockpit.record.iterdir())) == 2


def test_an_interrupted_trial_is_saved(start_cockpit, short_floor):
    cockpit = start_cockpit(short_floor)
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        cockpit.wait_for_time(0.3)
        cockpit.interrupt()
        trial = cockpit.next_trial()
    cockpit.stop()
    assert trial.status == "interrupted"
    (path,) = cockpit.record.iterdir()
    assert read_log(path).status == "interrupted"


def test_with_a_learner_that_outputs_nan_the_human_drives_alone(start_cockpit, short_floor, route_learner):
    learner = route_learner(short_floor)
    cockpit = start_cockpit(short_floor, learner)
    learner.variance = np.nan
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        trial = cockpit.next_trial()
    assert trial.status == "reached"
    assert np.all(trial["human_weight"] == 1.0)
    assert np.all(np.isnan(trial["confidence"]))


class FailingLearner:
    """Raises an exception from ``fail_at`` on, in [s] of the trial; otherwise predicts as ``learner``.

    It is sound while ``armed`` is False, so that it passes the check of a learner when it is wired.
    """

    armed = False

    def __init__(self, learner, fail_at):
        self._learner = learner
        self._fail_at = fail_at

    def __getattr__(self, name):
        return getattr(self._learner, name)

    def predict(self, times, positions, query_times):
        if self.armed and times[0] >= self._fail_at:
            raise ZeroDivisionError("a bug")
        return self._learner.predict(times, positions, query_times)


def test_after_a_failure_of_the_learner_the_trial_is_saved_and_the_driver_goes_on(
    start_cockpit, long_floor, route_learner, until
):
    learner = FailingLearner(route_learner(long_floor, clock="time"), fail_at=0.6)
    cockpit = start_cockpit(long_floor, learner)
    learner.armed = True
    for number in (1, 2):
        with Driver(cockpit.driver_lock) as driver:
            driver.push(forward=1.0)
            trial = cockpit.next_trial(number)
        assert (trial.status, trial.metadata["mode"]) == ("failed", "shared")
        assert trial["t"][-1] == pytest.approx(0.55)
        assert learner.name in trial.metadata["failure"]
        assert "0.6" in trial.metadata["failure"]
        # The report follows the end of the trial.
        until(lambda n=number: sum(learner.name in m for m in cockpit.messages) == n, "the report")
    assert not cockpit.driver_lock.assist
    cockpit.mouse.readings.clear()
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        cockpit.wait_for_time(1.0)
        driver.leave()
        trial = cockpit.next_trial(3)
    assert (trial.status, trial.metadata["mode"]) == ("stopped", "human")
    assert trial["t"][-1] > 0.6
    assert sorted(read_log(path).status for path in cockpit.record.iterdir()) == [
        "failed",
        "failed",
        "stopped",
    ]


class SlowLearner(FailingLearner):
    """Takes four control steps for each prediction while ``armed``."""

    def predict(self, times, positions, query_times):
        time.sleep(0.2 if self.armed else 0.0)
        return self._learner.predict(times, positions, query_times)


def test_a_trial_that_is_slower_than_real_time_is_reported(start_cockpit, open_floor, route_learner, until):
    open_floor.duration = 0.5
    learner = SlowLearner(route_learner(open_floor), fail_at=0.0)
    cockpit = start_cockpit(open_floor, learner)
    learner.armed = True
    with Driver(cockpit.driver_lock) as driver:
        driver.push(turn=1.0)
        trial = cockpit.next_trial()
    assert trial.metadata["real_time"]["put_off"] > 0.05
    until(lambda: any("slower than real time" in message for message in cockpit.messages), "the report")


def test_a_learner_that_fails_at_once_leaves_the_human_alone(start_cockpit, short_floor, route_learner):
    learner = FailingLearner(route_learner(short_floor), fail_at=0.0)
    cockpit = start_cockpit(short_floor, learner)
    learner.armed = True
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        trial = cockpit.next_trial()
    assert (trial.status, trial.metadata["mode"]) == ("reached", "human")


def test_a_full_disk_does_not_end_the_session(start_cockpit, short_floor, until):
    cockpit = start_cockpit(short_floor)
    cockpit.record.rmdir()
    cockpit.record.write_text("a file where the folder was")
    for number in (1, 2):
        with Driver(cockpit.driver_lock) as driver:
            driver.push(forward=1.0)
            cockpit.next_trial(number)
    until(lambda: sum("not saved" in message for message in cockpit.messages) == 2, "the reports")


def test_the_address_is_reported_while_no_page_is_connected(start_cockpit, short_floor, until):
    cockpit = start_cockpit(short_floor)
    until(lambda: cockpit.messages, "a message")
    assert cockpit.address in cockpit.messages[0]


def test_a_folder_that_cannot_be_written_to_is_an_input_error(short_floor, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with (
        pytest.raises(InputError, match="file"),
        open_session(short_floor, record=blocked),
    ):
        pass


def test_an_unknown_operator_is_an_input_error(short_floor):
    with pytest.raises(InputError, match="ghost"):
        drive(short_floor, operator="ghost", open_browser=False)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_session_and_the_trial_is_saved(open_floor, tmp_path, until, number):
    def send_while_a_trial_runs():
        until(lambda: list(tmp_path.glob("*.journal")), "a trial to begin")
        time.sleep(0.2)
        os.kill(os.getpid(), number)

    sender = threading.Thread(target=send_while_a_trial_runs)
    sender.start()
    before = signal.getsignal(number)
    drive(open_floor, operator="surrogate", record=tmp_path, port=0, open_browser=False)
    sender.join()
    assert signal.getsignal(number) is before
    (path,) = tmp_path.iterdir()
    saved = read_log(path)
    assert (saved.status, saved.metadata["operator"]) == ("interrupted", "SurrogateOperator")
    assert len(saved["t"]) > 1
    assert "recovered" not in saved.metadata


# Prints the time of each step, so that what was lost can be told.
KILLED = """
import sys
from drake_shared.cockpit import drive, trial_recorder
from drake_shared.scenario import (Goal, Route, Scenario, Workspace)
record = trial_recorder.TrialRecorder.record
def record_and_print(self):
    record(self)
    print(self.running.time, flush=True)
trial_recorder.TrialRecorder.record = record_and_print
scenario = Scenario(
    name="open_floor",
    goal=Goal(x=4.0, y=0.0),
    workspace=Workspace(x_min=-1.0, x_max=5.0, y_min=-2.0, y_max=2.0),
    routes=[Route(name="straight", waypoints=[[0.0, 0.0], [4.0, 0.0]])],
)
drive(scenario, operator="surrogate", record=sys.argv[1], port=0, open_browser=False)
"""


def test_what_was_driven_until_a_second_before_the_kill_is_recovered_by_the_next_session(
    tmp_path, open_floor
):
    command = [sys.executable, "-W", "error", "-c", KILLED, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline().startswith("http://127.0.0.1:")
        steps = [float(process.stdout.readline()) for _ in range(30)]
        process.kill()
        rest, _ = process.communicate(timeout=30)
    steps += [float(line) for line in rest.splitlines()]
    messages: list[str] = []
    with open_session(open_floor, operator="surrogate", record=tmp_path, report=messages.append):
        (path,) = tmp_path.iterdir()
    saved = read_log(path)
    assert any(str(path) in message for message in messages)
    assert (saved.status, saved.metadata["recovered"], saved.metadata["mode"]) == (
        "interrupted",
        True,
        "human",
    )
    assert steps[-1] - 1.0 <= saved["t"][-1] <= steps[-1] + 0.1
    np.testing.assert_allclose(np.diff(saved["t"]), 0.05, atol=1e-9)


def test_two_sessions_with_one_folder_keep_every_trial(start_cockpit, short_floor, monkeypatch):
    first, second = start_cockpit(short_floor), start_cockpit(short_floor)
    assert first.record == second.record
    for cockpit in (first, second):
        with Driver(cockpit.driver_lock) as driver:
            driver.push(forward=1.0)
            cockpit.next_trial()
    assert len(list(first.record.iterdir())) == 2


def test_a_folder_that_vanishes_is_made_again(start_cockpit, short_floor):
    cockpit = start_cockpit(short_floor)
    with Driver(cockpit.driver_lock) as driver:
        driver.push(forward=1.0)
        cockpit.wait_for_time(0.3)
        shutil.rmtree(cockpit.record)
        cockpit.next_trial()
    (path,) = cockpit.record.iterdir()
    assert read_log(path).status == "reached"


def test_choices_of_the_page_take_effect_and_logs_carry_the_route(start_cockpit, short_floor, until):
    cockpit = start_cockpit(short_floor)
    lock = cockpit.driver_lock
    until(lambda: cockpit.session.phase == "ready", "the session")
    setup = Setup(
        scenario="two_obstacles", learner=None, arbitration="blend", confidence_gain=None, route="left_right"
    )
    assert lock.request(1, setup)
    assert lock.request(1, dataclasses.replace(setup, scenario="short_floor", route="bent"))
    with Driver(lock) as driver:
        until(lambda: cockpit.session.phase == "armed", "the trial")
        assert not lock.request(2, setup)
        driver.push(forward=1.0)
        until(lambda: cockpit.session.phase == "driving", "the drive")
        lock.release(1)
        trial = cockpit.next_trial()
    assert trial.metadata["route"] == "bent"
    assert trial.metadata["scenario"]["name"] == "short_floor"
    assert metrics(trial)["intent_success"] is False  # It was stopped before the goal.


def test_the_driver_names_a_route_before_each_drive(start_cockpit, short_floor, until):
    cockpit = start_cockpit(short_floor, route="ask")
    lock = cockpit.driver_lock
    until(lambda: cockpit.session.phase == "ready", "the session")
    assert lock.engage(1)
    until(lambda: lock.holder is None, "the refusal")
    assert cockpit.session.phase == "ready"
    lock.request(
        1,
        Setup(scenario="short_floor", learner=None, arbitration="blend", confidence_gain=None, route="bent"),
    )
    with Driver(lock):
        until(lambda: cockpit.session.phase == "armed", "the trial")
        lock.release(1)
