"""Raw connections to the server, for requests and frames that no library would send."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import os
import socket
import struct
from urllib.parse import parse_qs, urlsplit


class Visitor:
    """Makes connections to a cockpit, with its key.

    Args:
        address: The address that the cockpit prints.
    """

    def __init__(self, address: str) -> None:
        parts = urlsplit(address)
        assert parts.port is not None
        self.port = parts.port
        self.origin = f"http://localhost:{parts.port}"
        self.cookie = f"drake_shared_{parts.port}={parse_qs(parts.query)['k'][0]}"

    async def connect(
        self, *, buffer: int | None = None
    ) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Opens a TCP connection; ``buffer`` is the size of its receive buffer in bytes."""
        sock = socket.socket()
        sock.setblocking(False)
        if buffer is not None:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
        await asyncio.get_running_loop().sock_connect(sock, ("127.0.0.1", self.port))
        limit = 2**16 if buffer is None else max(buffer, 1024)
        return await asyncio.open_connection(sock=sock, limit=limit)

    def request(self, path: str, *extra: str, method: str = "GET") -> bytes:
        """Returns a request with the key."""
        lines = (
            f"{method} {path} HTTP/1.1",
            f"Host: localhost:{self.port}",
            f"Cookie: {self.cookie}",
            *extra,
        )
        return "".join(f"{line}\r\n" for line in (*lines, "")).encode()

    def upgrade(self, path: str) -> bytes:
        """Returns a request for a websocket, with the key."""
        key = base64.b64encode(os.urandom(16)).decode()
        return self.request(
            path,
            f"Origin: {self.origin}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key}",
            "Sec-WebSocket-Version: 13",
        )

    async def websocket(self, path: str, *, buffer: int | None = None):
        """Opens a websocket. Returns None if it is refused."""
        reader, writer = await self.connect(buffer=buffer)
        writer.write(self.upgrade(path))
        head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), 10.0)
        if b" 101 " in head.partition(b"\r\n")[0]:
            return reader, writer
        drop(writer)
        return None


def frame(payload: bytes, *, opcode: int = 1, fin: bool = True, declared: int | None = None) -> bytes:
    """Returns a client's frame; ``declared`` is the length in its header, if not the true one."""
    length = len(payload) if declared is None else declared
    first = bytes([(0x80 if fin else 0) | opcode])
    if length < 126:
        head = first + bytes([0x80 | length])
    elif length < 2**16:
        head = first + bytes([0x80 | 126]) + struct.pack("!H", length)
    else:
        head = first + bytes([0x80 | 127]) + struct.pack("!Q", length)
    # A mask of zeros changes nothing.
    return head + bytes(4) + payload


def drop(writer: asyncio.StreamWriter) -> None:
    """Resets a connection, as a crash does."""
    sock = writer.get_extra_info("socket")
    if sock is not None:
        # The socket is closed already if the server closed it.
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.transport.abort()
