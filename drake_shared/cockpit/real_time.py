"""A trial run at the pace of the clock on the wall."""

from __future__ import annotations

from collections.abc import Callable

from drake_shared.cockpit.pacer import Pacer
from drake_shared.simulation.trial import RunningTrial

SLICE = 0.005
"""Simulated time, in [s], that is run at once: how often the driver's samples can come in."""


_HAIR = 1e-9


class RealTime:
    """Advances a trial slice by slice, each when it is due. The clock starts when this is made.

    Args:
        running: The trial, at its start; one that ends by duration.
        on_step: Called at every control step, to show how things stand.
        pacer: Of slices of SLICE.
    """

    def __init__(
        self, running: RunningTrial, *, on_step: Callable[[], None], pacer: Pacer | None = None
    ) -> None:
        self._running = running
        self._on_step = on_step
        self._pacer = pacer or Pacer(period=SLICE)
        self._index = 0
        self._period = running.simulation.scenario.control_period
        self._steps = 0
        self.late_steps = 0
        """Control steps that came late by more than a control period."""
        self.worst_lateness = 0.0
        """Of a control step, in [s]."""

    def describe(self) -> dict[str, float | int]:
        """How well the pace was kept, for the log."""
        return {
            "wall_time": self._pacer.elapsed,
            "late_steps": self.late_steps,
            "worst_lateness": self.worst_lateness,
            "put_off": self._pacer.put_off,
        }

    def run(self, *, watch: Callable[[], str | None], judge: Callable[[], str | None]) -> str:
        """Runs on until someone says why the trial ends, or its time is over.

        Args:
            watch: Asked at every slice.
            judge: Asked at every control step. What concerns the robot belongs here: between steps its
                state is already that of the step to come, and a log that ended there would lack its row.

        Returns:
            What ``watch`` or ``judge`` said, or the trial's own status.
        """
        while True:
            why = watch()
            if why is not None:
                return why
            self._index += 1
            late = self._pacer.wait(self._index)
            until = self._index * SLICE
            # Times of steps are multiples as Drake rounds them: a hair past one, its update is done already.
            while (step := (self._steps + 1) * self._period) <= until + _HAIR:
                self._running.advance(step)
                self._steps += 1
                self.late_steps += late > self._period
                self.worst_lateness = max(self.worst_lateness, late)
                self._on_step()
                why = judge() or self._running.status
                if why is not None:
                    return why
            if until > self._running.time:
                self._running.advance(until)
