"""Holds back who says too much."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable


class Allowance:
    """So many messages a second, and some more at once.

    Whoever goes beyond is made to wait, not refused: what is not read stays with its sender.

    Args:
        rate: Messages a second, in the long run.
        burst: How many may come at once.
        clock: Time in [s].
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

    async def take(self) -> None:
        """Uses one up, and waits until it is due."""
        now = self._clock()
        self._paid_until = max(self._paid_until, now - self._credit) + self._interval
        if self._paid_until > now:
            await self._sleep(self._paid_until - now)
