"""The pages of a study: one for each participant, and one for the experimenter."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import multiprocessing
import signal
import time
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web
from markdown_it import MarkdownIt

from drake_shared.cockpit.access import Access
from drake_shared.cockpit.listening_socket import listen
from drake_shared.common.errors import DrakeSharedError, InputError
from drake_shared.common.suggestions import did_you_mean
from drake_shared.study.block import run_block
from drake_shared.study.links import EXPERIMENTER, load_links
from drake_shared.study.steps import Step, end_of_trials
from drake_shared.study.store import EXCLUDED, WITHDRAWN, StudyData

_PAGE = Path(__file__).parent / "page"
_ABSENT = 6.0
"""Time without a request, in [s], after which a link can be opened elsewhere."""
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "font-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class Visit:
    """The visit of a participant: the page and the simulation behind it.

    Attributes:
        page: Identifier of the page that has the link; another one is refused while it is present.
        seen: When it last asked, in [s].
        ping: Round-trip time that the page measured, in [s].
        paused: Whether the experimenter lets the participant wait.
        process: Of the simulation, while trials are driven.
        address: Of the page of the simulation, once it is ready.
        end: Index of the first step that is no trial of the simulation.
    """

    def __init__(self) -> None:
        self.page = ""
        self.seen = -_ABSENT
        self.ping: float | None = None
        self.paused = False
        self.process: Any = None
        self.pipe: Any = None
        self.address: str | None = None
        self.end = 0

    def take(self, page: str) -> bool:
        """Gives the link to a page, unless another one has it."""
        now = time.monotonic()
        if page != self.page and now - self.seen < _ABSENT:
            return False
        self.page, self.seen = page, now
        return True

    def stop(self) -> None:
        """Ends the simulation; its page loses the connection."""
        if self.process is not None:
            self.pipe.close()
            self.process.join(10.0)
            if self.process.is_alive():
                self.process.kill()
                self.process.join()
        self.process = self.pipe = self.address = None


class StudyServer:
    """Serves the pages of a study, and starts a process with a simulation for each participant who drives.

    Args:
        data: Of the study.
        host: Address to listen on.
        port: Port to listen on; 0 takes any free one.
        participants: Those that are served; all if empty. Further servers take others, on the same folder or
            a copy of it.
        proxy: Origin under which a proxy shows this server, such as "https://lab.example:8090". Participant n
            then drives at this origin's port plus n, which leads to this server's port plus n.
        simulated: Whether the participants are.

    Raises:
        InputError: The port is in use, a participant is unknown, ``proxy`` is not an origin, or the data
            are of the other kind of participants.
    """

    def __init__(
        self,
        data: StudyData,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        participants: Sequence[str] = (),
        proxy: str | None = None,
        simulated: bool = False,
    ) -> None:
        data.check_kind(simulated=simulated)
        for name in participants:
            if name not in data.steps:
                expected = f"must be participants of the study{did_you_mean(name, data.steps)}"
                raise InputError("study run", "--participants", expected, name)
        self._data = data
        self._proxy = Access(host=host, proxy=proxy).proxy
        self._simulated = simulated
        self._links = load_links(data)
        self._visits = {name: Visit() for name in participants or data.steps}
        self._questionnaires = data.study.load_questionnaires()
        self._markdown = MarkdownIt("commonmark", {"html": False})
        self._spawn = multiprocessing.get_context("spawn")
        self._listener = listen(host, port)
        self._host, self._port = self._listener.getsockname()[:2]

    def address_of(self, who: str) -> str:
        """The link of a participant or of the experimenter."""
        kind = "e" if who == EXPERIMENTER else "p"
        origin = self._proxy or f"http://{self._host}:{self._port}"
        return f"{origin}/{kind}/{self._links[who]}"

    @property
    def participants(self) -> list[str]:
        """Those that are served."""
        return list(self._visits)

    def _trials_at(self, name: str) -> tuple[int, str | None]:
        """Port of a participant's simulation, and its origin if a proxy shows it."""
        if self._proxy is None:
            return 0, None
        number = 1 + list(self._data.steps).index(name)
        parts = urlsplit(self._proxy)
        outside = (parts.port or {"https": 443, "http": 80}[parts.scheme]) + number
        return (
            self._port + number,
            f"{parts.scheme}://{parts.netloc.removesuffix(f':{parts.port}')}:{outside}",
        )

    async def serve(self, started: Callable[[], None] = lambda: None) -> None:
        """Serves until cancelled; then all simulations end, after what was finished is written."""
        app = web.Application(client_max_size=100_000)
        app.on_response_prepare.append(_add_headers)
        app.router.add_get("/p/{link}", functools.partial(self._file, "participant.html"))
        app.router.add_get("/e/{link}", functools.partial(self._file, "experimenter.html"))
        app.router.add_post("/p/{link}/step", self._step)
        app.router.add_post("/e/{link}/state", self._state)
        app.router.add_get("/ping", self._ping)
        app.router.add_get("/page/{name}", self._asset)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
        await runner.setup()
        try:
            await web.SockSite(runner, self._listener).start()
            started()
            await asyncio.Event().wait()
        finally:
            await runner.cleanup()
            for visit in self._visits.values():
                await asyncio.to_thread(visit.stop)

    async def _file(self, name: str, request: web.Request) -> web.StreamResponse:
        self._who(request)
        return web.FileResponse(_PAGE / name)

    async def _asset(self, request: web.Request) -> web.StreamResponse:
        name = request.match_info["name"]
        path = _PAGE / name
        if path.suffix in (".js", ".css") and path.is_file():
            return web.FileResponse(path)
        compressed = _PAGE / "vendor" / f"{name}.gz"
        if not compressed.is_file():
            raise web.HTTPNotFound
        kind = "text/css" if path.suffix == ".css" else "text/javascript"
        return web.Response(
            body=compressed.read_bytes(), content_type=kind, headers={"Content-Encoding": "gzip"}
        )

    async def _ping(self, request: web.Request) -> web.StreamResponse:
        return web.Response(text="")

    def _who(self, request: web.Request) -> str:
        """The participant, or the experimenter, of a link."""
        link = request.match_info["link"]
        wanted = request.path.startswith("/e/")
        for name in (EXPERIMENTER,) if wanted else self._visits:
            if self._links[name] == link:
                return name
        raise web.HTTPNotFound(text="This link is not of this study, or another server has its participant.")

    async def _step(self, request: web.Request) -> web.StreamResponse:
        """Takes the answers of a step, if there are any, and returns what to do next."""
        name = self._who(request)
        given = await _json(request)
        visit = self._visits[name]
        if not visit.take(str(given.get("page"))):
            return web.json_response({"do": "refused", "text": "This link is open in another window."})
        if isinstance(given.get("ping"), int | float):
            visit.ping = float(given["ping"])
        error = None
        try:
            if given.get("withdraw") is True:
                self._data.end(name, WITHDRAWN, "on the page", simulated=self._simulated)
            elif given.get("step") is not None:
                self._complete(name, given["step"], given.get("answers"))
        except DrakeSharedError as failure:
            error = str(failure)
        return web.json_response({**self._next(name, visit), "error": error})

    def _complete(self, name: str, step: Any, answers: Any) -> None:
        following = self._data.next_step(name)
        # A page that was reloaded, or whose answer was lost, may send a step again.
        if following is None or following.name != step or following.kind == "trial":
            return
        given = answers if isinstance(answers, dict) else {}
        if following.questionnaire is not None:
            given = self._questionnaires[following.questionnaire].check(given)
        self._data.write_answers(following, given, simulated=self._simulated)

    def _next(self, name: str, visit: Visit) -> dict[str, Any]:
        """What the participant's page does."""
        ended, step = self._data.ended(name), self._data.next_step(name)
        if step is not None and step.kind == "thanks":
            self._data.write_answers(step, {}, simulated=self._simulated)
            step = None
        if ended is not None or step is None:
            visit.stop()
            return {"do": "text", "step": None, "html": self._text("thanks")}
        if visit.ping is None:
            return {"do": "ping"}
        if visit.ping > self._data.study.most_ping:
            most = 1000 * self._data.study.most_ping
            text = f"This computer answers after {1000 * visit.ping:.0f} ms, and may take {most:.0f} ms."
            return {"do": "refused", "text": f"{text} Please tell the experimenter."}
        if visit.paused:
            return {"do": "wait", "text": "Please wait for the experimenter."}
        total = len(self._data.steps[name])
        shown = {"step": step.name, "progress": step.index / total}
        if step.kind == "trial":
            return shown | self._trial(name, step, visit)
        if step.questionnaire is not None:
            form = self._questionnaires[step.questionnaire].form
            return shown | {"do": "questionnaire", "form": form}
        return shown | {"do": "text", "html": self._text(step.kind), "consent": step.kind == "consent"}

    def _trial(self, name: str, step: Step, visit: Visit) -> dict[str, Any]:
        """The address of the participant's simulation, which is started if it does not run."""
        if visit.process is not None and not visit.process.is_alive():
            visit.stop()
        if visit.process is not None and step.index >= visit.end:
            # The simulation of the trials before is about to end.
            return {"do": "wait", "text": "The next trials are being prepared…"}
        if visit.process is None:
            visit.end = end_of_trials(self._data.steps[name], step)
            ours, theirs = self._spawn.Pipe()
            port, proxy = self._trials_at(name)
            visit.pipe = ours
            visit.process = self._spawn.Process(
                target=run_block,
                args=(str(self._data.folder), name),
                kwargs={
                    "host": self._host,
                    "port": port,
                    "proxy": proxy,
                    "simulated": self._simulated,
                    "ping": visit.ping,
                    "back": self.address_of(name),
                    "pipe": theirs,
                },
                daemon=True,
            )
            visit.process.start()
            theirs.close()
        with contextlib.suppress(EOFError):
            if visit.address is None and visit.pipe.poll():
                visit.address = visit.pipe.recv()
        if visit.address is None:
            return {"do": "wait", "text": "The next trials are being prepared…"}
        return {"do": "drive", "address": visit.address}

    def _text(self, name: str) -> str:
        return str(self._markdown.render(getattr(self._data.study.texts, name)))

    async def _state(self, request: web.Request) -> web.StreamResponse:
        """Does what the experimenter asks for, and returns where every participant is."""
        self._who(request)
        given = await _json(request)
        name, text = str(given.get("participant")), str(given.get("text") or "").strip()
        error = None
        if name in self._visits:
            try:
                match given.get("do"):
                    case "note" if text:
                        self._data.note(name, text, simulated=self._simulated)
                    case "exclude" if text:
                        self._data.end(name, EXCLUDED, text, simulated=self._simulated)
                        await asyncio.to_thread(self._visits[name].stop)
                    case "pause":
                        self._visits[name].paused = True
                    case "next":
                        self._visits[name].paused = False
            except DrakeSharedError as failure:
                error = str(failure)
        return web.json_response(
            {"participants": [self._describe(who) for who in self._visits], "error": error}
        )

    def _describe(self, name: str) -> dict[str, Any]:
        visit, step, ended = self._visits[name], self._data.next_step(name), self._data.ended(name)
        present = time.monotonic() - visit.seen < _ABSENT or (
            visit.process is not None and bool(visit.process.is_alive())
        )
        return {
            "participant": name,
            "link": self.address_of(name),
            "completed": len(self._data.completed(name)),
            "steps": len(self._data.steps[name]),
            "where": "finished" if step is None else step.name,
            "ended": None if ended is None else f"{ended['kind']}: {ended['reason']}",
            "present": present,
            "paused": visit.paused,
            "ping": visit.ping,
            "notes": self._data.notes(name),
        }


async def _add_headers(request: web.Request, response: web.StreamResponse) -> None:
    response.headers["Content-Security-Policy"] = _POLICY
    await Access.add_headers(request, response)


async def _json(request: web.Request) -> dict[str, Any]:
    """The JSON object of a request; only this server's pages can send that content type."""
    if request.content_type != "application/json":
        raise web.HTTPUnsupportedMediaType
    try:
        given = await request.json()
    except ValueError as error:
        raise web.HTTPBadRequest from error
    if not isinstance(given, dict):
        raise web.HTTPBadRequest
    return given


def run_study(
    server: StudyServer,
    announce: Callable[[StudyServer], None],
    visitors: Callable[[], Coroutine[Any, Any, None]] | None = None,
) -> None:
    """Serves the pages of a study until SIGINT or SIGTERM, or until its visitors are done.

    Args:
        server: Of the study.
        announce: Called when the server answers.
        visitors: What visits the pages then; None: only people do.
    """

    async def run() -> None:
        loop, task, started = asyncio.get_running_loop(), asyncio.current_task(), asyncio.Event()
        assert task is not None
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, task.cancel)

        async def visit() -> None:
            await started.wait()
            announce(server)
            await (asyncio.Event().wait() if visitors is None else visitors())

        tasks = [asyncio.create_task(server.serve(started.set)), asyncio.create_task(visit())]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for ended in done:
                ended.result()
        finally:
            for each in tasks:
                each.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    with contextlib.suppress(asyncio.CancelledError):
        asyncio.run(run())
