"""Access control of the page's server: a token, checks of Host and Origin, and security headers."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Awaitable, Callable, Collection
from urllib.parse import urlsplit

from aiohttp import web

from drake_shared.cockpit.key_page import key_page
from drake_shared.common.errors import InputError

_LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})
_BAD_KEY = "Open the address that drake-shared printed, with its key: this browser has none, or an old one."
_FOREIGN_PAGE = (
    "Only this server's own page may do that. If this is its page, seen through a proxy that speaks TLS, "
    "start drake-shared with --behind-proxy and the address in the browser, such as https://lab.example."
)
_OTHER_NAME = (
    "This server does not go by that name. If it should, start drake-shared with --allow-host and the name, "
    "or, behind a proxy that speaks TLS, with --behind-proxy and the address in the browser, such as "
    "https://lab.example."
)

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
        allowed_hosts: Further names of this computer, without port.
        proxy: Origin under which a proxy shows this server, such as "https://lab.example:8443". Only its
            pages are served then, besides those of this computer.

    Raises:
        InputError: ``proxy`` is not an origin.
    """

    def __init__(
        self,
        *,
        host: str,
        token: str | None = None,
        allowed_hosts: Collection[str] = (),
        proxy: str | None = None,
    ) -> None:
        self.token = token or secrets.token_urlsafe(18)
        self.proxy = None if proxy is None else _origin(proxy)
        self._names = set(_LOOPBACK_NAMES)
        if not is_loopback(host):
            self._names |= {host.lower(), socket.gethostname().lower(), socket.getfqdn().lower()}
        self._names |= {name.lower() for name in allowed_hosts}
        if self.proxy is not None:
            self._names.add(_without_port(self.proxy.partition("://")[2]))

    @web.middleware
    async def check_request(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Answers requests that may not enter with 403."""
        if not self._is_own_host(request):
            raise web.HTTPForbidden(text=_OTHER_NAME)
        origin = request.headers.get("Origin")
        must_have_origin = is_upgrade(request)
        if (must_have_origin or origin is not None) and not self._is_own_origin(origin, request):
            raise web.HTTPForbidden(text=_FOREIGN_PAGE)
        if _is_embedded_elsewhere(request):
            raise web.HTTPForbidden(text=_FOREIGN_PAGE)
        key = request.query.get("k")
        if key is not None and request.path == "/":
            if not self._is_token(key):
                raise key_page(_BAD_KEY)
            response = web.HTTPSeeOther("/")
            response.set_cookie(
                _cookie_name(request),
                self.token,
                httponly=True,
                samesite="Strict",
                path="/",
                # A plain connection to this computer itself must get the cookie too, for example by ssh.
                secure=self.proxy is not None and not self._is_local(request),
            )
            raise response
        if not self._is_token(request.cookies.get(_cookie_name(request), "")):
            raise key_page(_BAD_KEY)
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

    def _is_own_origin(self, origin: str | None, request: web.Request) -> bool:
        # A proxy may forward the Host that the browser gave, or give its own.
        return origin == f"{request.scheme}://{request.host}" or (
            self.proxy is not None and origin == self.proxy
        )

    @staticmethod
    def _is_local(request: web.Request) -> bool:
        return _without_port(request.host).lower() in _LOOPBACK_NAMES

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


def _origin(address: str) -> str:
    """The origin of an address, as browsers write it.

    Raises:
        InputError: It has no scheme http or https, no host, or a path.
    """
    parts = urlsplit(address)
    try:
        port = parts.port
    except ValueError:
        port = -1
    whole = parts.path in ("", "/") and not (parts.query or parts.fragment or parts.username)
    if parts.scheme not in ("http", "https") or not parts.hostname or port == -1 or not whole:
        raise InputError(
            "--behind-proxy", "", "must be an address such as https://lab.example", repr(address)
        )
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    standard = port in (None, {"http": 80, "https": 443}[parts.scheme])
    return f"{parts.scheme}://{host}" + ("" if standard else f":{port}")


def _without_port(host: str) -> str:
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0]
