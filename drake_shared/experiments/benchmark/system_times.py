"""Where the time of a trial goes: the Python callbacks of each system, timed from within."""

from __future__ import annotations

import contextlib
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from typing import Any

from drake_shared.learners import Learner
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.intention_estimator import IntentionEstimator
from drake_shared.systems.surrogate_operator import SurrogateOperator
from drake_shared.systems.waypoint_controller import WaypointController

SYSTEMS = (SurrogateOperator, IntentionEstimator, WaypointController, ConfidenceBlender, DiffDrivePlant)
LEARNER = "learner"


class SystemTimes:
    """Seconds spent in each system itself, without what it asked others for.

    A callback that evaluates an input may run another system's callback inside it, so a stack says whose time
    it is. The clock is that on the wall, which costs the least to read: only shares of a trial mean anything
    on a machine that is busy.

    Attributes:
        seconds: By the system's name, or "learner", in [s].
        calls: Number of callbacks.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.calls: dict[str, int] = defaultdict(int)
        self._stack: list[str] = []
        self._since = 0.0

    def clear(self) -> None:
        """Begins anew."""
        self.seconds.clear()
        self.calls.clear()

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """``function``, its time counted to ``name``."""
        clock, stack, seconds, calls = time.perf_counter, self._stack, self.seconds, self.calls

        def wrapped(*arguments: Any) -> Any:
            now = clock()
            if stack:
                seconds[stack[-1]] += now - self._since
            stack.append(name)
            calls[name] += 1
            self._since = now
            try:
                return function(*arguments)
            finally:
                now = clock()
                seconds[stack.pop()] += now - self._since
                self._since = now

        return wrapped

    @contextlib.contextmanager
    def in_systems(self) -> Iterator[None]:
        """Systems that are built meanwhile are timed, for as long as they live."""
        kept = [
            (system, name, function)
            for system in SYSTEMS
            for name, function in vars(system).items()
            if name.startswith(("_calc_", "_update")) and callable(function)
        ]
        for system, name, function in kept:
            setattr(system, name, self.timed(system.__name__, function))
        try:
            yield
        finally:
            for system, name, function in kept:
                setattr(system, name, function)


class TimedLearner:
    """A learner whose predictions are timed."""

    def __init__(self, learner: Learner, times: SystemTimes) -> None:
        self._learner = learner
        self._times = times

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._learner, name)
        if name.startswith("predict"):
            found = self._times.timed(LEARNER, found)
            setattr(self, name, found)
        return found
