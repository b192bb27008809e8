"""Files that are never half there, and where the shipped ones are."""

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
    """Yields a temporary path beside ``path`` to write to, and renames it into place on success.

    On an exception the temporary file goes and ``path`` stays as it was.

    Raises:
        InputError: There is no writing to ``path``.
        RunError: Writing failed half-way: the disk is full, say.
    """
    target = Path(path)
    check_target(target)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            # mkstemp makes files private; what we leave has the mode that open() would have given it.
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        # Some libraries raise it with a text of many lines.
        reason = os.strerror(error.errno) if error.errno else " ".join(str(error).split())
        raise RunError(f"{target}: cannot be written ({reason})") from error


def sha256_of(path: str | os.PathLike[str]) -> str:
    """The SHA-256 of a file's content, in hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_target(path: str | os.PathLike[str]) -> None:
    """Makes sure that a file can be written at ``path``; its folder is made if needed.

    Raises:
        InputError: The folder cannot be made or written to, or ``path`` is itself a folder.
    """
    check_writable(Path(path).parent)
    if os.path.isdir(path):
        raise InputError(path, "", "must be a file to write, not a folder")


def check_writable(directory: str | os.PathLike[str]) -> None:
    """Makes ``directory`` if needed and proves that files can be written there.

    Raises:
        InputError: They cannot.
    """
    try:
        Path(directory).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError as error:
        raise InputError(directory, "", f"must be a folder to write to ({error.strerror})") from error
