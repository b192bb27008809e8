"""Watches over a person's trial: when it starts, and what happens when the driver is lost."""

from __future__ import annotations

import threading

from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.simulation.trial import RunningTrial
from drake_shared.systems.mouse_input import STALE_AFTER

INTERRUPTED = "interrupted"
"""Status of a trial during which the program was told to end."""

_LOOK = 0.002
_REST = 1e-6


class DriverWatch:
    """Looks after one engagement of a driver in one trial.

    :class:`MouseInput` makes the human command zero by itself as soon as the driver is gone or silent. The
    agent must not drive on alone then, so the control goes to the human entirely, and the robot brakes.

    Args:
        seat: The driver's seat.
        engagement: The engagement that drives this trial.
        running: The trial.
        interrupted: Set when the program is told to end.
    """

    def __init__(
        self, seat: DriverLock, engagement: int, running: RunningTrial, interrupted: threading.Event
    ) -> None:
        self._seat = seat
        self._engagement = engagement
        self._running = running
        self._interrupted = interrupted
        self._mode = running.settings.mode
        parts = running.simulation.parts
        self._wheels_port = parts.plant.GetOutputPort("wheel_speed")
        self._wheels_context = parts.plant.GetMyContextFromRoot(running.root)

    @property
    def departed(self) -> bool:
        """Whether the driver is gone."""
        return self._seat.departure(self._engagement) is not None

    def wait_for_move(self) -> bool:
        """Waits for the driver's first move, on which the clock starts, and tells whether there was one."""
        while not self.departed:
            sample = self._seat.latest()
            pushed = max(abs(sample.forward), abs(sample.turn)) > sample.stick.dead_zone
            if sample.engagement == self._engagement and (sample.x or sample.y or pushed):
                return True
            if self._interrupted.wait(_LOOK):
                break
        return False

    def watch(self) -> str | None:
        """Why the trial ends now, or None. While nothing is heard of the driver the robot brakes."""
        if self._interrupted.is_set():
            return INTERRUPTED
        departure = self._seat.departure(self._engagement)
        heard = departure is None and self._seat.age() <= STALE_AFTER
        self._set_mode(self._running.settings.mode if heard else "human")
        return departure

    def judge_braking(self) -> str | None:
        """Something once the wheels are at rest, else None."""
        wheels = self._wheels_port.Eval(self._wheels_context)
        return "at rest" if max(abs(wheels)) <= _REST else None

    def _set_mode(self, mode: str) -> None:
        # A parameter that is set, even to what it was, makes Drake compute everything anew.
        if mode != self._mode:
            blender = self._running.simulation.parts.blender
            blender.set_mode(blender.GetMyMutableContextFromRoot(self._running.root), mode)
            self._mode = mode
