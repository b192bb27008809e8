"""The page in Firefox, without WebGL, which it lacks when it has no screen: driving and layout.

It is driven by WebDriver BiDi, which Firefox speaks itself; Playwright needs a Firefox of its own. With WebGL
Firefox is left out here, since that needs a screen; Chromium's tests have both.
"""

import asyncio
import contextlib
import itertools
import json
import os
import re
import shutil
import subprocess
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

pytestmark = pytest.mark.browser

FAULTS = (Path(__file__).parent / "layout_faults.js").read_text(encoding="utf-8")
SIZES = [(1280, 800), (800, 600), (390, 844), (640, 400)]
PATIENCE = 30.0
KEYS = {"ArrowUp": "\ue013", "Escape": "\ue00c"}


def find_firefox() -> str | None:
    """Returns the path of a Firefox: $DRAKE_SHARED_FIREFOX, which may be empty for none, or from $PATH."""
    path = os.environ.get("DRAKE_SHARED_FIREFOX")
    if path is not None:
        return path or None
    return shutil.which("firefox-esr") or shutil.which("firefox")


class Firefox:
    """One tab of a headless Firefox."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)
        self._tab = ""

    async def open(self, address: str) -> None:
        tree = await self._command("browsingContext.getTree")
        self._tab = tree["contexts"][0]["context"]
        await self._command("browsingContext.navigate", context=self._tab, url=address, wait="complete")

    async def resize(self, width: int, height: int) -> None:
        size = {"width": width, "height": height}
        await self._command("browsingContext.setViewport", context=self._tab, viewport=size)
        await self.wait_for(f"innerWidth === {width} && innerHeight === {height}")

    async def evaluate(self, expression: str) -> Any:
        """Returns the value of an expression, which JSON must be able to hold."""
        answer = await self._command(
            "script.evaluate",
            expression=f"JSON.stringify({expression})",
            target={"context": self._tab},
            awaitPromise=True,
        )
        if answer["type"] != "success":
            raise AssertionError(answer["exceptionDetails"]["text"])
        return json.loads(answer["result"].get("value", "null"))

    async def wait_for(self, expression: str) -> None:
        async with asyncio.timeout(PATIENCE):
            while not await self.evaluate(f"Boolean({expression})"):
                await asyncio.sleep(0.02)

    async def move(self, *points: tuple[float, float], click: bool = False) -> None:
        """Moves the mouse to each of the points, in pixels, and clicks at the last one."""
        actions: list[dict] = [
            {"type": "pointerMove", "x": round(x), "y": round(y), "duration": 20} for x, y in points
        ]
        if click:
            actions += [{"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        await self._act({"type": "pointer", "id": "mouse", "actions": actions})

    async def key(self, kind: str, name: str) -> None:
        """Presses ("keyDown") or releases ("keyUp") a key."""
        await self._act({"type": "key", "id": "keys", "actions": [{"type": kind, "value": KEYS[name]}]})

    async def middle_of(self, selector: str) -> tuple[float, float]:
        box = f"document.querySelector({selector!r}).getBoundingClientRect()"
        x, y = await self.evaluate(f"(({{ x, y, width, height }}) => [x + width / 2, y + height / 2])({box})")
        return x, y

    async def _act(self, source: dict) -> None:
        await self._command("input.performActions", context=self._tab, actions=[source])

    async def _command(self, method: str, **parameters: Any) -> dict:
        number = next(self._numbers)
        await self._socket.send_json({"id": number, "method": method, "params": parameters})
        async with asyncio.timeout(PATIENCE):
            while True:
                answer = await self._socket.receive_json()
                if answer.get("id") == number:
                    break
        if answer["type"] == "error":
            raise AssertionError(f"{method}: {answer['message']}")
        return answer["result"]

    async def start(self) -> None:
        await self._command("session.new", capabilities={})


@contextlib.asynccontextmanager
async def run_firefox(path: str, folder: Path) -> AsyncIterator[Firefox]:
    """Runs Firefox with a profile in ``folder``."""
    environment = {**os.environ, "HOME": str(folder), "MOZ_HEADLESS": "1"}
    command = [path, "--headless", "--no-remote", "--profile", str(folder), "--remote-debugging-port", "0"]
    process = await asyncio.create_subprocess_exec(
        *command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    try:
        assert process.stderr is not None
        async with asyncio.timeout(2 * PATIENCE):
            while not (
                found := re.search(rb"listening on (ws://\S+)", line := await process.stderr.readline())
            ):
                assert line, "Firefox ended"
        reading = asyncio.create_task(process.stderr.read())
        async with (
            aiohttp.ClientSession() as http,
            http.ws_connect(f"{found[1].decode()}/session", max_msg_size=0) as socket,
        ):
            firefox = Firefox(socket)
            await firefox.start()
            yield firefox
        reading.cancel()
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()


@pytest.fixture
def in_firefox(tmp_path):
    """Runs a coroutine with a Firefox."""
    path = find_firefox()
    if path is None:
        pytest.skip("no Firefox: install it or set DRAKE_SHARED_FIREFOX")

    def run(talk):
        async def main():
            async with run_firefox(path, tmp_path) as firefox:
                await talk(firefox)

        asyncio.run(main())

    return run


def test_mouse_and_keys_drive_and_nothing_is_cut_off(in_firefox, cockpit):
    async def engage(firefox):
        await firefox.wait_for("document.querySelector('#drive:enabled')")
        middle = await firefox.middle_of("#drive")
        await firefox.move(middle, click=True)
        await firefox.wait_for("document.querySelector('body[data-driver-lock=yours]')")
        return middle

    async def talk(firefox):
        await firefox.open(cockpit.address)
        await firefox.wait_for(
            "document.querySelector('#deck[data-phase=ready], #deck[data-phase=finished]')"
        )
        await firefox.evaluate("document.querySelector('#intro-skip').click()")
        for width, height in SIZES:
            await firefox.resize(width, height)
            assert await firefox.evaluate(f"({FAULTS})()") == [], (width, height)
        await firefox.resize(800, 600)
        x, y = await engage(firefox)
        await firefox.move(*((x, y - 12 * step) for step in range(1, 21)))
        await firefox.wait_for("document.querySelector('#deck[data-phase=finished]')")
        await engage(firefox)
        await firefox.key("keyDown", "ArrowUp")
        await firefox.wait_for("document.querySelector('#deck[data-phase=driving]')")
        await firefox.wait_for("document.querySelector('#deck[data-phase=finished]')")
        await firefox.key("keyUp", "ArrowUp")
        assert await firefox.evaluate("document.querySelector('#flat-scene .robot') !== null")
        for width, height in SIZES:
            await firefox.resize(width, height)
            assert await firefox.evaluate(f"({FAULTS})()") == [], (width, height)

    in_firefox(talk)
    first, second = cockpit.trials
    assert (first.status, second.status) == ("reached", "reached")
    assert first["mouse_y"].min() < 0
    assert second["stick_forward"].max() == 1.0
