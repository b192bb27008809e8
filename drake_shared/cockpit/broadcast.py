"""The pages that look on, each told the newest of every topic and never waited for."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

from aiohttp import WSCloseCode, web

_FAREWELL = 2.0


class Page:
    """One page's connection, with the newest of each topic that it has not been sent yet."""

    def __init__(self, connection: web.WebSocketResponse, transport: asyncio.Transport | None) -> None:
        self._connection = connection
        self._transport = transport
        self._unsent: dict[str, str] = {}
        self._wake = asyncio.Event()

    def tell(self, topic: str, text: str) -> None:
        """Has ``text`` sent, in place of what is still unsent of ``topic``."""
        self._unsent[topic] = text
        self._wake.set()

    async def write(self) -> None:
        """Sends what there is to tell, until the connection is closed."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._unsent:
                topic = next(iter(self._unsent))
                try:
                    await self._connection.send_str(self._unsent.pop(topic))
                except ConnectionError:
                    return

    async def close(self, code: int, reason: str) -> None:
        """Closes the connection and says why, but waits for nobody who does not listen."""
        try:
            async with asyncio.timeout(_FAREWELL):
                await self._connection.close(code=code, message=reason.encode()[:120])
        except TimeoutError:
            if self._transport is not None:
                self._transport.abort()


class Audience:
    """All pages, by the numbers that they are known by, and the last that was said of each topic."""

    def __init__(self) -> None:
        self._pages: dict[int, Page] = {}
        self._latest: dict[str, str] = {}

    def __len__(self) -> int:
        return len(self._pages)

    def __iter__(self) -> Iterator[tuple[int, Page]]:
        return iter(list(self._pages.items()))

    def add(self, number: int, page: Page) -> None:
        """Takes a page in, and tells it how things stand."""
        self._pages[number] = page
        for topic, text in self._latest.items():
            page.tell(topic, text)

    def remove(self, number: int) -> None:
        """Forgets a page."""
        del self._pages[number]

    def tell(self, topic: str, text: str) -> None:
        """Tells every page, and those to come."""
        self._latest[topic] = text
        for page in self._pages.values():
            page.tell(topic, text)

    async def close(self, number: int, code: int, reason: str) -> None:
        """Closes one page's connection, if it is still there."""
        if number in self._pages:
            await self._pages[number].close(code, reason)

    async def close_all(self) -> None:
        """Closes every connection: the program ends."""
        pages = self._pages.values()
        await asyncio.gather(*(page.close(WSCloseCode.GOING_AWAY, "ended") for page in pages))
