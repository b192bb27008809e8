"""Relays Drake's websocket to a page byte by byte, since it carries thousands of messages a second."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import os
from collections.abc import AsyncIterator
from urllib.parse import urlsplit

from aiohttp import web

from drake_shared.cockpit.rate_limiter import RateLimiter

_CHUNK = 1 << 18
_BUFFER_LIMIT = 1 << 20
_WRITE_TIMEOUT = 5.0
_LAG_TIMEOUT = 15.0
# Largest rate at which messages from a page to Drake are read and dropped, in [messages/s].
_DROP_RATE = 200.0
_KEEPALIVE_PERIOD = 20.0
# An unsolicited pong: final frame, opcode 10, masked as a client's must be, empty.
_PONG = b"\x8a\x80\x00\x00\x00\x00"


class SceneRelay:
    """One connection to Drake's Meshcat.

    A server's frames are not masked, so Drake's frames are passed to the page unchanged. Nothing is passed
    from the page to Drake.
    """

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    async def run(self, page: web.WebSocketResponse, transport: asyncio.Transport | None) -> None:
        """Relays until either side closes or the page no longer keeps up."""
        assert transport is not None
        jobs = (self._relay(transport), _drop_messages(page), self._send_keepalives())
        tasks = [asyncio.create_task(job) for job in jobs]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _relay(self, transport: asyncio.Transport) -> None:
        clock = asyncio.get_running_loop().time
        caught_up = clock()
        while data := await self._reader.read(_CHUNK):
            # Drake must not buffer without bound for a page that is frozen or too slow; the page reconnects.
            if not transport.get_write_buffer_size():
                caught_up = clock()
            elif clock() - caught_up > _LAG_TIMEOUT:
                return
            transport.write(data)
            async with asyncio.timeout(_WRITE_TIMEOUT):
                while transport.get_write_buffer_size() > _BUFFER_LIMIT:
                    await asyncio.sleep(0.01)
            if transport.is_closing():
                return

    async def _send_keepalives(self) -> None:
        while True:
            await asyncio.sleep(_KEEPALIVE_PERIOD)
            self._writer.write(_PONG)


@contextlib.asynccontextmanager
async def relay_from(url: str) -> AsyncIterator[SceneRelay]:
    """Connects to the Meshcat at ``url``, without compression.

    Raises:
        web.HTTPBadGateway: It does not answer, or not as a websocket.
    """
    address = urlsplit(url)
    try:
        reader, writer = await asyncio.open_connection(address.hostname, address.port)
    except OSError as error:
        raise web.HTTPBadGateway(text="Meshcat does not answer.") from error
    try:
        key = base64.b64encode(os.urandom(16)).decode()
        lines = (
            "GET / HTTP/1.1",
            f"Host: {address.netloc}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key}",
            "Sec-WebSocket-Version: 13",
        )
        writer.write("".join(f"{line}\r\n" for line in (*lines, "")).encode())
        answer = await reader.readuntil(b"\r\n\r\n")
        if b" 101 " not in answer.partition(b"\r\n")[0]:
            raise web.HTTPBadGateway(text="Meshcat does not speak websocket.")
        yield SceneRelay(reader, writer)
    finally:
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()


async def _drop_messages(page: web.WebSocketResponse) -> None:
    """Drops the page's messages to Drake, where one malformed byte would abort the process."""
    limiter = RateLimiter(rate=_DROP_RATE, burst=int(_DROP_RATE))
    async for _ in page:
        await limiter.acquire()
