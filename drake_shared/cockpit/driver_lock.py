"""The driver lock: at most one page holds it, and its newest sample is what MouseInput reads."""

from __future__ import annotations

import collections
import dataclasses
import threading
import time
from collections.abc import Callable

from drake_shared.cockpit.messages import Brake, Lift, Move, Request
from drake_shared.systems.mouse_input import MouseSample, StickSettings

LOST_AFTER = 2.0
"""Time without a message from the driver's page, in [s], after which the page loses the lock."""

RELEASED = "stopped"
"""Reason for the end of an engagement: the driver released the controls."""
LOST = "page_closed"
"""Reason for the end of an engagement: the driver's page was closed, reloaded or stopped sending."""

_KEPT_REASONS = 16
_KEPT_REQUESTS = 16


class DriverLock:
    """Lets one page at a time drive, and keeps its newest sample. Thread-safe.

    It implements :class:`~drake_shared.systems.mouse_input.MouseSource`, so a :class:`MouseInput` reads it
    directly. :class:`~drake_shared.cockpit.server.CockpitServer` calls :meth:`engage`, :meth:`move` and
    :meth:`release` for the pages, which it identifies by integers. A program that drives without a browser
    may call them itself.

    An *engagement* lasts from the moment at which a page acquires the lock until the lock is free again.
    Engagements are numbered from 1. After each of them the driver must engage again.

    Args:
        enabled: Whether pages may acquire the lock at all.
        assist: Whether the agent takes part in the control.
        lost_after: Time without a sample after which :meth:`expire` frees the lock, in [s].
        clock: Returns the time in [s], with which samples are stamped. It must be the clock of MouseInput.
    """

    def __init__(
        self,
        *,
        enabled: bool = True,
        assist: bool = True,
        lost_after: float = LOST_AFTER,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._mutex = threading.Lock()
        self._enabled = enabled
        self._lost_after = lost_after
        self._clock = clock
        self._holder: int | None = None
        self._sample = MouseSample()
        self._assist = assist
        self._paused = False
        self._requests: collections.deque[Request] = collections.deque(maxlen=_KEPT_REQUESTS)
        self._reasons: dict[int, str] = {}
        self._listeners: list[Callable[[], None]] = []

    def latest(self) -> MouseSample:
        """Returns the newest sample. Never blocks, since samples are immutable and replaced as a whole."""
        return self._sample

    def age(self) -> float:
        """Returns the time since the newest sample arrived, in [s]."""
        return self._clock() - self._sample.arrival

    @property
    def enabled(self) -> bool:
        """Whether pages may acquire the lock at all."""
        return self._enabled

    @property
    def holder(self) -> int | None:
        """The page that drives, or None."""
        return self._holder

    @property
    def assist(self) -> bool:
        """Whether the agent takes part from the next trial on."""
        return self._assist

    @property
    def paused(self) -> bool:
        """Whether the driver has paused the trial."""
        return self._paused

    def end_reason(self, engagement: int) -> str | None:
        """Returns why ``engagement`` ended: RELEASED, LOST or the argument of :meth:`revoke`.

        None while the engagement lasts. Only the reasons of the last 16 engagements are kept; for earlier
        ones the result is LOST.
        """
        ended = engagement < self._sample.engagement
        return self._reasons.get(engagement, LOST if ended else None)

    def add_listener(self, listener: Callable[[], None]) -> None:
        """Calls ``listener`` after every change of the holder or of a setting, in the thread that made it."""
        self._listeners.append(listener)

    def engage(self, page: int) -> bool:
        """Gives the lock to ``page`` if it is free. Returns whether ``page`` holds it now."""
        with self._mutex:
            # A page may repeat its request before the first answer arrives.
            if page == self._holder:
                return True
            if not self._enabled or self._holder is not None:
                return False
            self._holder = page
            self._sample = MouseSample(
                engaged=True,
                engagement=self._sample.engagement + 1,
                arrival=self._clock(),
                stick=self._sample.stick,
            )
            self._paused = False
        self._notify()
        return True

    def move(self, page: int, move: Move) -> None:
        """Stores a sample from ``page``. Ignored unless ``page`` holds the lock."""
        with self._mutex:
            if page == self._holder:
                self._sample = dataclasses.replace(
                    self._sample,
                    x=move.x,
                    y=move.y,
                    forward=move.forward,
                    turn=move.turn,
                    arrival=self._clock(),
                )

    def lift(self, page: int, lift: Lift) -> None:
        """Stores the third axis of an arm from ``page``. Ignored unless ``page`` holds the lock."""
        with self._mutex:
            if page == self._holder:
                self._sample = dataclasses.replace(self._sample, up=lift.up, vertical=lift.vertical)

    def brake(self, page: int, brake: Brake) -> None:
        """Starts or ends a stop on request of ``page``. Ignored unless ``page`` holds the lock."""
        with self._mutex:
            if page != self._holder:
                return
            self._paused = brake.paused
            self._sample = dataclasses.replace(self._sample, braking=brake.lifted or brake.paused)
        self._notify()

    def recentre(self, page: int) -> None:
        """Moves the virtual stick to its centre. Ignored unless ``page`` holds the lock."""
        with self._mutex:
            if page == self._holder:
                self._sample = dataclasses.replace(self._sample, centrings=self._sample.centrings + 1)

    def release(self, page: int, reason: str = RELEASED) -> None:
        """Frees the lock if ``page`` holds it; ``reason`` is RELEASED or LOST."""
        with self._mutex:
            if page != self._holder:
                return
            self._free(reason)
        self._notify()

    def revoke(self, reason: str) -> None:
        """Frees the lock whoever holds it, for instance because the trial is over."""
        with self._mutex:
            if self._holder is None:
                return
            self._free(reason)
        self._notify()

    def expire(self) -> int | None:
        """Frees the lock if its holder has sent nothing for ``lost_after``. Returns that page, or None."""
        with self._mutex:
            page = self._holder
            if page is None or self.age() <= self._lost_after:
                return None
            self._free(LOST)
        self._notify()
        return page

    def set_stick(self, page: int, stick: StickSettings) -> bool:
        """Changes the stick's settings at once. Returns False if another page holds the lock."""
        with self._mutex:
            if self._holder not in (None, page):
                return False
            self._sample = dataclasses.replace(self._sample, stick=stick)
        self._notify()
        return True

    def set_assist(self, page: int, on: bool) -> bool:
        """Switches the agent from the next trial on. Returns False if another page holds the lock."""
        with self._mutex:
            if self._holder not in (None, page):
                return False
            self._assist = on
        self._notify()
        return True

    def request(self, page: int, request: Request) -> bool:
        """Queues what the session does between trials. Returns False if another page holds the lock."""
        with self._mutex:
            if self._holder not in (None, page) or not self._enabled:
                return False
            self._requests.append(request)
        return True

    def take_request(self) -> Request | None:
        """Returns the oldest request, which leaves the queue, or None."""
        return self._requests.popleft() if self._requests else None

    def _free(self, reason: str) -> None:
        engagement = self._sample.engagement
        self._reasons[engagement] = reason
        self._reasons.pop(engagement - _KEPT_REASONS, None)
        self._holder = None
        self._paused = False
        # The counters stay: a log keeps the last known values.
        self._sample = dataclasses.replace(self._sample, engaged=False, forward=0.0, turn=0.0, up=0.0)

    def _notify(self) -> None:
        for listener in self._listeners:
            listener()
