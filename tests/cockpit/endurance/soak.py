"""A live page in a real browser with a scripted driver at it, for a long time."""

from __future__ import annotations

import random
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from served import MemoryWatch, Served, read_pace

from drake_shared.cockpit.latency import CHROMIUM_ARGUMENTS, find_chromium

DRIFT = 0.01
"""Share by which the time on the wall may differ from that of the trials."""
GROWTH = 10.0
"""Memory in [MB] that may come on top, once the program is warm."""

_WARM = 0.2  # of the time, but no longer than
_WARM_AT_MOST = 120.0  # s
_PATIENCE = 30_000  # ms


def run(minutes: float) -> dict[str, Any]:
    """Drives trial after trial for so many minutes, and measures.

    Raises:
        SystemExit: There is no browser.
    """
    from playwright.sync_api import sync_playwright

    path = find_chromium()
    if path is None:
        raise SystemExit("no Chromium found; name one in DRAKE_SHARED_CHROMIUM")
    seconds = 60.0 * minutes
    with tempfile.TemporaryDirectory() as logs:
        served = Served(Path(logs))
        try:
            with sync_playwright() as playwright, MemoryWatch(served, every=1.0) as memory:
                browser = playwright.chromium.launch(executable_path=path, args=list(CHROMIUM_ARGUMENTS))
                driven = _drive(browser.new_page(viewport={"width": 640, "height": 480}), served, seconds)
                browser.close()
            pace = read_pace(served.new_logs())
        finally:
            errors = served.stop()
    return _judge({"minutes": minutes, **pace, **driven, **_flatness(memory, seconds)}, errors)


def _drive(page: Any, served: Served, seconds: float) -> dict[str, Any]:
    """By arrow keys: up all the time, and to the sides by chance; now and then the driver gives up."""
    chance = random.Random(0)
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.set_default_timeout(_PATIENCE)
    page.goto(served.address)
    heaps: list[float] = []
    started = 0
    end = time.monotonic() + seconds
    while time.monotonic() < end and served.runs:
        page.click("#drive:enabled")
        page.wait_for_selector("body[data-seat=yours]")
        page.keyboard.down("ArrowUp")
        page.wait_for_selector("#deck[data-phase=driving]")
        started += 1
        gives_up = time.monotonic() + (chance.uniform(1.0, 10.0) if started % 5 == 0 else 60.0)
        while page.get_attribute("body", "data-seat") == "yours":
            key = chance.choice(("ArrowLeft", "ArrowRight"))
            page.keyboard.press(key, delay=chance.uniform(20.0, 400.0))
            if time.monotonic() > min(gives_up, end):
                page.keyboard.press("Escape")
                page.wait_for_selector("body:not([data-seat=yours])")
        page.keyboard.up("ArrowUp")
        page.wait_for_selector("#deck[data-phase=finished]")
        heaps.append(page.evaluate("performance.memory.usedJSHeapSize") / 2**20)
    return {
        "started": started,
        "complaints": sorted(set(complaints)),
        "page_heap": [round(heaps[0], 1), round(heaps[-1], 1)] if heaps else None,
    }


def _flatness(memory: MemoryWatch, seconds: float) -> dict[str, Any]:
    """Memory in [MB] once warm: at first and at last (means of a tenth), its range, its trend a minute."""
    times = np.array(memory.times) - memory.times[0]
    values = np.array(memory.values)
    warm = times >= min(_WARM * seconds, _WARM_AT_MOST)
    times, values = times[warm], values[warm]
    tenth = max(len(values) // 10, 1)
    return {
        "memory_first": round(float(values[:tenth].mean()), 1),
        "memory_last": round(float(values[-tenth:].mean()), 1),
        "memory_range": round(float(np.ptp(values)), 1),
        "memory_trend": round(60.0 * float(np.polyfit(times, values, 1)[0]), 3),
    }


def _judge(report: dict[str, Any], errors: list[str]) -> dict[str, Any]:
    drift = report["wall"] / report["simulated"] - 1.0 if report["simulated"] else float("nan")
    broken = errors + report["complaints"]
    if not abs(drift) <= DRIFT:
        broken.append(f"real time drifted by {100 * drift:.2f}%")
    if (
        not report["memory_last"] - report["memory_first"] <= GROWTH
        or not report["memory_range"] <= 2 * GROWTH
    ):
        broken.append("memory is not flat")
    if report["started"] != report["trials"]:
        broken.append(f"{report['started']} trials were driven and {report['trials']} logged")
    broken += [f"a trial ended as {status}" for status in report["statuses"] if status == "page_closed"]
    return report | {"drift": round(drift, 5), "broken": broken}


def describe(report: dict[str, Any]) -> str:
    """The report as lines, for people."""
    return "\n".join(f"{name}: {value}" for name, value in report.items())
