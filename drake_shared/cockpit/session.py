"""Runs trials one after another in real time, driven from a page or watched on it."""

from __future__ import annotations

import dataclasses
import datetime
import gc
import itertools
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from drake_shared.cockpit.demonstration_collector import DemonstrationCollector
from drake_shared.cockpit.drive_history import DriveHistory
from drake_shared.cockpit.driver_watch import DriverWatch
from drake_shared.cockpit.messages import Discard, Request, Setup, Train
from drake_shared.cockpit.page_state import StateReader, describe_result, describe_scene
from drake_shared.cockpit.real_time import RealTime
from drake_shared.cockpit.scene_state import SceneState
from drake_shared.cockpit.server import CockpitServer
from drake_shared.cockpit.trial_choices import DRIVES_TO_TRAIN, TrialChoices
from drake_shared.cockpit.trial_recorder import TrialRecorder
from drake_shared.common.errors import DrakeSharedError, RunError
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
_LAST_CHANCE = 10.0  # To discard the last demonstration, in [s].


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
        choices: What the driver may choose between trials; if None, the scenario, learner and config of the
            simulation at first.
        rebuild: Makes the simulation of other choices, in the thread that calls :meth:`run`; if None, the
            driver may choose no more than the route.
        record: Folder for the logs; if None, nothing is saved. Each trial is saved while it is driven.
        teaching: Collects the trials as demonstrations, in place of logs; the session ends when there are
            enough.
        report: Called with messages for the user.
        on_trial: Called with every finished trial; the session ends when it returns True.
    """

    def __init__(
        self,
        *,
        simulation: Simulation,
        server: CockpitServer,
        interrupted: threading.Event,
        choices: TrialChoices | None = None,
        rebuild: Callable[[TrialChoices], Simulation] | None = None,
        record: Path | None = None,
        teaching: DemonstrationCollector | None = None,
        report: Callable[[str], None] = lambda _: None,
        on_trial: Callable[[Trial], bool | None] = lambda _: None,
    ) -> None:
        self._choices = choices or TrialChoices(simulation.scenario, simulation.learner, simulation.config)
        self._rebuild = rebuild
        self._folder = record
        self._history = DriveHistory(record)
        server.rows = self._history.rows
        self.server = server
        self._driver_lock = server.driver_lock
        self._interrupted = interrupted
        self._teaching = teaching
        self._recorder = TrialRecorder(record, keep_logs=teaching is None)
        self._report = report
        self._on_trial = on_trial
        self.phase = "starting"
        """The phase that pages show: starting, ready, armed, driving, stopping, finished or ended."""
        self._number = 0
        self._failures = 0
        self._use(simulation)
        self._result: dict[str, Any] | None = None
        self._finished = False
        self._started = datetime.datetime.now().astimezone()
        self._has_driver = isinstance(simulation.parts.operator, MouseInput)

    def run(self) -> None:
        """Runs trials one after another."""
        self._suggest_route()
        self._publish_scene()
        self._begin()
        self._publish_phase("ready")
        if self._has_driver:
            while (engagement := self._wait_for_driver()) is not None:
                self._run_driven_trial(engagement)
        else:
            for seed in itertools.count():
                if self._over:
                    break
                self._run_watched_trial(seed)
                self._interrupted.wait(_PAUSE)
        self._publish_phase("ended")

    def _use(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._state_reader = StateReader(simulation)
        self._scene_state = SceneState(simulation)
        self._no_learner = NoLearner(simulation.scenario.duration)

    def _publish_scene(self) -> None:
        simulation = self._simulation
        operator, feedback = simulation.parts.operator, simulation.config.feedback
        described = describe_scene(simulation.scenario, operator, simulation.learner, feedback)
        self.server.publish("scene", described)
        self._publish_choices()

    def _publish_choices(self) -> None:
        if self._has_driver:
            drives = len(self._history.usable(self._simulation.scenario.name))
            described = self._choices.describe(usable_drives=drives)
            self.server.publish("setup", described | {"fixed": self._rebuild is None})
            self.server.publish("history", self._history.describe())
        if self._teaching is not None:
            self.server.publish("teaching", self._teaching.describe())

    def _suggest_route(self) -> None:
        if self._teaching is not None:
            self._choices.route = self._teaching.next_route

    def _answer(self, request: Request) -> None:
        """Does what a page asked for between trials."""
        match request:
            case Discard(number) if self._teaching is not None:
                self._discard_demonstration(self._teaching, number)
            case Discard(number):
                if (name := self._history.discard(number)) is not None:
                    self._report(f"Deleted {name}")
            case Setup() if self._choices.choose(request) and self._rebuild is not None:
                self._change_simulation()
            case Train() if self._rebuild is not None:
                self._train()
        self._publish_choices()

    def _discard_demonstration(self, teaching: DemonstrationCollector, number: int) -> None:
        try:
            if teaching.discard(number):
                self._history.discard(number)
                self._report(f"Discarded the demonstration of trial {number}")
        except (DrakeSharedError, OSError) as error:
            self._report(str(error))
        self._finished = teaching.complete
        self._suggest_route()

    def _train(self) -> None:
        drives = self._history.usable(self._simulation.scenario.name)
        if len(drives) < DRIVES_TO_TRAIN:
            return
        self._publish_phase("training")
        try:
            learner = self._choices.train(drives, self._folder)
        except DrakeSharedError as error:
            self._choices.error = str(error)
            self._publish_phase("ready")
            return
        self._report(f"Trained a learner ({learner.name}) on {len(drives)} drives")
        self._driver_lock.set_assist(self._driver_lock.holder or 0, True)
        self._change_simulation()

    def _change_simulation(self) -> None:
        assert self._rebuild is not None
        try:
            simulation = self._rebuild(self._choices)
        except DrakeSharedError as error:
            self._choices.error = str(error)
            return
        self._failures = 0
        self._result = None
        self._use(simulation)
        self._publish_scene()
        self._begin()
        self._publish_phase("ready")

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
        """Waits for the next engagement. Returns None if the session ends first.

        It ends at once when it is finished, but leaves time to discard the last demonstration.
        """
        connected = None
        until = time.monotonic() + (0.0 if self._teaching is None else _LAST_CHANCE)
        while not self._interrupted.wait(_POLL_PERIOD):
            if self._finished and (time.monotonic() > until or not self.server.pages):
                return None
            if connected is not bool(self.server.pages):
                connected = bool(self.server.pages)
                self._report(
                    "A page is connected: click Drive there."
                    if connected
                    else f"Waiting for a browser at {self.server.address}"
                )
            while (request := self._driver_lock.take_request()) is not None:
                self._answer(request)
            sample = self._driver_lock.latest()
            if sample.engaged:
                if not (self._choices.needs_route or self._finished):
                    return sample.engagement
                self._driver_lock.revoke("over")
        return None

    def _run_driven_trial(self, engagement: int) -> None:
        running = self._begin(route=self._choices.route)
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
        timing = real_time.describe()
        described: dict[str, Any] = {
            "started": self._started.isoformat(),
            "ended": datetime.datetime.now().astimezone().isoformat(),
            "real_time": timing,
        }
        operator = self._simulation.parts.operator
        if isinstance(operator, MouseInput):
            described["driver"] = dataclasses.asdict(self._driver_lock.latest().stick)
            described["driver"] |= {"max_speed": operator.max_speed, "max_yaw_rate": operator.max_yaw_rate}
        if failure is not None:
            described["failure"] = failure
        trial = running.finish(status, **described)
        saved, error, self._finished = self._recorder.finish(trial, self._end_trial)
        text = f"Trial {self._number}: {status} after {trial['t'][-1]:.2f} s"
        text += f" ({failure})" if failure else ""
        text += f"; not saved: {error}" if error else f", saved as {saved}" if saved else ""
        if timing["put_off"] > 0.1 * trial["t"][-1]:
            text += f"; {timing['put_off']:.1f} s slower than real time: a part of the loop is too slow"
        if "another_driver" in trial.columns and trial["another_driver"].any():
            begin = trial["t"][trial["another_driver"].argmax()]
            text += f"; another driver than that of --person was noticed at {begin:.1f} s"
        self._report(text)
        self.server.publish("trail", self._scene_state.whole_trail())
        self._result = describe_result(trial, saved, error) | {"number": self._number}
        self._history.add(self._number, self._result, trial)
        self._choices.next_trial()
        self._suggest_route()
        self._publish_choices()
        self._publish_phase("finished", running)
        # No trial runs now, and connections that were aborted leave large reference cycles.
        gc.collect()

    def _end_trial(self, trial: Trial) -> bool:
        """Returns whether the session is over."""
        over = bool(self._on_trial(trial))
        return (self._teaching is not None and self._teaching(trial)) or over

    def _show(self, running: RunningTrial) -> None:
        values = self._state_reader.read(running)
        described = self._state_reader.describe(running, values, paused=self._driver_lock.paused)
        self.server.publish("now", described)
        routes = self._scene_state.routes(running)
        if routes is not None:
            self.server.publish("routes", routes)
        trail = self._scene_state.trail(values, running.time)
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
