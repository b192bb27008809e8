"""Runs trials one after another in real time, driven from a page or watched on it."""

from __future__ import annotations

import dataclasses
import datetime
import gc
import itertools
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from drake_shared.cockpit.driver_watch import DriverWatch
from drake_shared.cockpit.page_state import StateReader, describe_result, describe_scene
from drake_shared.cockpit.real_time import RealTime
from drake_shared.cockpit.scene_state import SceneState
from drake_shared.cockpit.server import CockpitServer
from drake_shared.cockpit.trial_recorder import TrialRecorder
from drake_shared.common.errors import RunError
from drake_shared.learners.no_learner import NoLearner
from drake_shared.simulation.journal import INTERRUPTED
from drake_shared.simulation.trial import RunningTrial, Simulation, Trial, TrialSettings
from drake_shared.systems.mouse_input import MouseInput

FAILED = "failed"
"""Status of a trial during which an exception was raised."""

MAX_FAILURES = 2
"""Number of failures of the learner in a row after which the human drives alone."""

_POLL_PERIOD = 0.02
_PAUSE = 4.0  # Between two watched trials, in [s].


class Session:
    """Runs trials for the page until it is interrupted.

    Meshcat is called only in the thread that calls :meth:`run`, by the simulation.

    A trial in which the learner raises an exception ends with the status "failed" and is saved; the next
    trial starts as usual. After :data:`MAX_FAILURES` such trials in a row the session switches the agent off,
    and the learner is not used again until the agent is switched on from a page.

    Args:
        simulation: Its operator is a :class:`MouseInput` that reads ``server.driver_lock``, or any other.
        server: Serves the pages.
        interrupted: Ends the session when set.
        record: Folder for the logs; if None, nothing is saved. Each trial is saved while it is driven.
        keep_logs: See :class:`TrialRecorder`.
        report: Called with messages for the user.
        on_trial: Called with every finished trial; the session ends when it returns True.
    """

    def __init__(
        self,
        *,
        simulation: Simulation,
        server: CockpitServer,
        interrupted: threading.Event,
        record: Path | None = None,
        keep_logs: bool = True,
        report: Callable[[str], None] = lambda _: None,
        on_trial: Callable[[Trial], bool | None] = lambda _: None,
    ) -> None:
        self._simulation = simulation
        self.server = server
        self._driver_lock = server.driver_lock
        self._interrupted = interrupted
        self._recorder = TrialRecorder(record, keep_logs=keep_logs)
        self._report = report
        self._on_trial = on_trial
        self._state_reader = StateReader(simulation)
        self._scene_state = SceneState(simulation)
        self.phase = "starting"
        """The phase that pages show: starting, ready, armed, driving, stopping, finished or ended."""
        self._number = 0
        self._failures = 0
        self._no_learner = NoLearner(simulation.scenario.duration)
        self._result: dict[str, Any] | None = None
        self._finished = False
        self._started = datetime.datetime.now().astimezone()
        self._has_driver = isinstance(simulation.parts.operator, MouseInput)

    def run(self) -> None:
        """Runs trials one after another."""
        simulation = self._simulation
        self.server.publish(
            "scene",
            describe_scene(
                simulation.scenario,
                simulation.parts.operator,
                simulation.learner,
                simulation.config.feedback,
            ),
        )
        self._begin()
        self._publish_phase("ready")
        if self._has_driver:
            while not self._over and (engagement := self._wait_for_driver()) is not None:
                self._run_driven_trial(engagement)
        else:
            for seed in itertools.count():
                if self._over:
                    break
                self._run_watched_trial(seed)
                self._interrupted.wait(_PAUSE)
        self._publish_phase("ended")

    @property
    def _over(self) -> bool:
        return self._finished or self._interrupted.is_set()

    def _begin(self, **settings: Any) -> RunningTrial:
        """Returns a new trial at its start, and shows it."""
        self.server.publish("trail", self._scene_state.begin())
        while True:
            assisted = self._driver_lock.assist and self._simulation.learner is not None
            driver = "agent" if self._simulation.config.driver == "agent" else "shared"
            trial = TrialSettings(driver=driver if assisted else "human", **settings)
            disabled = self._failures >= MAX_FAILURES and not assisted
            learner = self._no_learner if disabled else None
            try:
                # RealTime ends the trial at the goal, at a control step.
                running = self._simulation.begin(trial, learner=learner, ends_at_goal=False)
                self._show(running)
                return running
            except RunError as error:
                if disabled:
                    raise
                self._report(str(error))
                self._count_failure()

    def _count_failure(self) -> None:
        self._failures += 1
        if self._failures >= MAX_FAILURES:
            self._driver_lock.set_assist(self._driver_lock.holder or 0, False)
            self._report("Repeated failures: the human drives alone. Switch assistance on to retry.")

    def _wait_for_driver(self) -> int | None:
        """Waits for the next engagement. Returns None if the session is interrupted first."""
        connected = None
        while not self._interrupted.wait(_POLL_PERIOD):
            if connected is not bool(self.server.pages):
                connected = bool(self.server.pages)
                self._report(
                    "A page is connected: click Drive there."
                    if connected
                    else f"Waiting for a browser at {self.server.address}"
                )
            sample = self._driver_lock.latest()
            if sample.engaged:
                return sample.engagement
        return None

    def _run_driven_trial(self, engagement: int) -> None:
        running = self._begin()
        driver = DriverWatch(self._driver_lock, engagement, running, self._interrupted)
        self._result = None
        self._publish_phase("armed", running)
        if not driver.wait_for_move():
            self._publish_phase("ready")
            return

        def run(real_time: RealTime) -> str:
            status = real_time.run(
                check_slice=driver.check_driver,
                check_step=lambda: _at_goal(running),
                is_paused=lambda: driver.is_paused,
            )
            if driver.end_reason is not None:
                self._publish_phase("stopping", running)
                real_time.run(check_slice=self._check_interrupted, check_step=driver.check_rest)
            return status

        self._run_trial(running, run)

    def _run_watched_trial(self, seed: int) -> None:
        routes = self._simulation.scenario.routes
        running = self._begin(seed=seed, route=routes[seed % len(routes)].name)
        self._result = None

        def run(real_time: RealTime) -> str:
            return real_time.run(check_slice=self._check_interrupted, check_step=lambda: _at_goal(running))

        self._run_trial(running, run)

    def _run_trial(self, running: RunningTrial, run: Callable[[RealTime], str]) -> None:
        """Runs a trial from its start to its end, and saves it whatever happens."""
        self._publish_phase("driving", running)
        self._started = datetime.datetime.now().astimezone()
        self._recorder.begin(running, self._number + 1, started=self._started)

        def on_step() -> None:
            self._recorder.record()
            self._show(running)

        real_time = RealTime(running, on_step=on_step)
        status, failure = FAILED, None
        try:
            status = run(real_time)
            self._failures = 0
        except RunError as error:
            failure = str(error)
            self._count_failure()
        finally:
            self._driver_lock.revoke("over")
            self._finish(running, real_time, status, failure)

    def _check_interrupted(self) -> str | None:
        return INTERRUPTED if self._interrupted.is_set() else None

    def _finish(self, running: RunningTrial, real_time: RealTime, status: str, failure: str | None) -> None:
        """Saves the trial and shows its result."""
        self._number += 1
        described: dict[str, Any] = {
            "started": self._started.isoformat(),
            "ended": datetime.datetime.now().astimezone().isoformat(),
            "real_time": real_time.describe(),
        }
        operator = self._simulation.parts.operator
        if isinstance(operator, MouseInput):
            described["driver"] = dataclasses.asdict(self._driver_lock.latest().stick)
            described["driver"] |= {"max_speed": operator.max_speed, "max_yaw_rate": operator.max_yaw_rate}
        if failure is not None:
            described["failure"] = failure
        trial = running.finish(status, **described)
        saved, error, self._finished = self._recorder.finish(trial, self._on_trial)
        self.server.publish("trail", self._scene_state.whole_trail())
        self._result = describe_result(trial, saved, error)
        text = f"Trial {self._number}: {status} after {self._result['time']:.2f} s"
        text += f" ({failure})" if failure else ""
        text += f"; not saved: {error}" if error else f", saved as {saved}" if saved else ""
        self._report(text)
        self._publish_phase("finished", running)
        # No trial runs now, and connections that were aborted leave large reference cycles.
        gc.collect()

    def _show(self, running: RunningTrial) -> None:
        described = self._state_reader.describe(running, paused=self._driver_lock.paused)
        self.server.publish("now", described)
        routes = self._scene_state.routes(running)
        if routes is not None:
            self.server.publish("routes", routes)
        trail = self._scene_state.trail(self._state_reader.read(running), running.time)
        if trail is not None:
            self.server.publish("trail", trail)

    def _publish_phase(self, phase: str, running: RunningTrial | None = None) -> None:
        self.phase = phase
        mode = None if running is None else running.driver
        self.server.publish(
            "trial", {"phase": phase, "number": self._number, "mode": mode, "result": self._result}
        )


def _at_goal(running: RunningTrial) -> str | None:
    return "reached" if running.reached and running.simulation.config.end == "reached" else None
