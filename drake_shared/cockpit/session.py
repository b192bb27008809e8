"""Trials one after another, in real time, with a person in the driver's seat or a page that looks on."""

from __future__ import annotations

import dataclasses
import datetime
import gc
import itertools
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat

from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.cockpit.driver_watch import INTERRUPTED, DriverWatch
from drake_shared.cockpit.page_state import Instruments, describe_now, describe_result, describe_scene
from drake_shared.cockpit.real_time import RealTime
from drake_shared.cockpit.server import CockpitServer
from drake_shared.common.errors import DrakeSharedError
from drake_shared.simulation.scene_drawing import draw_path
from drake_shared.simulation.trial import RunningTrial, Simulation, Trial, TrialSettings, write_log
from drake_shared.systems.mouse_input import MouseInput

FAILED = "failed"
"""Status of a trial during which an exception was raised."""

_LOOK = 0.02
_PAUSE = 4.0


class Session:
    """Runs trials for the page until it is interrupted.

    All calls of Meshcat come from the thread that calls ``run``.

    Args:
        simulation: Its operator is a :class:`MouseInput` that reads ``server.seat``, or drives by itself.
        meshcat: Where the simulation is drawn.
        server: Serves the pages.
        interrupted: Ends the session when it is set.
        record: Folder for the logs; nothing is kept if None.
        say: Takes messages for the person at the keyboard.
        on_trial: Given every trial that is over; the session ends if it returns True.
    """

    def __init__(
        self,
        *,
        simulation: Simulation,
        meshcat: Meshcat,
        server: CockpitServer,
        interrupted: threading.Event,
        record: Path | None = None,
        say: Callable[[str], None] = lambda _: None,
        on_trial: Callable[[Trial], bool | None] = lambda _: None,
    ) -> None:
        self._simulation = simulation
        self._meshcat = meshcat
        self.server = server
        self._seat: DriverLock = server.seat
        self._interrupted = interrupted
        self._record = record
        self._say = say
        self._on_trial = on_trial
        self._instruments = Instruments(simulation)
        self.phase = "starting"
        """What the page is told: ready, armed, driving, stopping, finished or ended."""
        self._number = 0
        self._result: dict[str, Any] | None = None
        self._enough = False
        self._driven = isinstance(simulation.parts.operator, MouseInput)

    def run(self) -> None:
        """Runs trials one after another."""
        self.server.publish("scene", describe_scene(self._simulation))
        self._show(self._begin())
        self._tell("ready")
        if self._driven:
            while not self._over and (engagement := self._wait_for_driver()) is not None:
                self._driven_trial(engagement)
        else:
            for seed in itertools.count():
                if self._over:
                    break
                self._watched_trial(seed)
                self._interrupted.wait(_PAUSE)
        self._tell("ended")

    @property
    def _over(self) -> bool:
        return self._enough or self._interrupted.is_set()

    def _begin(self, **settings: Any) -> RunningTrial:
        draw_path(self._meshcat, np.empty((0, 2)))
        mode = "shared" if self._seat.assist and self._simulation.learner is not None else "human"
        # The goal ends it at a control step, see RealTime.
        return self._simulation.begin(TrialSettings(mode=mode, end="duration", **settings))

    def _wait_for_driver(self) -> int | None:
        """The next engagement; None if the session is interrupted first."""
        connected = None
        while not self._interrupted.wait(_LOOK):
            if connected is not bool(self.server.pages):
                connected = bool(self.server.pages)
                self._say(
                    "A page is connected: click Drive there."
                    if connected
                    else f"Waiting for a browser at {self.server.address}"
                )
            sample = self._seat.latest()
            if sample.engaged:
                return sample.engagement
        return None

    def _driven_trial(self, engagement: int) -> None:
        running = self._begin()
        driver = DriverWatch(self._seat, engagement, running, self._interrupted)
        self._result = None
        self._tell("armed", running)
        self._show(running)
        if not driver.wait_for_move():
            self._tell("ready")
            return
        self._tell("driving", running)
        real_time = RealTime(running, on_step=lambda: self._show(running))
        try:
            status = real_time.run(watch=driver.watch, judge=lambda: _at_goal(running))
            if driver.departed:
                self._tell("stopping", running)
                real_time.run(watch=self._watch, judge=driver.judge_braking)
        except Exception:
            self._finish(running, real_time, FAILED)
            raise
        finally:
            self._seat.vacate("over")
        self._finish(running, real_time, status)

    def _watch(self) -> str | None:
        return INTERRUPTED if self._interrupted.is_set() else None

    def _watched_trial(self, seed: int) -> None:
        routes = self._simulation.scenario.routes
        running = self._begin(seed=seed, route=routes[seed % len(routes)].name)
        self._result = None
        self._tell("driving", running)
        real_time = RealTime(running, on_step=lambda: self._show(running))
        status = real_time.run(watch=self._watch, judge=lambda: _at_goal(running))
        self._finish(running, real_time, status)

    def _finish(self, running: RunningTrial, real_time: RealTime, status: str) -> None:
        """Keeps the trial, and shows how it went."""
        self._number += 1
        ended = datetime.datetime.now().astimezone()
        described: dict[str, Any] = {"ended": ended.isoformat(), "real_time": real_time.describe()}
        operator = self._simulation.parts.operator
        if isinstance(operator, MouseInput):
            described["driver"] = dataclasses.asdict(self._seat.latest().stick)
            described["driver"] |= {"max_speed": operator.max_speed, "max_yaw_rate": operator.max_yaw_rate}
        trial = running.finish(status, end="reached", **described)
        saved, trouble = self._save(trial, ended)
        draw_path(self._meshcat, trial.positions)
        self._result = describe_result(trial, saved, trouble)
        self._say(
            f"Trial {self._number}: {status} after {self._result['time']:.2f} s" + _kept(saved, trouble)
        )
        self._enough = bool(self._on_trial(trial))
        self._tell("finished", running)
        # Nobody waits now, and what those who misbehave leave behind is large and hangs together in circles.
        gc.collect()

    def _save(self, trial: Trial, ended: datetime.datetime) -> tuple[str | None, str | None]:
        """The name of the file that keeps the trial, or why there is none; a full disk ends no session."""
        if self._record is None:
            return None, None
        name = f"{self._simulation.scenario.name}_{ended:%Y%m%d-%H%M%S}_{self._number:03d}.parquet"
        try:
            write_log(trial, self._record / name)
        except DrakeSharedError as error:
            return None, str(error)
        return name, None

    def _show(self, running: RunningTrial) -> None:
        now = describe_now(
            self._instruments.read(running), running.time, self._instruments.read_let_go(running)
        )
        self.server.publish("now", now)

    def _tell(self, phase: str, running: RunningTrial | None = None) -> None:
        self.phase = phase
        mode = None if running is None else running.settings.mode
        self.server.publish(
            "trial", {"phase": phase, "number": self._number, "mode": mode, "result": self._result}
        )


def _at_goal(running: RunningTrial) -> str | None:
    return "reached" if running.reached else None


def _kept(saved: str | None, trouble: str | None) -> str:
    if trouble is not None:
        return f"; not saved: {trouble}"
    return "" if saved is None else f", saved as {saved}"
