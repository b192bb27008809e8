"""Who may come in: a token, the Host and Origin of each request, and headers that keep other pages out."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Awaitable, Callable

from aiohttp import web

_LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})
_REFUSED = "Open the address that drake-shared printed, with its key: this browser has none, or an old one."
_ELSEWHERE = "Only this server's own page may do that."

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Access:
    """Lets requests in that carry the token and were meant for this server.

    A visit to ``/?k=TOKEN`` leaves the token in a cookie that scripts cannot read and other sites cannot
    send, and redirects to ``/``. Host is checked by name, not by port, so that a forwarded port works; a
    name that someone else's DNS points here is refused. An Origin, which every websocket must have, must
    be this very server as the browser sees it, port included.

    Args:
        host: The address that the server listens on.
        token: Made at random if None.
    """

    def __init__(self, *, host: str, token: str | None = None) -> None:
        self.token = token or secrets.token_urlsafe(18)
        self._names = set(_LOOPBACK_NAMES)
        if not is_loopback(host):
            self._names |= {host.lower(), socket.gethostname().lower(), socket.getfqdn().lower()}

    @web.middleware
    async def guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuses with 403 what may not come in."""
        if not self._host_is_ours(request):
            raise web.HTTPForbidden(text="This server does not go by that name.")
        origin = request.headers.get("Origin")
        wants_socket = request.headers.get("Upgrade", "").lower() == "websocket"
        if (wants_socket or origin is not None) and origin != f"{request.scheme}://{request.host}":
            raise web.HTTPForbidden(text=_ELSEWHERE)
        if _embedded_elsewhere(request):
            raise web.HTTPForbidden(text=_ELSEWHERE)
        given = request.query.get("k")
        if given is not None and request.path == "/":
            if not self._is_token(given):
                raise web.HTTPForbidden(text=_REFUSED)
            response = web.HTTPSeeOther("/")
            response.set_cookie(_cookie_name(request), self.token, httponly=True, samesite="Strict", path="/")
            raise response
        if not self._is_token(request.cookies.get(_cookie_name(request), "")):
            raise web.HTTPForbidden(text=_REFUSED)
        return await handler(request)

    @staticmethod
    async def add_headers(request: web.Request, response: web.StreamResponse) -> None:
        """Adds what keeps other pages from framing, reading or caching an answer."""
        response.headers.setdefault("Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'")
        response.headers.setdefault("Cache-Control", "no-store")
        response.headers["X-Frame-Options"] = "DENY"
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["Cross-Origin-Resource-Policy"] = "same-origin"
        response.headers["Cross-Origin-Opener-Policy"] = "same-origin"

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self.token.encode())

    def _host_is_ours(self, request: web.Request) -> bool:
        name = _without_port(request.host).lower()
        if name in self._names:
            return True
        # An address cannot be pointed elsewhere by a DNS server: the one that was dialled is ours.
        local = request.get_extra_info("sockname")
        return local is not None and name == local[0]


def is_loopback(host: str) -> bool:
    """Whether only this computer can reach ``host``."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def _cookie_name(request: web.Request) -> str:
    """Browsers send a cookie to every port of a host: two servers must not share a name."""
    return f"drake_shared_{request.url.port}"


def _embedded_elsewhere(request: web.Request) -> bool:
    """Whether the browser says that a page of another origin wants this as a part of itself."""
    if request.headers.get("Sec-Fetch-Site", "none") in ("same-origin", "none"):
        return False
    # A link that is followed opens a window of its own; a frame is a document within another.
    return request.headers.get("Sec-Fetch-Dest") != "document"


def _without_port(host: str) -> str:
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0]
