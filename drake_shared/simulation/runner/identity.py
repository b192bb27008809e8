"""Identifies the code that computes a result: processes whose code differs must not share a run."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import platform
import reprlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from drake_shared.common.files import models_directory

_LIBRARIES = ("drake", "numpy", "scipy", "torch")
"""Libraries whose version may change the bits of a result."""


@functools.cache
def identity() -> dict[str, str]:
    """The package's version, a digest of its source and shipped models, and the versions of its libraries.

    It is computed in the first call: later changes of the files do not change the code already loaded.
    """
    return {
        "version": _version("drake_shared"),
        "source": _source(),
        "python": ".".join(platform.python_version_tuple()[:2]),
        **{name: _version(name) for name in _LIBRARIES},
    }


def first_difference(theirs: Any, ours: Any) -> str:
    """Describes in short where two JSON values first differ; empty if they are equal."""
    return next(_differences(theirs, ours, ""), "")


def _differences(theirs: Any, ours: Any, path: str) -> Iterator[str]:
    if isinstance(theirs, dict) and isinstance(ours, dict):
        for key in {**ours, **theirs}:
            yield from _differences(theirs.get(key), ours.get(key), f"{path}.{key}" if path else key)
    elif theirs != ours:
        yield f"{path or 'it'} is {reprlib.repr(theirs)}, not {reprlib.repr(ours)}"


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _source() -> str:
    package = Path(__file__).resolve().parents[2]
    models = models_directory()
    files = {f"package/{path.relative_to(package).as_posix()}": path for path in package.rglob("*.py")}
    files |= {
        f"models/{path.relative_to(models).as_posix()}": path for path in models.rglob("*") if path.is_file()
    }
    summed = hashlib.sha256()
    for name in sorted(files):
        content = files[name].read_bytes()
        summed.update(f"{name} {len(content)}\n".encode())
        summed.update(content)
    return summed.hexdigest()[:24]
