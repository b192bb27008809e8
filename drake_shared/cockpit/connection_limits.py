"""Accepts connections up to a limit, and closes those that do not authenticate in time."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable

from aiohttp import web

from drake_shared.cockpit.access import Handler

MAX_CONNECTIONS = 128
"""Largest number of simultaneous connections."""

KEY_TIMEOUT = 5.0
"""Time in which a connection must have made a request with the key, in [s]."""

# A closed connection stays until the peer has taken all that was sent, which may be never.
_CLOSE_TIMEOUT = 2.0
# Pause between two accepted connections, in [s]: a flood must leave processor time to the simulation.
_ACCEPT_PAUSE = 0.002
_NO_FILES_LEFT_PAUSE = 0.1
# In bytes; requests and messages have a few hundred.
_READ_SIZE = 1 << 13


class ConnectionLimiter:
    """Accepts connections for a web server, which by itself neither counts them nor times them out.

    A connection is *pending* until a request on it has passed :meth:`Access.check_request`, and then
    *authenticated*. Pending connections are closed after ``key_timeout``. When the limit is reached, the
    oldest pending connection is closed for a new one, so that idle connections do not lock anybody out.

    Args:
        listener: A listening socket.
        max_connections: Largest number of simultaneous connections.
        key_timeout: Time for which a connection may be pending, in [s].
        clock: Returns the time in [s].
    """

    def __init__(
        self,
        listener: socket.socket,
        *,
        max_connections: int = MAX_CONNECTIONS,
        key_timeout: float = KEY_TIMEOUT,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._listener = listener
        self._max_connections = max_connections
        self._key_timeout = key_timeout
        self._clock = clock
        # Transport to time of its arrival, oldest first.
        self._pending: dict[asyncio.BaseTransport, float] = {}
        self._authenticated: set[asyncio.BaseTransport] = set()
        self._closing: dict[asyncio.BaseTransport, float] = {}

    def __len__(self) -> int:
        return len(self._pending) + len(self._authenticated)

    async def accept(self, server: web.Server) -> None:
        """Accepts connections for ``server`` until cancelled."""
        loop = asyncio.get_running_loop()
        self._listener.setblocking(False)
        while True:
            try:
                connection, _ = await loop.sock_accept(self._listener)
            except OSError:
                await asyncio.sleep(_NO_FILES_LEFT_PAUSE)
                continue
            self._make_room()
            if len(self) >= self._max_connections:
                connection.close()
            else:
                try:
                    transport, _ = await loop.connect_accepted_socket(server, connection)
                    # The default is 256 KiB, and aiohttp quotes what it cannot parse.
                    transport.max_size = _READ_SIZE  # type: ignore[attr-defined]
                    self._pending[transport] = self._clock()
                except OSError:
                    connection.close()
            await asyncio.sleep(_ACCEPT_PAUSE)

    @web.middleware
    async def mark_authenticated(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Marks the connection of a request that has passed the access check as authenticated."""
        if request.transport is not None and self._pending.pop(request.transport, None) is not None:
            self._authenticated.add(request.transport)
        return await handler(request)

    def close_expired(self) -> None:
        """Closes connections that have been pending for too long, and forgets closed ones."""
        now = self._clock()
        for transport, since in list(self._pending.items()):
            if now - since > self._key_timeout:
                _abort(transport)
            if transport.is_closing():
                del self._pending[transport]
                self._closing[transport] = now
        for transport in [known for known in self._authenticated if known.is_closing()]:
            self._authenticated.remove(transport)
            self._closing[transport] = now
        for transport, since in list(self._closing.items()):
            if now - since > _CLOSE_TIMEOUT:
                del self._closing[transport]
                _abort(transport)

    def _make_room(self) -> None:
        if len(self) < self._max_connections:
            return
        self.close_expired()
        if len(self) >= self._max_connections and self._pending:
            oldest = next(iter(self._pending))
            del self._pending[oldest]
            _abort(oldest)


def _abort(transport: asyncio.BaseTransport) -> None:
    """Closes at once and drops unsent data, which the peer may never take."""
    assert isinstance(transport, asyncio.Transport)
    transport.abort()
