"""Drives the page in a real browser for a long time."""

from __future__ import annotations

import random
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from served import MemoryWatch, Served, read_pace

from drake_shared.cockpit.chromium import CHROMIUM_ARGUMENTS, find_chromium

DRIFT = 0.01
"""Relative difference allowed between wall-clock time and simulated time."""
GROWTH = 10.0
"""Growth of the program's memory allowed after the warm-up, in [MB]."""
PAGE_GROWTH = 20.0
"""Growth of the page's own memory allowed after the warm-up, in [MB]."""

_WARM_UP_TRIALS = 2  # The first log loads what writes logs.
_TIMEOUT = 30_000  # ms


def run(minutes: float, scenario: str | None = None) -> dict[str, Any]:
    """Drives one trial after another for ``minutes``, and returns the measurements.

    Args:
        minutes: Duration.
        scenario: As for ``drake-shared drive``.

    Raises:
        SystemExit: There is no browser.
    """
    from playwright.sync_api import sync_playwright

    path = find_chromium()
    if path is None:
        raise SystemExit("no Chromium found; name one in DRAKE_SHARED_CHROMIUM")
    seconds = 60.0 * minutes
    with tempfile.TemporaryDirectory() as logs:
        options = [] if scenario is None else ["--scenario", scenario]
        served = Served(Path(logs), *options)
        try:
            with sync_playwright() as playwright, MemoryWatch(served, every=1.0) as memory:
                browser = playwright.chromium.launch(executable_path=path, args=list(CHROMIUM_ARGUMENTS))
                page = browser.new_page(viewport={"width": 640, "height": 480})
                before, begun = served.processor_time(), time.monotonic()
                driven, warm = _drive(page, served, seconds)
                share = (served.processor_time() - before) / (time.monotonic() - begun)
                browser.close()
            pace = read_pace(served.new_logs())
        finally:
            errors = served.stop()
    driven["processor_share"] = round(share, 3)
    return _judge({"minutes": minutes, **pace, **driven, **_flatness(memory, warm)}, errors)


def _drive(page: Any, served: Served, seconds: float) -> tuple[dict[str, Any], float]:
    """Drives by arrow keys: forward all the time, sideways at random; stops some trials early.

    Returns:
        What happened, and the time at which the warm-up was over.
    """
    chance = random.Random(0)
    page_errors: list[str] = []
    page.on("pageerror", lambda error: page_errors.append(str(error)))
    page.set_default_timeout(_TIMEOUT)
    page.goto(served.address)
    inspector = page.context.new_cdp_session(page)
    inspector.send("Performance.enable")
    heaps: list[dict[str, float]] = []
    started = 0
    end = time.monotonic() + seconds
    warm = end
    while time.monotonic() < end and served.runs:
        page.click("#drive:enabled")
        page.wait_for_selector("body[data-driver-lock=yours]")
        page.keyboard.down("ArrowUp")
        page.wait_for_selector("#deck[data-phase=driving]")
        started += 1
        gives_up = time.monotonic() + (chance.uniform(1.0, 10.0) if started % 5 == 0 else 60.0)
        while page.get_attribute("body", "data-driver-lock") == "yours":
            key = chance.choice(("ArrowLeft", "ArrowRight"))
            page.keyboard.press(key, delay=chance.uniform(20.0, 400.0))
            if time.monotonic() > min(gives_up, end):
                page.keyboard.press("Escape")
                page.wait_for_selector("body:not([data-driver-lock=yours])")
        page.keyboard.up("ArrowUp")
        page.wait_for_selector("#deck[data-phase=finished]")
        heaps.append(_page_memory(inspector))
        if started == _WARM_UP_TRIALS:
            warm = time.monotonic()
    driven = {
        "started": started,
        "page_errors": sorted(set(page_errors)),
        "page_memory": heaps,
    }
    return driven, warm


def _page_memory(inspector: Any) -> dict[str, float]:
    """Returns the memory of the page's scripts in [MB] and its number of nodes, without what is garbage."""
    inspector.send("HeapProfiler.collectGarbage")
    metrics = {item["name"]: item["value"] for item in inspector.send("Performance.getMetrics")["metrics"]}
    return {"heap": round(metrics["JSHeapUsedSize"] / 2**20, 2), "nodes": metrics["Nodes"]}


def _flatness(memory: MemoryWatch, warm: float) -> dict[str, Any]:
    """Returns memory after the warm-up in [MB]: first and last tenth, range, and trend per minute."""
    times, values = np.array(memory.times), np.array(memory.values)
    after = times >= min(warm, times[-2])
    times, values = times[after], values[after]
    tenth = max(len(values) // 10, 1)
    return {
        "memory_first": round(float(values[:tenth].mean()), 1),
        "memory_last": round(float(values[-tenth:].mean()), 1),
        "memory_range": round(float(np.ptp(values)), 1),
        "memory_trend": round(60.0 * float(np.polyfit(times, values, 1)[0]), 3),
    }


def _judge(report: dict[str, Any], errors: list[str]) -> dict[str, Any]:
    drift = report["wall"] / report["simulated"] - 1.0 if report["simulated"] else float("nan")
    broken = errors + report["page_errors"]
    if not abs(drift) <= DRIFT:
        broken.append(f"real time drifted by {100 * drift:.2f}%")
    if (
        not report["memory_last"] - report["memory_first"] <= GROWTH
        or not report["memory_range"] <= 2 * GROWTH
    ):
        broken.append("memory is not flat")
    page = [sample["heap"] for sample in report["page_memory"][_WARM_UP_TRIALS - 1 :]]
    if not page or not max(page) - page[0] <= PAGE_GROWTH:
        broken.append("the page's memory is not flat")
    if report["started"] != report["trials"]:
        broken.append(f"{report['started']} trials were driven and {report['trials']} logged")
    broken += [f"a trial ended as {status}" for status in report["statuses"] if status == "page_closed"]
    return report | {"drift": round(drift, 5), "broken": broken}


def describe(report: dict[str, Any]) -> str:
    """Returns the report as lines of text."""
    return "\n".join(f"{name}: {value}" for name, value in report.items())
