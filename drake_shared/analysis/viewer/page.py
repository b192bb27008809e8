"""The page of the log viewer: stand-alone, or served on this computer."""

from __future__ import annotations

import http.server
import json
import secrets
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from drake_shared.analysis.viewer.catalogue import Catalogue
from drake_shared.analysis.viewer.details import details
from drake_shared.common.errors import DrakeSharedError
from drake_shared.common.files import replacing
from drake_shared.common.html import script_safe

MOST_EMBEDDED = 500
"""Trials whose curves a stand-alone page holds; of the others it has the row in the table."""

_PAGE = Path(__file__).parent / "page"


def write_page(catalogue: Catalogue, out: Path, *, progress: Callable[[int], None] = lambda _: None) -> int:
    """Writes a stand-alone page.

    Args:
        catalogue: Is read to its end.
        out: HTML file to write.
        progress: Called with the number of trials embedded so far.

    Returns:
        The number of trials whose curves the page holds, at most `MOST_EMBEDDED`.

    Raises:
        InputError, RunError: The file cannot be written.
    """
    rows = [entry.to_json() for entry in catalogue.read()]
    embedded: dict[int, Any] = {}
    for index in range(min(len(rows), MOST_EMBEDDED)):
        embedded[index] = _try_details(catalogue, index)
        progress(len(embedded))
    data = {"rows": rows, "skipped": catalogue.skipped, "details": embedded}
    with replacing(out) as temporary:
        temporary.write_text(_html(data), encoding="utf-8")
    return len(embedded)


class Viewer:
    """Serves the page on this computer, reading trials when they are opened.

    The address holds a random key, without which nothing is served.

    Args:
        catalogue: Is read in a thread while the page already shows what was found.
        port: Port on 127.0.0.1; 0 takes any free one.
    """

    def __init__(self, catalogue: Catalogue, *, port: int = 0) -> None:
        self._catalogue = catalogue
        self._key = secrets.token_urlsafe(18)
        self._complete = False
        viewer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                viewer.answer(self)

            def log_message(self, *_: Any) -> None:
                """Does not print requests."""

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._server.daemon_threads = True

    @property
    def address(self) -> str:
        """The address to open, key included."""
        return f"http://127.0.0.1:{self._server.server_address[1]}/{self._key}/"

    def serve(self) -> None:
        """Serves until :meth:`stop` is called or an exception, such as that of Ctrl-C, ends it."""
        threading.Thread(target=self._read, name="catalogue", daemon=True).start()
        try:
            self._server.serve_forever(poll_interval=0.1)
        finally:
            self._server.server_close()

    def stop(self) -> None:
        """Ends :meth:`serve`, which runs in another thread."""
        self._server.shutdown()

    def answer(self, request: http.server.BaseHTTPRequestHandler) -> None:
        """Answers one request."""
        parts = urlsplit(request.path)
        key, _, name = parts.path.removeprefix("/").partition("/")
        query = parse_qs(parts.query)
        if not secrets.compare_digest(key.encode(), self._key.encode()):
            self._send(request, 403, "text/plain", b"Open the address that drake-shared printed.")
        elif name == "":
            self._send(request, 200, "text/html", _html(None).encode())
        elif name == "rows":
            self._send_json(request, self._rows(_number(query, "from")))
        elif name == "details" and _number(query, "id") < len(self._catalogue.entries):
            self._send_json(request, _try_details(self._catalogue, _number(query, "id")))
        else:
            self._send(request, 404, "text/plain", b"There is no such page.")

    def _read(self) -> None:
        for _ in self._catalogue.read():
            pass
        self._complete = True

    def _rows(self, first: int) -> dict[str, Any]:
        complete = self._complete  # Before the rows are taken: what is added afterwards comes next time.
        found = self._catalogue.entries[first : first + 2000]
        done = complete and first + len(found) >= len(self._catalogue.entries)
        return {
            "rows": [entry.to_json() for entry in found],
            "files": self._catalogue.files,
            "complete": done,
            "skipped": dict(self._catalogue.skipped) if done else {},
        }

    def _send_json(self, request: http.server.BaseHTTPRequestHandler, value: Any) -> None:
        text = json.dumps(value, allow_nan=False).encode()
        self._send(request, 200, "application/json", text)

    @staticmethod
    def _send(request: http.server.BaseHTTPRequestHandler, status: int, kind: str, body: bytes) -> None:
        request.send_response(status)
        request.send_header("Content-Type", f"{kind}; charset=utf-8")
        request.send_header("Content-Length", str(len(body)))
        request.send_header("Cache-Control", "no-store")
        request.send_header("X-Frame-Options", "DENY")
        request.send_header("Referrer-Policy", "no-referrer")
        request.end_headers()
        request.wfile.write(body)


def _try_details(catalogue: Catalogue, index: int) -> dict[str, Any]:
    try:
        return details(catalogue.entries[index])
    except DrakeSharedError as error:
        return {"error": str(error)}


def _number(query: dict[str, list[str]], name: str) -> int:
    text = query.get(name, ["0"])[0]
    return int(text) if text.isascii() and text.isdigit() else 0


def _html(data: Any) -> str:
    """The page with its style, its script and, if it stands alone, its data."""
    text = (_PAGE / "viewer.html").read_text(encoding="utf-8")
    parts = {name: (_PAGE / f"viewer.{name}").read_text(encoding="utf-8") for name in ("css", "js")}
    # A name of a file must not end the script.
    parts["data"] = script_safe(json.dumps(data, allow_nan=False))
    for name, part in parts.items():
        text = text.replace(f"/*{name}*/", part)
    return text
