"""Keeps the key of a port, so that an open page comes back when the program starts again."""

from __future__ import annotations

import os
import secrets
import time
from pathlib import Path

LIFETIME = 12 * 3600.0
"""Time without use after which a key is replaced, in [s]."""

_MODE = 0o600


def stored_key(port: int, folder: Path | None = None) -> str:
    """Returns the key of ``port``: the last one if it is recent, else a new one.

    It is kept in a file that only this user can read. Where that cannot be, the key is new each time.

    Args:
        port: On which the page is served; 0 is another one each time, and has no stored key.
        folder: Of the files; drake_shared in the user's state folder if None.
    """
    new = secrets.token_urlsafe(18)
    if port == 0:
        return new
    path = (folder or _state_folder()) / f"key-{port}"
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, _MODE)
        with os.fdopen(descriptor, "r+") as file:
            status = os.fstat(file.fileno())
            private = status.st_uid == os.getuid() and status.st_mode & 0o777 == _MODE
            kept = file.read().strip()
            recent = time.time() - status.st_mtime < LIFETIME
            key = kept if private and recent and len(kept) >= len(new) else new
            if private:
                file.seek(0)
                file.truncate()
                file.write(key)
            return key
    except (OSError, UnicodeDecodeError):
        return new


def _state_folder() -> Path:
    base = os.environ.get("XDG_STATE_HOME")
    return (Path(base) if base else Path.home() / ".local" / "state") / "drake_shared"
