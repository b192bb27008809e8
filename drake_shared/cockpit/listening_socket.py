"""A socket to listen on, or a word why there is none."""

from __future__ import annotations

import errno
import socket

from drake_shared.common.errors import InputError


def listen(host: str, port: int) -> socket.socket:
    """A listening socket on ``host`` and ``port``; 0 takes any port that is free.

    Raises:
        InputError: The port is in use or none, or the address is not one of this computer.
    """
    if not 0 <= port <= 65535:
        raise InputError("--port", "", "must be from 0 to 65535", port)
    try:
        family, *_, address = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, socket.SOCK_STREAM)
    except OSError as error:
        raise InputError(f"--host {host}", "", f"must be an address of this computer ({error})") from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(64)
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            expected = f"is in use on {host}; choose another with --port"
            raise InputError(f"port {port}", "", expected) from error
        raise InputError(f"--host {host}", "", f"must be an address of this computer ({error})") from error
    return listener
