"""Supervises the driver during a trial: waits for the first move, brakes when the driver is lost."""

from __future__ import annotations

import threading

from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.robots import Arm
from drake_shared.simulation.journal import INTERRUPTED
from drake_shared.simulation.trial import RunningTrial
from drake_shared.systems.mouse_input import STALE_AFTER
from drake_shared.systems.plant import plant_ports

_POLL_PERIOD = 0.002
# The posture of an arm may still settle, which its tip does not feel.
_REST_SPEED, _ARM_REST_SPEED = 1e-6, 0.05


class DriverWatch:
    """Supervises one engagement of a driver during one trial.

    :class:`MouseInput` outputs a zero command as soon as the driver is lost. The agent must not drive on
    alone then, so this gives the whole control to the human, and the robot brakes.

    Args:
        driver_lock: The driver lock.
        engagement: The engagement that drives this trial.
        running: The trial.
        interrupted: Set when the program is asked to end.
    """

    def __init__(
        self, driver_lock: DriverLock, engagement: int, running: RunningTrial, interrupted: threading.Event
    ) -> None:
        self._driver_lock = driver_lock
        self._engagement = engagement
        self._running = running
        self._interrupted = interrupted
        self._driver = running.driver
        parts = running.simulation.parts
        self._speed_port = plant_ports(parts.plant, parts.robot).speed
        self._rest_speed = _ARM_REST_SPEED if isinstance(parts.robot, Arm) else _REST_SPEED
        self._plant_context = parts.plant.GetMyContextFromRoot(running.root)

    @property
    def end_reason(self) -> str | None:
        """Why the engagement ended, or None while it lasts."""
        return self._driver_lock.end_reason(self._engagement)

    def wait_for_move(self) -> bool:
        """Waits for the driver's first move, at which the trial starts. Returns False if there is none."""
        while self.end_reason is None:
            sample = self._driver_lock.latest()
            deflected = max(abs(sample.forward), abs(sample.turn), abs(sample.up)) > sample.stick.dead_zone
            if sample.engagement == self._engagement and (sample.x or sample.y or deflected):
                return True
            if self._interrupted.wait(_POLL_PERIOD):
                break
        return False

    def check_driver(self) -> str | None:
        """Returns why the trial ends now, or None. The robot brakes while the samples are stale.

        It also brakes while the driver asks for a stop.
        """
        if self._interrupted.is_set():
            return INTERRUPTED
        reason = self.end_reason
        braking = self._driver_lock.latest().braking
        present = reason is None and not braking and self._driver_lock.age() <= STALE_AFTER
        self._set_driver(self._running.driver if present else "human")
        return reason

    @property
    def is_paused(self) -> bool:
        """Whether the driver has paused the trial and the robot is at rest."""
        return self._driver_lock.paused and self.check_rest() is not None

    def check_rest(self) -> str | None:
        """Returns "at rest" once wheels or joints are at rest, else None."""
        speeds = self._speed_port.Eval(self._plant_context)
        return "at rest" if max(abs(speeds)) <= self._rest_speed else None

    def _set_driver(self, driver: str) -> None:
        # Setting a parameter, even to the same value, invalidates Drake's cache.
        if driver != self._driver:
            self._running.simulation.parts.SetDriver(self._running.root, driver)
            self._driver = driver
