"""Messages on standard error, and output to streams that take no more or know few characters."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import select
import sys
from collections.abc import Iterator

from drake_shared.common.errors import RunError

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def say(message: str) -> None:
    """Prints a message to standard error; standard output is for results.

    Where nobody reads it any more, because a pipe or the terminal was closed, the message is lost.
    """
    with contextlib.suppress(OSError, ValueError):
        print(message, file=sys.stderr, flush=True)


@contextlib.contextmanager
def tolerant_streams() -> Iterator[None]:
    """Ends the block quietly where the reader of standard output has closed its pipe, as ``head`` does.

    Characters that a stream does not know are written as escapes.

    Raises:
        RunError: Standard output cannot be written, because the disk is full, for example.
    """
    for stream in (sys.stdout, sys.stderr):
        # It fails on a stream that was redirected after it was opened.
        with contextlib.suppress(OSError):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")
    try:
        try:
            yield
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except BrokenPipeError:
        # Other pipes break too, such as that of a worker process.
        if not _is_closed_pipe():
            raise
        _discard_output()
    except OSError as error:
        if error.errno not in _FULL:
            raise
        _discard_output()
        raise RunError(f"output cannot be written ({os.strerror(error.errno)})") from error


def _is_closed_pipe() -> bool:
    try:
        poll = select.poll()
        poll.register(sys.stdout.fileno(), select.POLLOUT)
        return any(event & select.POLLERR for _, event in poll.poll(0))
    except (OSError, AttributeError, ValueError):
        return False


def _discard_output() -> None:
    """Keeps Python from writing what is left in the buffer once more at its end, which would fail again."""
    with contextlib.suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
