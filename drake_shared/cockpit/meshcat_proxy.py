"""Drake's own Meshcat page and websocket, passed on with our script added and nothing let back in."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import logging
import mimetypes
import random
import re
import sys

import aiohttp
from aiohttp import WSCloseCode, web
from pydrake.geometry import Meshcat, MeshcatParams

from drake_shared.cockpit.scene_relay import relay_from

_SCRIPT = '<script type="module" src="/cockpit/main.js"></script>\n'
MAX_SCENES = 32
_CHUNK = 1 << 16
_STUCK_AFTER = 10.0
_INLINE = re.compile(r"<script(?![^>]*\bsrc=)[^>]*>(.*?)</script>", re.DOTALL)


def start_meshcat() -> Meshcat:
    """Starts Drake's Meshcat where only this computer reaches it, on any free port.

    Its websocket asks nobody who they are, and ends the process on a malformed message. On Linux, where
    all of 127/8 is this computer, the address is drawn at random as well as the port: a page of another
    site that tries local ports does not find it.
    """
    host = "127.0.0.1"
    if sys.platform == "linux":
        host = f"127.{random.randint(1, 254)}.{random.randint(1, 254)}.{random.randint(2, 254)}"
    logger = logging.getLogger("drake")
    level = logger.level
    # It would announce an address that is not the one to open.
    logger.setLevel(logging.WARNING)
    try:
        return Meshcat(MeshcatParams(host=host, port=0))
    finally:
        logger.setLevel(level)


class MeshcatProxy:
    """Serves the page and the websocket of a Meshcat.

    Args:
        url: Of the Meshcat server, as its ``web_url()`` says.
    """

    def __init__(self, url: str) -> None:
        self._url = url.rstrip("/")
        self._client: aiohttp.ClientSession | None = None
        self._parts: dict[str, tuple[bytes, str]] = {}
        self._scenes: set[web.WebSocketResponse] = set()

    def add_routes(self, app: web.Application) -> None:
        """Adds the page, its parts and its websocket to ``app``."""
        app.router.add_get("/", self._root, allow_head=False)
        app.router.add_get("/favicon.ico", self._part, allow_head=False)
        app.router.add_get("/cas-v1/{name:[0-9a-f]{64}}", self._part, allow_head=False)
        app.cleanup_ctx.append(self._hold_client)
        app.on_shutdown.append(self._close_scenes)

    async def _hold_client(self, app: web.Application):
        async with aiohttp.ClientSession() as self._client:
            yield

    async def _close_scenes(self, app: web.Application) -> None:
        await asyncio.gather(*(scene.close(code=WSCloseCode.GOING_AWAY) for scene in self._scenes))

    async def _root(self, request: web.Request) -> web.StreamResponse:
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return await self._socket(request)
        assert self._client is not None
        async with self._client.get(f"{self._url}/") as answer:
            page = await answer.text()
        page = page.replace("</body>", f"{_SCRIPT}</body>", 1)
        policy = _content_security_policy(page, request.host)
        return web.Response(text=page, content_type="text/html", headers={"Content-Security-Policy": policy})

    async def _part(self, request: web.Request) -> web.StreamResponse:
        """Parts are named by their content, so that a browser may keep them, and so do we."""
        body, kind = self._parts.get(request.path) or await self._fetch(request.path)
        named = request.path.startswith("/cas")
        kept = "private, max-age=604800, immutable" if named else "no-store"
        if named:
            self._parts[request.path] = body, kind
        response = web.StreamResponse(headers={"Cache-Control": kept})
        response.content_type = kind
        response.content_length = len(body)
        await response.prepare(request)
        # Piece by piece: whoever does not read must not make us hold megabytes for each connection.
        for start in range(0, len(body), _CHUNK):
            try:
                async with asyncio.timeout(_STUCK_AFTER):
                    await response.write(body[start : start + _CHUNK])
            except TimeoutError:
                if request.transport is not None:
                    request.transport.abort()
                break
        return response

    async def _fetch(self, path: str) -> tuple[bytes, str]:
        assert self._client is not None
        async with self._client.get(f"{self._url}{path}") as answer:
            if answer.status != 200:
                raise web.HTTPNotFound
            name = answer.headers.get("Meshcat-Cas-Filename", path)
            return await answer.read(), mimetypes.guess_type(name)[0] or "application/octet-stream"

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if len(self._scenes) >= MAX_SCENES:
            raise web.HTTPServiceUnavailable(text="Too many pages are open.")
        # No heartbeat or pong of the library's: what it sends would fall in between the bytes of others.
        page = web.WebSocketResponse(max_msg_size=65536, timeout=1.0, compress=False, autoping=False)
        async with relay_from(self._url) as relay:
            await page.prepare(request)
            self._scenes.add(page)
            try:
                await relay.run(page, request.transport)
            finally:
                self._scenes.discard(page)
        if request.transport is not None and request.transport.get_write_buffer_size():
            # It does not take what it is sent, and so would never take a farewell.
            request.transport.abort()
        await page.close()
        return page


def _content_security_policy(page: str, host: str) -> str:
    """Our files and Drake's own inline scripts may run, nothing else."""
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
        for script in _INLINE.findall(page)
    )
    return "; ".join(
        (
            "default-src 'none'",
            # Meshcat decodes compressed meshes in WebAssembly, on workers that it makes from blobs.
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
