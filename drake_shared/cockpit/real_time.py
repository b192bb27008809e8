"""Runs a trial at the pace of the wall clock."""

from __future__ import annotations

from collections.abc import Callable

from drake_shared.cockpit.pacer import Pacer
from drake_shared.simulation.trial import RunningTrial

SLICE = 0.005
"""Simulated time that is run at once, in [s]: the period at which samples of the driver are read."""

_TOLERANCE = 1e-9


class RealTime:
    """Advances a trial slice by slice, each when it is due. The clock starts at construction.

    Args:
        running: The trial, at its start. Its settings must have ``end="duration"``.
        on_step: Called after every control step.
    """

    def __init__(self, running: RunningTrial, *, on_step: Callable[[], None]) -> None:
        self._running = running
        self._on_step = on_step
        self._pacer = Pacer(period=SLICE)
        self._index = 0
        self._period = running.simulation.scenario.control_period
        self._steps = 0
        self.late_steps = 0
        """Number of control steps that were late by more than a control period."""
        self.worst_lateness = 0.0
        """Largest lateness of a control step, in [s]."""

    def describe(self) -> dict[str, float | int]:
        """Returns the timing for the log's metadata."""
        return {
            "wall_time": self._pacer.elapsed,
            "late_steps": self.late_steps,
            "worst_lateness": self.worst_lateness,
            "put_off": self._pacer.postponement,
            "paused": self._pacer.paused,
        }

    def run(
        self,
        *,
        check_slice: Callable[[], str | None],
        check_step: Callable[[], str | None],
        is_paused: Callable[[], bool] = lambda: False,
    ) -> str:
        """Runs until one of the checks returns a status or the trial is over.

        Args:
            check_slice: Called before every slice.
            check_step: Called after every control step. Checks of the robot's state belong here: between
                steps the state is already that of the next step, which has no row in the log yet.
            is_paused: While it returns True, the clock of the trial stands still.

        Returns:
            The status that ``check_slice`` or ``check_step`` returned, or that of the trial.
        """
        while True:
            status = check_slice()
            if status is not None:
                return status
            if is_paused():
                self._pacer.pause()
                continue
            self._index += 1
            lateness = self._pacer.wait(self._index)
            until = self._index * SLICE
            # Drake rounds the times of steps; a step just past ``until`` has already been taken.
            while (step := (self._steps + 1) * self._period) <= until + _TOLERANCE:
                self._running.advance(step)
                self._steps += 1
                self.late_steps += lateness > self._period
                self.worst_lateness = max(self.worst_lateness, lateness)
                self._on_step()
                status = check_step() or self._running.status
                if status is not None:
                    return status
            if until > self._running.time:
                self._running.advance(until)
