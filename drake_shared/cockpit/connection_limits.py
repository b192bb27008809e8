"""Takes connections in while there is room, and sees off those who do not show the key."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable

from aiohttp import web

from drake_shared.cockpit.access import Handler

MAX_CONNECTIONS = 128
"""Most connections at a time, whoever makes them."""

KEY_WITHIN = 5.0
"""Time in [s] in which a connection must have asked for something with the key."""

# A connection that is closed stays until all that was sent is taken, which may be never.
_LEAVE_WITHIN = 2.0
# Between two connections, in [s]: a flood of them must leave the simulation its processor.
_BREATH = 0.002
_NO_FILES_LEFT = 0.1
# Bytes; nobody has more than a few hundred to say.
_READ_AT_ONCE = 1 << 13


class Door:
    """Accepts connections for a web server.

    aiohttp waits for ever for the first request of a connection, and counts none of them. Here a connection
    is a stranger until a request on it has passed the guard. Strangers have :data:`KEY_WITHIN` for that, and
    where there is no room left for one who comes, the stranger who has been there longest goes: those who
    say nothing keep nobody out.

    Args:
        listener: A listening socket.
        room: Most connections at a time.
        patience: How long strangers may stay, in [s].
        clock: Time in [s].
    """

    def __init__(
        self,
        listener: socket.socket,
        *,
        room: int = MAX_CONNECTIONS,
        patience: float = KEY_WITHIN,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._listener = listener
        self._room = room
        self._patience = patience
        self._clock = clock
        # In the order in which they came.
        self._strangers: dict[asyncio.BaseTransport, float] = {}
        self._guests: set[asyncio.BaseTransport] = set()
        self._leaving: dict[asyncio.BaseTransport, float] = {}

    def __len__(self) -> int:
        return len(self._strangers) + len(self._guests)

    async def keep(self, server: web.Server) -> None:
        """Accepts connections for ``server`` until it is cancelled."""
        loop = asyncio.get_running_loop()
        self._listener.setblocking(False)
        while True:
            try:
                connection, _ = await loop.sock_accept(self._listener)
            except OSError:
                await asyncio.sleep(_NO_FILES_LEFT)
                continue
            self._make_room()
            if len(self) >= self._room:
                connection.close()
            else:
                try:
                    transport, _ = await loop.connect_accepted_socket(server, connection)
                    # The event loop's own measure is 256 KiB, and the library quotes what it cannot read.
                    transport.max_size = _READ_AT_ONCE  # type: ignore[attr-defined]
                    self._strangers[transport] = self._clock()
                except OSError:
                    connection.close()
            await asyncio.sleep(_BREATH)

    @web.middleware
    async def admit(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Knows the connection of a request that has passed the guard for one that has the key."""
        if request.transport is not None and self._strangers.pop(request.transport, None) is not None:
            self._guests.add(request.transport)
        return await handler(request)

    def sweep(self) -> None:
        """Closes connections of strangers who have been here too long, and forgets what is closed."""
        now = self._clock()
        for transport, since in list(self._strangers.items()):
            if now - since > self._patience:
                _abort(transport)
            if transport.is_closing():
                del self._strangers[transport]
                self._leaving[transport] = now
        for transport in [guest for guest in self._guests if guest.is_closing()]:
            self._guests.remove(transport)
            self._leaving[transport] = now
        for transport, since in list(self._leaving.items()):
            if now - since > _LEAVE_WITHIN:
                del self._leaving[transport]
                _abort(transport)

    def _make_room(self) -> None:
        if len(self) < self._room:
            return
        self.sweep()
        if len(self) >= self._room and self._strangers:
            oldest = next(iter(self._strangers))
            del self._strangers[oldest]
            _abort(oldest)


def _abort(transport: asyncio.BaseTransport) -> None:
    """Closes at once: what is still unsent may never be taken."""
    assert isinstance(transport, asyncio.Transport)
    transport.abort()
