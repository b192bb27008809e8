"""Atomic file writes, and the folder of shipped files."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import os
import stat
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
def replacing(path: str | os.PathLike[str], *, durable: bool = False) -> Iterator[Path]:
    """Yields a temporary path beside ``path`` and renames it to ``path`` on success.

    On an exception the temporary file is removed and ``path`` is unchanged. If ``path`` is a symbolic link,
    the file that it leads to is replaced. A file that exists keeps its permissions.

    Args:
        path: File to write.
        durable: Wait until the content is on the disk, so that it survives a power failure.

    Raises:
        InputError: ``path`` cannot be written to.
        RunError: Writing failed, because the disk is full, for example.
    """
    check_target(path)
    target = Path(os.path.realpath(path))
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            temporary.chmod(_mode_of(target))
            if durable:
                _sync(temporary)
            temporary.replace(target)
            if durable:
                _sync(target.parent)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        # Some libraries raise it with several lines of text.
        reason = os.strerror(error.errno) if error.errno else " ".join(str(error).split())
        raise RunError(f"{target}: cannot be written ({reason})") from error


def numbered(name: str) -> Iterator[str]:
    """``name``, ``name-2``, ``name-3`` and so on, for a file that must not replace another one."""
    yield name
    for number in itertools.count(2):
        yield f"{name}-{number}"


@contextlib.contextmanager
def created_once(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yields a temporary path, and moves the file there to ``path`` if there is none yet.

    The folder is created if needed. After the block the file survives a power failure; a file that exists is
    never changed, by whatever number of processes.

    Raises:
        InputError: There is a file at ``path``.
        RunError: Writing failed, because the disk is full, for example.
    """
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".", dir=target.parent) as folder:
            temporary = Path(folder) / target.name
            yield temporary
            _sync(temporary)
            os.link(temporary, target)
            _sync(target.parent)
    except FileExistsError as error:
        raise InputError(target, "", "must not exist: it was written before, and is never changed") from error
    except OSError as error:
        raise RunError(f"{target}: cannot be written ({error.strerror or error})") from error


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _mode_of(target: Path) -> int:
    """Permissions of a file, or those that open() would give to a new one; mkstemp makes files private."""
    if target.exists():
        return stat.S_IMODE(target.stat().st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def sha256_of(path: str | os.PathLike[str]) -> str:
    """SHA-256 of a file's content, in hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_target(path: str | os.PathLike[str]) -> None:
    """Checks that a file can be written at ``path``, or where it leads to; creates its folder if needed.

    Raises:
        InputError: The folder cannot be created or written to, or ``path`` is a folder, a device, a FIFO or a
            link to itself.
    """
    target = os.path.realpath(path)
    if os.path.isdir(target):
        raise InputError(path, "", "must be a file to write, not a folder")
    if os.path.islink(target) or (os.path.exists(target) and not os.path.isfile(target)):
        raise InputError(path, "", "must be a file to write, not a device, a FIFO or a link to itself")
    check_writable(os.path.dirname(target))


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
