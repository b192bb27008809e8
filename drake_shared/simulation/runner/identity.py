"""Which code this is: what two processes must have in common for their results to be put together."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import platform
import reprlib
from pathlib import Path
from typing import Any

from drake_shared.common.files import models_directory

_LIBRARIES = ("drake", "numpy", "scipy", "torch")
"""Those whose version may change the bits of a result."""


@functools.cache
def identity() -> dict[str, str]:
    """The package's version, a digest of its source and shipped models, and the versions below it.

    It is that of the time of the first call: what this process has loaded does not change with the files.
    """
    return {
        "version": _version("drake_shared"),
        "source": _source(),
        "python": ".".join(platform.python_version_tuple()[:2]),
        **{name: _version(name) for name in _LIBRARIES},
    }


def difference(theirs: object, ours: dict[str, str]) -> str:
    """Says where two identities differ; empty if they do not."""
    if not isinstance(theirs, dict):
        return f"it is {theirs!r}"
    names = [name for name in {**ours, **theirs} if theirs.get(name) != ours.get(name)]
    return ", ".join(f"{name} is {theirs.get(name)}, not {ours.get(name)}" for name in names)


def first_difference(theirs: Any, ours: Any, name: str = "") -> str:
    """Says, in short, where two descriptions of a run first differ; empty if they do not."""
    if isinstance(theirs, dict) and isinstance(ours, dict):
        found = (
            first_difference(theirs.get(key), ours.get(key), f"{name}.{key}" if name else key)
            for key in {**ours, **theirs}
        )
        return next(filter(None, found), "")
    return "" if theirs == ours else f"{name or 'it'} is {reprlib.repr(theirs)}, not {reprlib.repr(ours)}"


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
