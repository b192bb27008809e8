"""Access control of the page's server: a token, checks of Host and Origin, and security headers."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Awaitable, Callable

from aiohttp import web

_LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})
_BAD_KEY = "Open the address that drake-shared printed, with its key: this browser has none, or an old one."
_FOREIGN_PAGE = "Only this server's own page may do that."

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Access:
    """Accepts requests that carry the token and are meant for this server.

    A visit to ``/?k=TOKEN`` stores the token in a cookie (HttpOnly, SameSite=Strict) and redirects to ``/``.
    Host is checked by name, not by port, so that forwarded ports work; names that a foreign DNS server
    resolves to this computer are refused. Origin, which every websocket must send, must be this server as
    the browser sees it, port included.

    Args:
        host: The address that the server listens on.
        token: The token; random if None.
    """

    def __init__(self, *, host: str, token: str | None = None) -> None:
        self.token = token or secrets.token_urlsafe(18)
        self._names = set(_LOOPBACK_NAMES)
        if not is_loopback(host):
            self._names |= {host.lower(), socket.gethostname().lower(), socket.getfqdn().lower()}

    @web.middleware
    async def check_request(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Answers requests that may not enter with 403."""
        if not self._is_own_host(request):
            raise web.HTTPForbidden(text="This server does not go by that name.")
        origin = request.headers.get("Origin")
        must_have_origin = is_upgrade(request)
        if (must_have_origin or origin is not None) and origin != f"{request.scheme}://{request.host}":
            raise web.HTTPForbidden(text=_FOREIGN_PAGE)
        if _is_embedded_elsewhere(request):
            raise web.HTTPForbidden(text=_FOREIGN_PAGE)
        key = request.query.get("k")
        if key is not None and request.path == "/":
            if not self._is_token(key):
                raise web.HTTPForbidden(text=_BAD_KEY)
            response = web.HTTPSeeOther("/")
            response.set_cookie(_cookie_name(request), self.token, httponly=True, samesite="Strict", path="/")
            raise response
        if not self._is_token(request.cookies.get(_cookie_name(request), "")):
            raise web.HTTPForbidden(text=_BAD_KEY)
        return await handler(request)

    @staticmethod
    async def add_headers(request: web.Request, response: web.StreamResponse) -> None:
        """Adds headers that keep other pages from framing, reading or caching a response."""
        response.headers.setdefault("Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'")
        response.headers.setdefault("Cache-Control", "no-store")
        response.headers["X-Frame-Options"] = "DENY"
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["Cross-Origin-Resource-Policy"] = "same-origin"
        response.headers["Cross-Origin-Opener-Policy"] = "same-origin"

    def _is_token(self, key: str) -> bool:
        return hmac.compare_digest(key.encode(), self.token.encode())

    def _is_own_host(self, request: web.Request) -> bool:
        name = _without_port(request.host).lower()
        if name in self._names:
            return True
        # DNS cannot redirect a numeric address: the address of this connection is genuine.
        local = request.get_extra_info("sockname")
        return local is not None and name == local[0]


def is_loopback(host: str) -> bool:
    """Returns whether only this computer can reach ``host``."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def is_upgrade(request: web.Request) -> bool:
    """Returns whether the request opens a websocket."""
    return request.headers.get("Upgrade", "").lower() == "websocket"


def _cookie_name(request: web.Request) -> str:
    """Browsers send a cookie to every port of a host, so two servers must use different names."""
    return f"drake_shared_{request.url.port}"


def _is_embedded_elsewhere(request: web.Request) -> bool:
    """Returns whether the browser reports that a page of another origin embeds the response."""
    if request.headers.get("Sec-Fetch-Site", "none") in ("same-origin", "none"):
        return False
    # A followed link requests a document; frames, scripts and images request something else.
    return request.headers.get("Sec-Fetch-Dest") != "document"


def _without_port(host: str) -> str:
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0]
