"""Opens a listening socket, with clear errors."""

from __future__ import annotations

import errno
import socket

from drake_shared.common.errors import InputError


def listen(host: str, port: int) -> socket.socket:
    """Returns a socket that listens on ``host`` and ``port``; port 0 takes any free port.

    Raises:
        InputError: The port is in use or out of range, or the address is not one of this computer.
    """
    if not 0 <= port <= 65535:
        raise InputError("--port", "", "must be from 0 to 65535", port)
    try:
        family, *_, address = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, socket.SOCK_STREAM)
    except OSError as error:
        raise _bad_host(host, error) from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(64)
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            expected = f"is in use on {host}; choose another with --port"
            raise InputError(f"port {port}", "", expected) from error
        raise _bad_host(host, error) from error
    return listener


def _bad_host(host: str, error: OSError) -> InputError:
    return InputError(f"--host {host}", "", f"must be an address of this computer ({error})")
