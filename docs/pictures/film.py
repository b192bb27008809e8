"""Films the page while a simulated operator drives. ``scripts/pictures page`` calls it.

Needs a Chromium: the one of Playwright, or the one that DRAKE_SHARED_CHROMIUM names.
"""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, WebSocket, sync_playwright

FILE = Path(__file__).parent / "page.webp"
SIZE, SHOWN = (1200, 760), (960, 608)
# The second trial follows the route that differs from the others from the start.
TRIAL = 1
FRAME = 0.2
"""Time between pictures, in [s]."""
# The software renderers of a machine without a GPU.
FLAGS = ["--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


def main() -> None:
    """Starts ``drake-shared drive``, waits for the trial and films it."""
    with tempfile.TemporaryDirectory() as logs:
        options = ["--operator", "surrogate", "--arbitration", "blend", "--port", "0", "--no-open"]
        options += ["--record", logs]
        program = subprocess.Popen(
            [sys.executable, "-m", "drake_shared.cli.main", "drive", *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        try:
            pictures, times = film(address(program))
        finally:
            program.terminate()
            program.wait()
    save(pictures, times)


def address(program: subprocess.Popen[str]) -> str:
    """The address that the program prints."""
    assert program.stdout is not None
    for line in program.stdout:
        found = re.search(r"http://\S+", line)
        if found:
            return found[0]
    raise RuntimeError("drake-shared drive printed no address")


def film(url: str) -> tuple[list[Image.Image], list[float]]:
    """Pictures of the page during one trial, and when each was taken, in [s]."""
    phase = {"number": -1, "phase": ""}

    def listen(socket: WebSocket) -> None:
        def receive(payload: str | bytes) -> None:
            if isinstance(payload, str):
                message = json.loads(payload)
                if message["type"] == "trial":
                    phase.update(message)

        socket.on("framereceived", receive)

    pictures: list[Image.Image] = []
    times: list[float] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=os.environ.get("DRAKE_SHARED_CHROMIUM"), args=FLAGS
        )
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
        # The introduction of the first visit would lie above the scene.
        page.add_init_script("localStorage.setItem('drake-shared-introduced', 'yes')")
        page.on("websocket", listen)
        page.goto(url)
        while (phase["number"], phase["phase"]) != (TRIAL, "driving"):
            page.wait_for_timeout(10)
        while phase["phase"] == "driving":
            shoot(page, pictures, times)
        page.wait_for_timeout(300)
        shoot(page, pictures, times)
        browser.close()
    return pictures, times


def shoot(page: Page, pictures: list[Image.Image], times: list[float]) -> None:
    """Adds one picture, a frame after the last one."""
    if times:
        page.wait_for_timeout(max(0.0, 1e3 * (times[-1] + FRAME - time.monotonic())))
    times.append(time.monotonic())
    picture = Image.open(io.BytesIO(page.screenshot(type="png"))).convert("RGB")
    pictures.append(picture.resize(SHOWN, Image.Resampling.LANCZOS))


def save(pictures: list[Image.Image], times: list[float]) -> None:
    """Writes the animation, in real time, and its last picture for 3 s."""
    ends = [*times[1:], times[-1] + 3.0]
    shown = [round(1e3 * (end - begin)) for begin, end in zip(times, ends, strict=True)]
    pictures[0].save(
        FILE, save_all=True, append_images=pictures[1:], duration=shown, loop=0, quality=70, method=6
    )
    print(f"wrote {FILE.name}: {len(pictures)} pictures, {FILE.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
