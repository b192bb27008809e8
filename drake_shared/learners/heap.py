"""Keeps freed memory in the process while networks train."""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Iterator

# Of glibc's <malloc.h>: parameters of mallopt, their default, and the largest value of the second.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_DEFAULT = 128 * 1024
_LARGEST_BLOCK, _KEPT = 32 * 2**20, 2**30


@contextlib.contextmanager
def kept_memory() -> Iterator[None]:
    """Keeps freed blocks of up to 32 MB, 1 GB of them at most, and returns them to the system at the end.

    The gradients of many networks are megabytes that are freed in each iteration. By default glibc returns
    such blocks to the system, which clears every page each time: a quarter of the time of a training. With
    another C library nothing is done.
    """
    libc = ctypes.CDLL(None)
    if not (hasattr(libc, "mallopt") and hasattr(libc, "malloc_trim")):
        yield
        return
    libc.mallopt(_TRIM_THRESHOLD, _KEPT)
    libc.mallopt(_MMAP_THRESHOLD, _LARGEST_BLOCK)
    try:
        yield
    finally:
        libc.mallopt(_MMAP_THRESHOLD, _DEFAULT)
        libc.mallopt(_TRIM_THRESHOLD, _DEFAULT)
        libc.malloc_trim(0)
