"""Serves Drake's Meshcat page with the cockpit's script added, and relays its websocket one way."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import mimetypes
import random
import re
import sys
from collections.abc import AsyncIterator

import aiohttp
from aiohttp import WSCloseCode, web
from pydrake.geometry import Meshcat, MeshcatParams

from drake_shared.cockpit.access import is_upgrade
from drake_shared.cockpit.scene_relay import relay_from
from drake_shared.simulation.scene_drawing import start_quiet_meshcat

_SCRIPT = '<script type="module" src="/cockpit/main.js"></script>\n'
_HEAD = '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
MAX_SCENES = 32
_CHUNK = 1 << 16
_WRITE_TIMEOUT = 10.0
_INLINE = re.compile(r"<script(?![^>]*\bsrc=)[^>]*>(.*?)</script>", re.DOTALL)


def start_meshcat() -> Meshcat:
    """Starts Drake's Meshcat on a loopback address and any free port.

    Its websocket has no access control, and a malformed message aborts the process. On Linux, where all of
    127.0.0.0/8 is this computer, the address is random as well as the port, so that pages of other sites
    that scan local ports do not find it.
    """
    host = "127.0.0.1"
    if sys.platform == "linux":
        host = f"127.{random.randint(1, 254)}.{random.randint(1, 254)}.{random.randint(2, 254)}"
    return start_quiet_meshcat(MeshcatParams(host=host, port=0))


class MeshcatProxy:
    """Serves the page and the websocket of a Meshcat.

    Args:
        url: Address of the Meshcat server, from its ``web_url()``.
    """

    def __init__(self, url: str) -> None:
        self._url = url.rstrip("/")
        self._client: aiohttp.ClientSession | None = None
        self._cache: dict[str, tuple[bytes, str]] = {}
        self._scenes: set[web.WebSocketResponse] = set()

    def add_routes(self, app: web.Application) -> None:
        """Adds the page, its files and its websocket to ``app``."""
        app.router.add_get("/", self._root, allow_head=False)
        app.router.add_get("/favicon.ico", self._file, allow_head=False)
        app.router.add_get("/cas-v1/{name:[0-9a-f]{64}}", self._file, allow_head=False)
        app.cleanup_ctx.append(self._client_session)
        app.on_shutdown.append(self._close_scenes)

    async def _client_session(self, app: web.Application) -> AsyncIterator[None]:
        async with aiohttp.ClientSession() as self._client:
            yield

    async def _close_scenes(self, app: web.Application) -> None:
        await asyncio.gather(*(scene.close(code=WSCloseCode.GOING_AWAY) for scene in self._scenes))

    async def _root(self, request: web.Request) -> web.StreamResponse:
        if is_upgrade(request):
            return await self._socket(request)
        assert self._client is not None
        async with self._client.get(f"{self._url}/") as response:
            page = await response.text()
        page = page.replace("<head>", f"<head>{_HEAD}", 1).replace("<html>", '<html lang="en">', 1)
        page = page.replace("</body>", f"{_SCRIPT}</body>", 1)
        policy = _content_security_policy(page, request.host)
        return web.Response(text=page, content_type="text/html", headers={"Content-Security-Policy": policy})

    async def _file(self, request: web.Request) -> web.StreamResponse:
        """Files under /cas-v1/ are named by their content, so the browser and this server cache them."""
        body, kind = self._cache.get(request.path) or await self._fetch(request.path)
        named_by_content = request.path.startswith("/cas")
        caching = "private, max-age=604800, immutable" if named_by_content else "no-store"
        if named_by_content:
            self._cache[request.path] = body, kind
        response = web.StreamResponse(headers={"Cache-Control": caching})
        response.content_type = kind
        response.content_length = len(body)
        await response.prepare(request)
        # In pieces, so that clients that do not read cost no megabytes each.
        for start in range(0, len(body), _CHUNK):
            try:
                async with asyncio.timeout(_WRITE_TIMEOUT):
                    await response.write(body[start : start + _CHUNK])
            except TimeoutError:
                if request.transport is not None:
                    request.transport.abort()
                break
        return response

    async def _fetch(self, path: str) -> tuple[bytes, str]:
        assert self._client is not None
        async with self._client.get(f"{self._url}{path}") as response:
            if response.status != 200:
                raise web.HTTPNotFound
            name = response.headers.get("Meshcat-Cas-Filename", path)
            return await response.read(), mimetypes.guess_type(name)[0] or "application/octet-stream"

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if len(self._scenes) >= MAX_SCENES:
            raise web.HTTPServiceUnavailable(text="Too many pages are open.")
        # aiohttp must send no heartbeat or pong of its own between the bytes of relayed frames.
        page = web.WebSocketResponse(max_msg_size=65536, timeout=1.0, compress=False, autoping=False)
        async with relay_from(self._url) as relay:
            await page.prepare(request)
            self._scenes.add(page)
            try:
                await relay.run(page, request.transport)
            finally:
                self._scenes.discard(page)
        if request.transport is not None and request.transport.get_write_buffer_size():
            # The page has stopped reading, so it would never read the close frame.
            request.transport.abort()
        await page.close()
        return page


def _content_security_policy(page: str, host: str) -> str:
    """Returns a policy that runs only this server's scripts and Drake's own inline scripts."""
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
        for script in _INLINE.findall(page)
    )
    return "; ".join(
        (
            "default-src 'none'",
            # Meshcat decodes compressed meshes in WebAssembly, in workers created from blobs.
            f"script-src 'self' 'wasm-unsafe-eval' {hashes}",
            "worker-src blob:",
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' data: blob:",
            "font-src 'self' data:",
            f"connect-src 'self' ws://{host} data: blob:",
            "base-uri 'none'",
            "form-action 'none'",
            "frame-ancestors 'none'",
        )
    )
