"""Trials in real time with a hand at the seat but no browser: how they start, end and are kept."""

import itertools
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from drake_shared.cockpit import drive, open_session
from drake_shared.cockpit.driver_lock import LET_GO, LOST
from drake_shared.cockpit.messages import Move
from drake_shared.common.errors import InputError
from drake_shared.simulation.trial import read_log


class Hand:
    """Holds the seat as a page would, with a sign of life every 20 ms."""

    def __init__(self, seat, page: int = 1):
        self._seat = seat
        self._page = page
        self._move = Move(x=0, y=0, forward=0, turn=0)
        self._gone = threading.Event()
        self._thread = threading.Thread(target=self._live)

    def __enter__(self):
        assert self._seat.engage(self._page)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self.fall_silent()

    def push(self, forward: float = 0.0, turn: float = 0.0):
        self._move = Move(x=0, y=0, forward=forward, turn=turn)

    def leave(self, why: str):
        self.fall_silent()
        self._seat.leave(self._page, why)

    def fall_silent(self):
        self._gone.set()
        self._thread.join()

    def _live(self):
        while not self._gone.wait(0.02):
            self._seat.move(self._page, self._move)


def deceleration(trial) -> float:
    """Largest change of a wheel's speed in a second, in [rad/s^2]."""
    wheels = np.stack([trial["wheel_left"], trial["wheel_right"]], axis=-1)
    return float(np.abs(np.diff(wheels, axis=0) / np.diff(trial["t"])[:, None]).max())


def assert_at_rest(trial):
    assert abs(trial["wheel_left"][-1]) <= 1e-6
    assert abs(trial["wheel_right"][-1]) <= 1e-6


def test_pushing_forward_reaches_the_goal_and_the_trial_is_kept(cockpit):
    with Hand(cockpit.seat) as hand:
        hand.push(forward=1.0)
        trial = cockpit.next_trial()
    assert trial.status == "reached"
    assert np.hypot(trial["x"][-1] - 1.0, trial["y"][-1]) <= cockpit.scenario.goal.radius
    np.testing.assert_allclose(np.diff(trial["t"]), 0.05, atol=1e-9)
    assert trial["stick_forward"].max() == 1.0
    assert trial["engaged"].max() == 1.0
    assert cockpit.seat.holder is None
    (path,) = cockpit.record.iterdir()
    kept = read_log(path)
    assert kept.metadata == trial.metadata
    assert kept.metadata["operator"] == "ProbedMouse"
    assert kept.metadata["mode"] == "shared"
    assert kept.metadata["end"] == "reached"
    assert kept.metadata["driver"]["gain"] == cockpit.seat.latest().stick.gain
    assert {"wall_time", "late_steps", "worst_lateness", "put_off"} == set(kept.metadata["real_time"])
    np.testing.assert_array_equal(kept["mouse_age"], trial["mouse_age"])
    assert np.all(trial["mouse_age"] >= 0)


def test_the_clock_starts_at_the_first_move(long_cockpit, until):
    cockpit = long_cockpit
    with Hand(cockpit.seat) as hand:
        time.sleep(0.3)
        assert not cockpit.mouse.readings
        hand.push(forward=0.6)
        until(lambda: len(cockpit.mouse.readings) > 80, "the trial to run")
        hand.leave(LET_GO)
        trial = cockpit.next_trial()
    # From the first row that answers a sample on, the driver is at the controls.
    assert np.all(trial["human_left"][2:5] > 0)


def test_who_engages_and_lets_go_without_a_move_leaves_no_trial(cockpit, until):
    with Hand(cockpit.seat) as hand:
        hand.leave(LET_GO)
    with Hand(cockpit.seat, page=2) as hand:
        hand.push(forward=1.0)
        cockpit.next_trial()
    assert len(cockpit.trials) == 1


def test_the_wall_clock_is_kept(start_cockpit, open_floor, monkeypatch):
    open_floor.duration = 3.0
    cockpit = start_cockpit(open_floor)
    with Hand(cockpit.seat) as hand:
        hand.push(turn=1.0)
        trial = cockpit.next_trial()
    assert trial.status == "timed_out"
    assert trial["t"][-1] == pytest.approx(3.0)
    assert len(trial["t"]) == 61
    timing = trial.metadata["real_time"]
    # One per cent, and what the last slice alone may be late on a machine that does other work.
    assert timing["wall_time"] == pytest.approx(3.0, rel=0.01, abs=timing["put_off"] + 0.1)
    assert timing["late_steps"] * 0.05 <= 3.0


@pytest.mark.parametrize(("why", "status"), [(LET_GO, "stopped"), (LOST, "page_closed")])
def test_without_its_driver_the_robot_brakes_to_rest_and_the_agent_keeps_out(long_cockpit, why, status):
    cockpit = long_cockpit
    with Hand(cockpit.seat) as hand:
        hand.push(forward=1.0)
        cockpit.wait_for_time(0.6)
        left = time.monotonic()
        hand.leave(why)
        trial = cockpit.next_trial()
    assert trial.status == status
    stopped = next(now for now, _, command in cockpit.mouse.readings if now > left and not command.any())
    assert stopped - left < 0.2
    assert_at_rest(trial)
    robot = cockpit.scenario.robot
    assert deceleration(trial) <= robot.max_acceleration / robot.wheel_radius + 1e-6
    assert trial["human_weight"][-1] == 1.0
    assert cockpit.seat.holder is None


def test_a_driver_who_falls_silent_is_braked_for_and_loses_the_seat(long_cockpit):
    cockpit = long_cockpit
    with Hand(cockpit.seat) as hand:
        hand.push(forward=1.0)
        cockpit.wait_for_time(0.5)
        hand.fall_silent()
        trial = cockpit.next_trial()
    readings = list(cockpit.mouse.readings)
    last = readings[-1][1]
    stopped = next(now for now, arrival, command in readings if arrival == last and not command.any())
    stall = max(b[0] - a[0] for a, b in itertools.pairwise(readings))
    assert stopped - last <= 0.2 + stall
    assert all(now - arrival <= 0.151 for now, arrival, command in readings if command.any())
    assert trial.status == "page_closed"
    assert_at_rest(trial)
    assert trial["human_weight"][-1] == 1.0
    assert cockpit.seat.holder is None


def test_a_short_silence_only_brakes(long_cockpit, until):
    cockpit = long_cockpit
    seat = cockpit.seat
    assert seat.engage(1)
    seat.move(1, Move(x=0, y=-200, forward=0, turn=0))
    until(lambda: cockpit.command.any(), "the robot to be driven")
    until(lambda: not cockpit.command.any(), "the silence to be noticed")
    seat.move(1, Move(x=0, y=-200, forward=0, turn=0))
    until(lambda: cockpit.command.any(), "the robot to be driven again")
    seat.leave(1, LET_GO)
    trial = cockpit.next_trial()
    assert trial.status == "stopped"


def test_a_driver_whose_hands_are_off_comes_to_rest_and_the_page_is_told(long_cockpit, until, monkeypatch):
    cockpit = long_cockpit
    told = []
    publish = cockpit.session.server.publish

    def listen(topic, content):
        if topic == "now":
            told.append(content)
        publish(topic, content)

    monkeypatch.setattr(cockpit.session.server, "publish", listen)
    with Hand(cockpit.seat) as hand:
        hand.push(forward=1.0)
        cockpit.wait_for_time(0.5)
        assert {now["let_go"] for now in told} == {None}
        hand.push()
        until(lambda: told[-1]["let_go"] == "hands_off" and not any(told[-1]["shared"]), "the robot to stop")
        hand.push(forward=1.0)
        until(lambda: told[-1]["let_go"] is None and all(told[-1]["shared"]), "the robot to go on")
        hand.leave(LET_GO)
        assert cockpit.next_trial().status == "stopped"


def test_authority_and_safety_filter_are_those_that_were_asked_for(start_cockpit, short_floor, route_learner):
    cockpit = start_cockpit(short_floor, route_learner(short_floor), authority=False, safety_clearance=0.1)
    with Hand(cockpit.seat) as hand:
        hand.push(forward=1.0)
        trial = cockpit.next_trial()
    assert trial.metadata["arbitration"]["configuration"]["authority"] is None
    assert trial.metadata["safety_clearance"] == 0.1
    assert np.all(np.isfinite(trial.commands("safe")))


def test_trials_follow_each_other_and_each_starts_afresh(cockpit):
    with Hand(cockpit.seat) as hand:
        hand.push(forward=1.0)
        first = cockpit.next_trial(1)
    assert cockpit.seat.set_assist(9, False)
    with Hand(cockpit.seat) as hand:
        hand.push(forward=1.0)
        second = cockpit.next_trial(2)
    assert (first.metadata["mode"], second.metadata["mode"]) == ("shared", "human")
    assert second["x"][0] == 0.0
    assert second["mouse_x"][0] == 0.0
    assert np.all(second["human_weight"] == 1.0)
    assert len(list(cockpit.record.iterdir())) == 2


def test_an_interrupted_trial_is_kept(start_cockpit, short_floor):
    cockpit = start_cockpit(short_floor)
    with Hand(cockpit.seat) as hand:
        hand.push(forward=1.0)
        cockpit.wait_for_time(0.3)
        cockpit.interrupt()
        trial = cockpit.next_trial()
    cockpit.stop()
    assert trial.status == "interrupted"
    (path,) = cockpit.record.iterdir()
    assert read_log(path).status == "interrupted"


def test_a_learner_that_says_nan_leaves_the_human_alone(start_cockpit, short_floor, route_learner):
    cockpit = start_cockpit(short_floor, route_learner(short_floor, variance=np.nan))
    with Hand(cockpit.seat) as hand:
        hand.push(forward=1.0)
        trial = cockpit.next_trial()
    assert trial.status == "reached"
    assert np.all(trial["human_weight"] == 1.0)
    assert np.all(np.isnan(trial["confidence"]))


def test_a_full_disk_ends_no_session(start_cockpit, short_floor):
    cockpit = start_cockpit(short_floor)
    cockpit.record.rmdir()
    cockpit.record.write_text("a file where the folder was")
    for number in (1, 2):
        with Hand(cockpit.seat) as hand:
            hand.push(forward=1.0)
            cockpit.next_trial(number)
    assert sum("not saved" in message for message in cockpit.messages) == 2


def test_waiting_is_said(start_cockpit, short_floor, until):
    cockpit = start_cockpit(short_floor)
    until(lambda: any("Waiting for a browser" in message for message in cockpit.messages), "a message")
    assert cockpit.address in cockpit.messages[0]


def test_a_folder_that_cannot_be_written_to_is_said_before_anything_starts(short_floor, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with (
        pytest.raises(InputError, match="must be a folder to write to"),
        open_session(short_floor, record=blocked),
    ):
        pass


def test_an_operator_that_is_none_is_refused(short_floor):
    with pytest.raises(InputError, match="must be one of mouse, surrogate"):
        drive(short_floor, operator="ghost", open_browser=False)


SURROGATE = """
import sys
from drake_shared.cockpit import drive
from drake_shared.scenario import (Goal, Route, Scenario, Workspace)
scenario = Scenario(
    name="open_floor",
    goal=Goal(x=4.0, y=0.0),
    workspace=Workspace(x_min=-1.0, x_max=5.0, y_min=-2.0, y_max=2.0),
    routes=[Route(name="straight", waypoints=[[0.0, 0.0], [4.0, 0.0]])],
)
drive(scenario, operator="surrogate", record=sys.argv[1], port=0, open_browser=False)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_program_and_the_trial_is_kept(tmp_path, number):
    command = [sys.executable, "-W", "error", "-c", SURROGATE, str(tmp_path / "logs")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        address = process.stdout.readline()
        time.sleep(0.5)
        process.send_signal(number)
        _, messages = process.communicate(timeout=30)
    assert address.startswith("http://localhost:")
    assert process.returncode == 0, messages
    assert "interrupted" in messages
    (path,) = (tmp_path / "logs").iterdir()
    kept = read_log(path)
    assert (kept.status, kept.metadata["operator"]) == ("interrupted", "SurrogateOperator")
    assert len(kept["t"]) > 1
