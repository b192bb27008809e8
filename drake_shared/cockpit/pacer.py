"""Keeps simulated time to the clock on the wall."""

from __future__ import annotations

import time
from collections.abc import Callable


class Pacer:
    """Says when each slice of a trial is due, and by how much slices come late.

    A slice that is late is made up for by those that follow. Where the lateness is beyond ``give_up``
    (a laptop that slept) the schedule is put off instead: a robot that races through the lost time would
    be no good to anyone.

    Args:
        period: Of a slice, in [s].
        give_up: Lateness that is not made up for, in [s].
        clock: Time in [s].
        sleep: Waits for a time in [s].
    """

    def __init__(
        self,
        *,
        period: float,
        give_up: float = 0.5,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._period = period
        self._give_up = give_up
        self._clock = clock
        self._sleep = sleep
        self._start = clock()
        self.put_off = 0.0
        """By how much the schedule was put off in all, in [s]."""

    @property
    def elapsed(self) -> float:
        """Time on the wall since the start, in [s]."""
        return self._clock() - self._start

    def wait(self, index: int) -> float:
        """Waits until slice ``index`` is due, at ``index * period``, and returns how late it is, in [s]."""
        due = self._start + self.put_off + index * self._period
        ahead = due - self._clock()
        if ahead > 0:
            self._sleep(ahead)
        late = max(self._clock() - due, 0.0)
        if late > self._give_up:
            self.put_off += late
        return late
