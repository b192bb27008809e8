"""Finds and configures a headless Chromium, for tests of the page."""

from __future__ import annotations

import os
import shutil

CHROMIUM_ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
"""Arguments for a Chromium without screen, graphics card and background traffic, that also runs as root."""


def find_chromium() -> str | None:
    """Returns the path of a Chromium: $DRAKE_SHARED_CHROMIUM, which may be empty for none, or from $PATH."""
    path = os.environ.get("DRAKE_SHARED_CHROMIUM")
    if path is not None:
        return path or None
    names = ("chromium", "chromium-browser", "google-chrome")
    return next(filter(None, map(shutil.which, names)), None)
