"""Atomic file writes, and the folder of shipped files."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from drake_shared.common.errors import InputError, RunError


def models_directory() -> Path:
    """The folder of shipped robots, scenarios, demonstrations and learners."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "models"
    return installed if installed.is_dir() else package.parent / "models"


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yields a temporary path beside ``path`` and renames it to ``path`` on success.

    On an exception the temporary file is removed and ``path`` is unchanged.

    Raises:
        InputError: ``path`` cannot be written to.
        RunError: Writing failed, because the disk is full, for example.
    """
    target = Path(path)
    check_target(target)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            # mkstemp makes files private; the file gets the mode that open() would give it.
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        # Some libraries raise it with several lines of text.
        reason = os.strerror(error.errno) if error.errno else " ".join(str(error).split())
        raise RunError(f"{target}: cannot be written ({reason})") from error


def sha256_of(path: str | os.PathLike[str]) -> str:
    """SHA-256 of a file's content, in hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_target(path: str | os.PathLike[str]) -> None:
    """Checks that a file can be written at ``path``; creates its folder if needed.

    Raises:
        InputError: The folder cannot be created or written to, or ``path`` is a folder.
    """
    check_writable(Path(path).parent)
    if os.path.isdir(path):
        raise InputError(path, "", "must be a file to write, not a folder")


def check_writable(directory: str | os.PathLike[str]) -> None:
    """Creates ``directory`` if needed and checks that files can be written there.

    Raises:
        InputError: It cannot be created or written to.
    """
    try:
        Path(directory).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError as error:
        raise InputError(directory, "", f"must be a folder to write to ({error.strerror})") from error
