"""Keeps simulated time in step with the wall clock."""

from __future__ import annotations

import time
from collections.abc import Callable


class Pacer:
    """Waits until each time slice is due, and measures how late slices are.

    A late slice is followed by shorter waits until the schedule is met again. If the lateness exceeds
    ``max_lateness`` (a laptop that slept), the schedule is postponed instead, so that the robot does not
    race through the lost time.

    Args:
        period: Length of a slice, in [s].
        max_lateness: Largest lateness that is caught up, in [s].
        clock: Returns the time in [s].
        sleep: Waits for a time in [s].
    """

    def __init__(
        self,
        *,
        period: float,
        max_lateness: float = 0.5,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._period = period
        self._max_lateness = max_lateness
        self._clock = clock
        self._sleep = sleep
        self._start = clock()
        self.postponement = 0.0
        """Total time by which the schedule was postponed, in [s]."""
        self.paused = 0.0
        """Total time of the pauses, in [s]; no part of the schedule."""

    @property
    def elapsed(self) -> float:
        """Wall-clock time since the start, in [s]."""
        return self._clock() - self._start

    def pause(self) -> None:
        """Lets one period pass that is not part of the schedule."""
        before = self._clock()
        self._sleep(self._period)
        passed = self._clock() - before
        self._start += passed
        self.paused += passed

    def wait(self, index: int) -> float:
        """Waits until slice ``index`` is due, at ``index * period``. Returns its lateness, in [s]."""
        due = self._start + self.postponement + index * self._period
        ahead = due - self._clock()
        if ahead > 0:
            self._sleep(ahead)
        lateness = max(self._clock() - due, 0.0)
        if lateness > self._max_lateness:
            self.postponement += lateness
        return lateness
