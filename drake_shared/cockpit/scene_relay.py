"""Drake's websocket passed on to a page byte by byte: it says thousands of things a second."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import os
from collections.abc import AsyncIterator
from urllib.parse import urlsplit

from aiohttp import web

from drake_shared.cockpit.rate_limiter import Allowance

_CHUNK = 1 << 18
_FULL = 1 << 20
_STUCK_AFTER = 5.0
_BEHIND_FOR = 15.0
# Messages a second from a page to Drake that are read, to be dropped.
_DROPPED = 200.0
_SIGN_OF_LIFE = 20.0
# A pong that nobody asked for: final frame, opcode 10, masked as a client's must be, empty.
_PONG = b"\x8a\x80\x00\x00\x00\x00"


class SceneRelay:
    """One connection to Drake's Meshcat.

    A server's frames bear no mask and need not be taken apart: those of Drake are, byte for byte, those
    that the page is to get. The other way nothing passes.
    """

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    async def run(self, page: web.WebSocketResponse, transport: asyncio.Transport | None) -> None:
        """Passes on what Drake says until either closes, or the page takes no more."""
        assert transport is not None
        jobs = (self._pass_on(transport), _swallow(page), self._show_life())
        tasks = [asyncio.create_task(job) for job in jobs]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _pass_on(self, transport: asyncio.Transport) -> None:
        clock = asyncio.get_running_loop().time
        kept_up = clock()
        while data := await self._reader.read(_CHUNK):
            # Drake must not hoard what a page does not take, be it frozen or ever too slow; it reloads later.
            if not transport.get_write_buffer_size():
                kept_up = clock()
            elif clock() - kept_up > _BEHIND_FOR:
                return
            transport.write(data)
            async with asyncio.timeout(_STUCK_AFTER):
                while transport.get_write_buffer_size() > _FULL:
                    await asyncio.sleep(0.01)
            if transport.is_closing():
                return

    async def _show_life(self) -> None:
        while True:
            await asyncio.sleep(_SIGN_OF_LIFE)
            self._writer.write(_PONG)


@contextlib.asynccontextmanager
async def relay_from(url: str) -> AsyncIterator[SceneRelay]:
    """Connects to the Meshcat at ``url``, without compression.

    Raises:
        web.HTTPBadGateway: It does not answer as it should.
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


async def _swallow(page: web.WebSocketResponse) -> None:
    """Reads what a page says to Drake and drops it: one malformed byte would end the process."""
    allowance = Allowance(rate=_DROPPED, burst=int(_DROPPED))
    async for _ in page:
        await allowance.take()
