"""Sends the newest message of every topic to all connected pages, without waiting for slow ones."""

from __future__ import annotations

import asyncio

from aiohttp import WSCloseCode, web

_CLOSE_TIMEOUT = 2.0


class PageConnection:
    """The websocket of one page, with the newest unsent message of each topic."""

    def __init__(self, websocket: web.WebSocketResponse, transport: asyncio.Transport | None) -> None:
        self._websocket = websocket
        self._transport = transport
        self._unsent: dict[str, str] = {}
        self._has_unsent = asyncio.Event()

    def send_soon(self, topic: str, text: str) -> None:
        """Queues ``text``, which replaces an unsent message of the same topic."""
        self._unsent[topic] = text
        self._has_unsent.set()

    async def send_queued(self) -> None:
        """Sends queued messages until the connection is closed."""
        while True:
            await self._has_unsent.wait()
            self._has_unsent.clear()
            while self._unsent:
                topic = next(iter(self._unsent))
                try:
                    await self._websocket.send_str(self._unsent.pop(topic))
                except ConnectionError:
                    return

    async def close(self, code: int, reason: str) -> None:
        """Closes the connection with a reason; aborts it if the page does not answer in time."""
        try:
            async with asyncio.timeout(_CLOSE_TIMEOUT):
                await self._websocket.close(code=code, message=reason.encode()[:120])
        except TimeoutError:
            if self._transport is not None:
                self._transport.abort()


class Broadcast:
    """All connected pages by their numbers, and the last message of each topic."""

    def __init__(self) -> None:
        self.pages: dict[int, PageConnection] = {}
        self._latest: dict[str, str] = {}

    def add(self, number: int, page: PageConnection) -> None:
        """Adds a page and sends it the last message of every topic."""
        self.pages[number] = page
        for topic, text in self._latest.items():
            page.send_soon(topic, text)

    def send_soon(self, topic: str, text: str) -> None:
        """Queues ``text`` for every page, including those that connect later."""
        self._latest[topic] = text
        for page in self.pages.values():
            page.send_soon(topic, text)

    async def close(self, number: int, code: int, reason: str) -> None:
        """Closes the connection of one page, if it is still connected."""
        if number in self.pages:
            await self.pages[number].close(code, reason)

    async def close_all(self) -> None:
        """Closes all connections because the program ends."""
        pages = self.pages.values()
        await asyncio.gather(*(page.close(WSCloseCode.GOING_AWAY, "ended") for page in pages))
