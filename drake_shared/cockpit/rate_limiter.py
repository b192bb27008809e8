"""Rate limiter for the messages of a connection."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable


class RateLimiter:
    """Limits the mean rate of messages, with bursts.

    A sender that exceeds the rate is delayed, not refused: its messages are left unread until they are due,
    so that they wait in the sender's buffers.

    Args:
        rate: Mean rate, in [messages/s].
        burst: Number of messages that may arrive at once.
        clock: Returns the time in [s].
        sleep: Waits for a time in [s].
    """

    def __init__(
        self,
        *,
        rate: float,
        burst: int,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
    ) -> None:
        self._interval = 1.0 / rate
        self._credit = burst / rate
        self._clock = clock
        self._sleep = sleep
        self._paid_until = clock() - self._credit

    async def acquire(self) -> None:
        """Counts one message, and waits until it is due."""
        now = self._clock()
        self._paid_until = max(self._paid_until, now - self._credit) + self._interval
        if self._paid_until > now:
            await self._sleep(self._paid_until - now)
