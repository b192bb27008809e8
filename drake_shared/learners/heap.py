"""Memory that a training frees is kept for its next iteration."""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Iterator

# Of glibc's <malloc.h>: parameters of mallopt, what it begins with, and the most it takes for the second.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_DEFAULT = 128 * 1024
_LARGEST_BLOCK, _KEPT = 32 * 2**20, 2**30


@contextlib.contextmanager
def kept_memory() -> Iterator[None]:
    """Freed blocks of up to 32 MB stay with the process, 1 GB of them at most, and are given back at the end.

    The gradients of many networks are megabytes that are freed in each iteration. glibc gives such blocks
    back to the system, which clears every page of them anew: a quarter of the time of a training. Where the C
    library is another, nothing is done.
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
