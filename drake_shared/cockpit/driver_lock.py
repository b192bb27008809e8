"""The driver's seat: one page has it at a time, and its newest sample is what MouseInput reads."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable

from drake_shared.cockpit.messages import Move
from drake_shared.systems.mouse_input import MouseSample, StickSettings

SILENT_AFTER = 2.0
"""Silence of the driver's page, in [s], after which it loses the seat."""

LET_GO = "stopped"
"""The driver let go of the controls."""
LOST = "page_closed"
"""The driver's page was closed, reloaded or fell silent."""

_REMEMBERED = 16


class DriverLock:
    """Hands out the single driver's seat, and keeps what its holder says. Safe to use from any thread.

    It is a :class:`~drake_shared.systems.mouse_input.MouseSource`. Each time that a page takes the seat
    is an engagement of its own, numbered from 1. Pages are known by a number that the server gives them.

    Args:
        open: Whether anybody may take the seat at all.
        assist: Whether the agent takes part.
        silent_after: Silence after which :meth:`expire` frees the seat, in [s].
        clock: Time in [s]; stamps samples.
    """

    def __init__(
        self,
        *,
        open: bool = True,
        assist: bool = True,
        silent_after: float = SILENT_AFTER,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._lock = threading.Lock()
        self._open = open
        self._silent_after = silent_after
        self._clock = clock
        self._holder: int | None = None
        self._sample = MouseSample()
        self._assist = assist
        self._departures: dict[int, str] = {}
        self._listeners: list[Callable[[], None]] = []

    def latest(self) -> MouseSample:
        """The newest sample; never waits, as samples are replaced whole."""
        return self._sample

    def age(self) -> float:
        """Time since the newest sample came, in [s]."""
        return self._clock() - self._sample.arrival

    @property
    def open(self) -> bool:
        """Whether anybody may take the seat at all."""
        return self._open

    @property
    def holder(self) -> int | None:
        """The page that drives, if one does."""
        return self._holder

    @property
    def assist(self) -> bool:
        """Whether the agent is to take part in the next trial."""
        return self._assist

    def departure(self, engagement: int) -> str | None:
        """Why ``engagement`` is over: LET_GO, LOST, or what :meth:`vacate` was told; None while it lasts.

        The reasons of the last few are remembered; of those before, only that they are over.
        """
        over = engagement < self._sample.engagement
        return self._departures.get(engagement, LOST if over else None)

    def listen(self, listener: Callable[[], None]) -> None:
        """Calls ``listener``, in whatever thread, after every change of the seat or of a setting."""
        self._listeners.append(listener)

    def engage(self, page: int) -> bool:
        """Gives the seat to ``page`` if it is free, and tells whether it now has it."""
        with self._lock:
            # Who asks twice, having heard late of the first answer, has it and is not refused.
            if page == self._holder:
                return True
            if not self._open or self._holder is not None:
                return False
            self._holder = page
            self._sample = MouseSample(
                engaged=True,
                engagement=self._sample.engagement + 1,
                arrival=self._clock(),
                stick=self._sample.stick,
            )
        self._tell()
        return True

    def move(self, page: int, move: Move) -> None:
        """Takes a sample from ``page``; one that does not drive is not heard."""
        with self._lock:
            if page == self._holder:
                self._sample = dataclasses.replace(
                    self._sample,
                    x=move.x,
                    y=move.y,
                    forward=move.forward,
                    turn=move.turn,
                    arrival=self._clock(),
                )

    def leave(self, page: int, why: str) -> None:
        """Frees the seat if ``page`` has it; ``why`` is LET_GO or LOST."""
        with self._lock:
            if page != self._holder:
                return
            self._free(why)
        self._tell()

    def vacate(self, why: str) -> None:
        """Frees the seat, whoever has it: the trial is over. The next needs a fresh click."""
        with self._lock:
            if self._holder is None:
                return
            self._free(why)
        self._tell()

    def expire(self) -> int | None:
        """Frees the seat if its page has been silent for too long, and says which page that was."""
        with self._lock:
            page = self._holder
            if page is None or self._clock() - self._sample.arrival <= self._silent_after:
                return None
            self._free(LOST)
        self._tell()
        return page

    def set_stick(self, page: int, stick: StickSettings) -> bool:
        """Changes the stick, from the next sample on, and tells whether ``page`` was entitled to."""
        with self._lock:
            if self._holder not in (None, page):
                return False
            self._sample = dataclasses.replace(self._sample, stick=stick)
        self._tell()
        return True

    def set_assist(self, page: int, on: bool) -> bool:
        """Switches the agent's part for trials to come, and tells whether ``page`` was entitled to."""
        with self._lock:
            if self._holder not in (None, page):
                return False
            self._assist = on
        self._tell()
        return True

    def _free(self, why: str) -> None:
        engagement = self._sample.engagement
        self._departures[engagement] = why
        self._departures.pop(engagement - _REMEMBERED, None)
        self._holder = None
        # The counters stay: a log keeps the last that was known.
        self._sample = dataclasses.replace(self._sample, engaged=False, forward=0.0, turn=0.0)

    def _tell(self) -> None:
        for listener in self._listeners:
            listener()
