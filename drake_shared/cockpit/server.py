"""The web server of the page, in a thread beside the simulation."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import logging
import queue
import socket
import threading
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web
from aiohttp.http_exceptions import HttpProcessingError

from drake_shared.cockpit.access import Access
from drake_shared.cockpit.broadcast import Broadcast, PageConnection
from drake_shared.cockpit.connection_limits import ConnectionLimiter
from drake_shared.cockpit.driver_lock import LOST, DriverLock
from drake_shared.cockpit.listening_socket import listen
from drake_shared.cockpit.meshcat_proxy import MeshcatProxy
from drake_shared.cockpit.messages import (
    MAX_BYTES,
    Brake,
    Discard,
    Engage,
    Lift,
    Message,
    MessageError,
    Move,
    Recentre,
    Release,
    SetAssist,
    SetStick,
    Setup,
    Train,
    parse,
)
from drake_shared.cockpit.rate_limiter import RateLimiter

DEFAULT_PORT = 8080
MAX_PAGES = 32
_WATCH_PERIOD = 0.05
# Changes of the driver lock within this time, in [s], are sent to the pages together.
_COALESCE = 0.01
# In [messages/s]: the fastest mouse makes 8,000 moves; a page that does not drive has little to send.
_MOVE_RATE, _OTHER_RATE = 10_000.0, 100.0
_BURST = 200
_KEEPALIVE_TIMEOUT = 15.0


class CockpitServer:
    """Serves Meshcat's page with the cockpit on it, and exchanges messages with the pages.

    It runs between :meth:`start` and :meth:`stop`, or as a context manager. :meth:`publish` and
    :attr:`pages` may be used from any thread and never block. The messages are described in
    docs/websocket_protocol.md.

    Args:
        meshcat_url: Address of Drake's Meshcat, from its ``web_url()``.
        driver_lock: The pages acquire it, and their samples go to it.
        host: Address to listen on.
        port: Port to listen on; 0 takes any free port.
        token: The key in the page's address; random if None.
        allowed_hosts: Further names by which browsers may ask for the page.
        proxy: Origin under which a proxy that speaks TLS shows the page, such as "https://lab.example".
        fixed: Whether the program alone decides about assistance, stick and setup, for a single page.

    Raises:
        InputError: ``proxy`` is not an origin.
    """

    def __init__(
        self,
        *,
        meshcat_url: str,
        driver_lock: DriverLock,
        host: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        token: str | None = None,
        allowed_hosts: Collection[str] = (),
        proxy: str | None = None,
        fixed: bool = False,
    ) -> None:
        self.driver_lock = driver_lock
        self._fixed = fixed
        self.host = host
        self.port = port
        self._bound = host
        self._access = Access(host=host, token=token, allowed_hosts=allowed_hosts, proxy=proxy)
        self._meshcat = MeshcatProxy(meshcat_url)
        self._broadcast = Broadcast()
        self.routes: tuple[web.AbstractRoute, ...] = ()
        """All routes of the running server."""
        self.rows: Mapping[int, str] = {}
        """Rows of past drives as JSON text, by number, which pages fetch from /drives/NUMBER."""
        self._numbers = itertools.count(1)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._closing: asyncio.Event | None = None
        self._lock_state_scheduled = False

    @property
    def address(self) -> str:
        """The address to open in a browser, key included.

        Without a proxy it is the address that the server listens on, and not a name such as localhost, under
        which another program may listen on the same port and receive the key.
        """
        if self._access.proxy is not None:
            return f"{self._access.proxy}/?k={self._access.token}"
        host = socket.gethostname() if self._bound in ("0.0.0.0", "::") else self._bound
        shown = f"[{host}]" if ":" in host else host
        return f"http://{shown}:{self.port}/?k={self._access.token}"

    @property
    def pages(self) -> int:
        """Number of connected pages."""
        return len(self._broadcast.pages)

    def start(self) -> None:
        """Starts the server, and returns as soon as it accepts connections.

        Raises:
            InputError: The port is in use, or the address is not one of this computer.
        """
        listener = listen(self.host, self.port)
        self._bound, self.port = listener.getsockname()[:2]
        started: queue.Queue[BaseException | None] = queue.Queue()
        self._thread = threading.Thread(
            target=self._run, args=(listener, started), name="cockpit", daemon=True
        )
        self._thread.start()
        failure = started.get()
        if failure is not None:
            self._thread.join()
            raise failure
        self.driver_lock.add_listener(lambda: self._call_in_loop(self._schedule_lock_state))

    def stop(self) -> None:
        """Closes all connections and ends the thread."""
        if self._thread is not None and self._closing is not None:
            self._call_in_loop(self._closing.set)
            self._thread.join()
            self._thread = None

    def __enter__(self) -> CockpitServer:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def publish(self, topic: str, content: Mapping[str, Any]) -> None:
        """Sends a message to all pages.

        A slow page receives only the newest message of a topic; a page that connects later receives the
        last one of every topic.

        Args:
            topic: The message's ``type``.
            content: The other fields. NaN and infinity are not allowed, as JSON has neither.
        """
        text = json.dumps({"type": topic, **content}, allow_nan=False)
        self._call_in_loop(self._broadcast.send_soon, topic, text)

    def _call_in_loop(self, function: Callable[..., None], *args: Any) -> None:
        if self._loop is not None and not self._loop.is_closed():
            with contextlib.suppress(RuntimeError):  # The loop was closed in the meantime.
                self._loop.call_soon_threadsafe(function, *args)

    def _run(self, listener: socket.socket, started: queue.Queue[BaseException | None]) -> None:
        try:
            asyncio.run(self._serve(listener, lambda: started.put(None)))
        except BaseException as failure:
            started.put(failure)
            raise

    async def _serve(self, listener: socket.socket, on_started: Callable[[], None]) -> None:
        self._loop = asyncio.get_running_loop()
        self._closing = asyncio.Event()
        limiter = ConnectionLimiter(listener)
        runner = web.AppRunner(
            self._make_application(limiter),
            access_log=None,
            handle_signals=False,
            shutdown_timeout=1.0,
            keepalive_timeout=_KEEPALIVE_TIMEOUT,
            logger=_make_logger(),
        )
        await runner.setup()
        assert runner.server is not None
        tasks = [asyncio.create_task(job) for job in (limiter.accept(runner.server), self._watch(limiter))]
        on_started()
        await self._closing.wait()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        listener.close()
        await self._broadcast.close_all()
        await runner.cleanup()

    def _make_application(self, limiter: ConnectionLimiter) -> web.Application:
        """Returns the application with all routes, behind the access check."""
        middlewares = [self._access.check_request, limiter.mark_authenticated]
        app = web.Application(middlewares=middlewares, client_max_size=4096)
        app.on_response_prepare.append(self._access.add_headers)
        self._meshcat.add_routes(app)
        app.router.add_get("/drive", self._drive, allow_head=False)
        app.router.add_get("/drives/{number:[0-9]{1,9}}", self._rows, allow_head=False)
        app.router.add_static("/cockpit/", Path(__file__).parent / "page")
        self.routes = tuple(app.router.routes())
        return app

    async def _rows(self, request: web.Request) -> web.StreamResponse:
        """The rows of a past drive."""
        rows = self.rows.get(int(request.match_info["number"]))
        if rows is None:
            raise web.HTTPNotFound(text="There is no such drive.")
        return web.Response(text=rows, content_type="application/json")

    async def _watch(self, limiter: ConnectionLimiter) -> None:
        """Takes the lock from a driver whose page no longer sends, and closes expired connections."""
        while True:
            await asyncio.sleep(_WATCH_PERIOD)
            limiter.close_expired()
            number = self.driver_lock.expire()
            if number is not None:
                await self._broadcast.close(number, WSCloseCode.POLICY_VIOLATION, "no heartbeat")

    async def _drive(self, request: web.Request) -> web.StreamResponse:
        """The websocket of a page."""
        if self.pages >= (1 if self._fixed else MAX_PAGES):
            raise web.HTTPServiceUnavailable(text="Too many pages are open.")
        # aiohttp closes without a reason above its own limit; between the two limits a reason is given.
        websocket = web.WebSocketResponse(
            max_msg_size=16 * MAX_BYTES, heartbeat=10.0, timeout=1.0, compress=False, autoping=False
        )
        await websocket.prepare(request)
        number = next(self._numbers)
        page = PageConnection(websocket, request.transport)
        self._broadcast.add(number, page)
        self._send_lock_state(number)
        sender = asyncio.create_task(page.send_queued())
        moves = RateLimiter(rate=_MOVE_RATE, burst=_BURST)
        others = RateLimiter(rate=_OTHER_RATE, burst=_BURST)
        try:
            async for received in websocket:
                if received.type in (WSMsgType.PING, WSMsgType.PONG):
                    await others.acquire()
                    if received.type is WSMsgType.PING:
                        await websocket.pong(received.data)
                    continue
                if received.type is not WSMsgType.TEXT:
                    await page.close(WSCloseCode.UNSUPPORTED_DATA, "a message must be text")
                    break
                if len(received.data) > MAX_BYTES:
                    await page.close(WSCloseCode.MESSAGE_TOO_BIG, f"a message may have {MAX_BYTES} bytes")
                    break
                try:
                    message = parse(received.data)
                except MessageError as error:
                    await page.close(WSCloseCode.POLICY_VIOLATION, str(error))
                    break
                self._handle(number, message)
                drives = isinstance(message, Move) and number == self.driver_lock.holder
                await (moves if drives else others).acquire()
        finally:
            del self._broadcast.pages[number]
            self.driver_lock.release(number, LOST)
            sender.cancel()
        return websocket

    def _handle(self, number: int, message: Message) -> None:
        accepted = True
        match message:
            case SetStick() | Setup() | Train() | Discard() | SetAssist() if self._fixed:
                accepted = False
            case Move():
                self.driver_lock.move(number, message)
            case Lift():
                self.driver_lock.lift(number, message)
            case Engage():
                accepted = self.driver_lock.engage(number)
            case Release():
                self.driver_lock.release(number)
            case Brake():
                self.driver_lock.brake(number, message)
            case Recentre():
                self.driver_lock.recentre(number)
            case SetStick(stick):
                accepted = self.driver_lock.set_stick(number, stick)
            case Setup() | Train() | Discard():
                accepted = self.driver_lock.request(number, message)
            case SetAssist(on):
                accepted = self.driver_lock.set_assist(number, on)
        if not accepted:
            self._send_lock_state(number, refused=True)

    def _schedule_lock_state(self) -> None:
        if not self._lock_state_scheduled:
            self._lock_state_scheduled = True
            asyncio.get_running_loop().call_later(_COALESCE, self._send_lock_states)

    def _send_lock_states(self) -> None:
        self._lock_state_scheduled = False
        for number in self._broadcast.pages:
            self._send_lock_state(number)

    def _send_lock_state(self, number: int, *, refused: bool = False) -> None:
        """Sends a page the state of the lock as it concerns this page, and the settings in force."""
        lock = self.driver_lock
        if not lock.enabled:
            state = "none"
        elif lock.holder is None:
            state = "free"
        else:
            state = "yours" if lock.holder == number else "taken"
        stick = lock.latest().stick
        settings = {
            "type": "settings",
            "gain": stick.gain,
            "dead_zone": stick.dead_zone,
            "return_time": stick.return_time,
            "assist": lock.assist,
        }
        page = self._broadcast.pages[number]
        seat = {"type": "seat", "state": state, "refused": refused, "paused": lock.paused}
        page.send_soon("seat", json.dumps(seat))
        page.send_soon("settings", json.dumps(settings))


def _make_logger() -> logging.Logger:
    """Returns a logger that reports this program's failures, but not bad requests or lost connections."""
    logger = logging.getLogger("drake_shared.cockpit")
    logger.addFilter(_is_own_failure)
    return logger


def _is_own_failure(record: logging.LogRecord) -> bool:
    return not (record.exc_info and isinstance(record.exc_info[1], HttpProcessingError | ConnectionError))
