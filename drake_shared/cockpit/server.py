"""The web server of the page, in a thread of its own beside the simulation."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import logging
import queue
import socket
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web
from aiohttp.http_exceptions import HttpProcessingError

from drake_shared.cockpit.access import Access, is_loopback
from drake_shared.cockpit.broadcast import Audience, Page
from drake_shared.cockpit.connection_limits import Door
from drake_shared.cockpit.driver_lock import LET_GO, LOST, DriverLock
from drake_shared.cockpit.listening_socket import listen
from drake_shared.cockpit.meshcat_proxy import MeshcatProxy
from drake_shared.cockpit.messages import (
    MAX_BYTES,
    BadMessage,
    Engage,
    Message,
    Move,
    Release,
    SetAssist,
    SetStick,
    parse,
)
from drake_shared.cockpit.rate_limiter import Allowance

DEFAULT_PORT = 8080
MAX_PAGES = 32
_WATCH_PERIOD = 0.05
# Changes of the seat within this time, in [s], are told to the pages at once.
_GATHER = 0.01
# Messages a second: the quickest mouse makes 8,000 moves, and whoever does not drive has little to say.
_MOVES, _OTHERS = 10_000.0, 100.0
_AT_ONCE = 200
_IDLE_AFTER = 15.0


class CockpitServer:
    """Serves Meshcat's page with the cockpit on it, and speaks with the pages.

    It runs between ``start`` and ``stop``, or as a context manager. ``publish`` and ``pages`` may be used
    from any thread and never wait.

    Args:
        meshcat_url: Of Drake's Meshcat, as its ``web_url()`` says.
        seat: The driver's seat.
        host: Address to listen on.
        port: Port to listen on; 0 for any that is free.
        token: What opens the page; made at random if None.
    """

    def __init__(
        self,
        *,
        meshcat_url: str,
        seat: DriverLock,
        host: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        token: str | None = None,
    ) -> None:
        self.seat = seat
        self.host = host
        self.port = port
        self._access = Access(host=host, token=token)
        self._meshcat = MeshcatProxy(meshcat_url)
        self._audience = Audience()
        self.routes: tuple[web.AbstractRoute, ...] = ()
        """Everything that can be asked for, once it is served."""
        self._numbers = itertools.count(1)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._closing: asyncio.Event | None = None
        self._to_be_told = False

    @property
    def address(self) -> str:
        """What to open in a browser, key included."""
        shown = "localhost" if is_loopback(self.host) else self.host
        if shown in ("0.0.0.0", "::", ""):
            shown = socket.gethostname()
        return f"http://{shown}:{self.port}/?k={self._access.token}"

    @property
    def pages(self) -> int:
        """How many pages are connected."""
        return len(self._audience)

    def start(self) -> None:
        """Listens, and returns as soon as pages are served.

        Raises:
            InputError: The port is in use, or the address is not one of this computer.
        """
        listener = listen(self.host, self.port)
        self.port = listener.getsockname()[1]
        started: queue.Queue[BaseException | None] = queue.Queue()
        self._thread = threading.Thread(
            target=self._run, args=(listener, started), name="cockpit", daemon=True
        )
        self._thread.start()
        failure = started.get()
        if failure is not None:
            self._thread.join()
            raise failure
        self.seat.listen(lambda: self._in_loop(self._tell_seat_soon))

    def stop(self) -> None:
        """Closes every page's connection and ends the thread."""
        if self._thread is not None and self._closing is not None:
            self._in_loop(self._closing.set)
            self._thread.join()
            self._thread = None

    def __enter__(self) -> CockpitServer:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def publish(self, topic: str, content: Mapping[str, Any]) -> None:
        """Sends the pages what is now true of ``topic``, as JSON; a slow page gets the newest only.

        A page that connects later is told the last of every topic.
        """
        text = json.dumps({"type": topic, **content}, allow_nan=False)
        self._in_loop(self._audience.tell, topic, text)

    def _in_loop(self, function, *args: Any) -> None:
        if self._loop is not None and not self._loop.is_closed():
            with contextlib.suppress(RuntimeError):  # Closed this very moment: nobody is left to be told.
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
        door = Door(listener)
        app = self._make_application(door)
        runner = web.AppRunner(
            app,
            access_log=None,
            handle_signals=False,
            shutdown_timeout=1.0,
            keepalive_timeout=_IDLE_AFTER,
            logger=_quiet_logger(),
        )
        await runner.setup()
        assert runner.server is not None
        tasks = [asyncio.create_task(job) for job in (door.keep(runner.server), self._watch(door))]
        on_started()
        await self._closing.wait()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        listener.close()
        await self._audience.close_all()
        await runner.cleanup()

    def _make_application(self, door: Door) -> web.Application:
        """Everything that is served, behind the guard."""
        app = web.Application(middlewares=[self._access.guard, door.admit], client_max_size=4096)
        app.on_response_prepare.append(self._access.add_headers)
        self._meshcat.add_routes(app)
        app.router.add_get("/drive", self._drive, allow_head=False)
        app.router.add_static("/cockpit/", Path(__file__).parent / "page")
        self.routes = tuple(app.router.routes())
        return app

    async def _watch(self, door: Door) -> None:
        """Takes the seat from a driver whose page has fallen silent, and sees strangers off."""
        while True:
            await asyncio.sleep(_WATCH_PERIOD)
            door.sweep()
            number = self.seat.expire()
            if number is not None:
                await self._audience.close(number, WSCloseCode.POLICY_VIOLATION, "no sign of life")

    async def _drive(self, request: web.Request) -> web.StreamResponse:
        if len(self._audience) >= MAX_PAGES:
            raise web.HTTPServiceUnavailable(text="Too many pages are open.")
        # The library closes what is beyond its own limit without a word; below that we say why.
        connection = web.WebSocketResponse(
            max_msg_size=16 * MAX_BYTES, heartbeat=10.0, timeout=1.0, compress=False, autoping=False
        )
        await connection.prepare(request)
        number = next(self._numbers)
        page = Page(connection, request.transport)
        self._audience.add(number, page)
        self._tell_seat(number)
        writer = asyncio.create_task(page.write())
        moves = Allowance(rate=_MOVES, burst=_AT_ONCE)
        others = Allowance(rate=_OTHERS, burst=_AT_ONCE)
        try:
            async for message in connection:
                if message.type in (WSMsgType.PING, WSMsgType.PONG):
                    await others.take()
                    if message.type is WSMsgType.PING:
                        await connection.pong(message.data)
                    continue
                if message.type is not WSMsgType.TEXT:
                    await page.close(WSCloseCode.UNSUPPORTED_DATA, "a message must be text")
                    break
                if len(message.data) > MAX_BYTES:
                    await page.close(WSCloseCode.MESSAGE_TOO_BIG, f"a message may have {MAX_BYTES} bytes")
                    break
                try:
                    said = parse(message.data)
                except BadMessage as error:
                    await page.close(WSCloseCode.POLICY_VIOLATION, str(error))
                    break
                self._take(number, said)
                drives = isinstance(said, Move) and number == self.seat.holder
                await (moves if drives else others).take()
        finally:
            self._audience.remove(number)
            self.seat.leave(number, LOST)
            writer.cancel()
        return connection

    def _take(self, number: int, message: Message) -> None:
        entitled = True
        match message:
            case Move():
                self.seat.move(number, message)
            case Engage():
                entitled = self.seat.engage(number)
            case Release():
                self.seat.leave(number, LET_GO)
            case SetStick(stick):
                entitled = self.seat.set_stick(number, stick)
            case SetAssist(on):
                entitled = self.seat.set_assist(number, on)
        if not entitled:
            self._tell_seat(number, refused=True)

    def _tell_seat_soon(self) -> None:
        if not self._to_be_told:
            self._to_be_told = True
            asyncio.get_running_loop().call_later(_GATHER, self._tell_seat)

    def _tell_seat(self, only: int | None = None, *, refused: bool = False) -> None:
        """Tells a page, or each, whether the seat is its own, taken or free, and the settings in force."""
        self._to_be_told = self._to_be_told and only is not None
        stick = self.seat.latest().stick
        settings = {
            "type": "settings",
            "gain": stick.gain,
            "dead_zone": stick.dead_zone,
            "return_time": stick.return_time,
            "assist": self.seat.assist,
        }
        for number, page in self._audience:
            if only not in (None, number):
                continue
            state = "free" if self.seat.holder is None else "taken"
            if not self.seat.open:
                state = "none"
            elif number == self.seat.holder:
                state = "yours"
            page.tell("seat", json.dumps({"type": "seat", "state": state, "refused": refused}))
            page.tell("settings", json.dumps(settings))


def _quiet_logger() -> logging.Logger:
    """One that reports our own failures, but not what others say or break off."""
    logger = logging.getLogger("drake_shared.cockpit")
    logger.addFilter(_is_ours)
    return logger


def _is_ours(record: logging.LogRecord) -> bool:
    return not (record.exc_info and isinstance(record.exc_info[1], HttpProcessingError | ConnectionError))
