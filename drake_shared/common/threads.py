"""One thread for the numerical libraries: for arrays this small, more are slower and change the bits."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator

from threadpoolctl import threadpool_limits

_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@contextlib.contextmanager
def single_threaded() -> Iterator[None]:
    """Limits BLAS, OpenMP and torch to one thread each, and restores their limits afterwards.

    Libraries that are first loaded inside are limited as well, and keep that limit.
    """
    torch = sys.modules.get("torch")
    torch_threads = None if torch is None else torch.get_num_threads()
    environment = {name: os.environ.get(name) for name in _VARIABLES}
    limits = limit_threads()
    try:
        yield
    finally:
        limits.restore_original_limits()
        if torch is not None:
            torch.set_num_threads(torch_threads)
        for name, value in environment.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def limit_blas() -> None:
    """Limits BLAS to one thread for the rest of the process."""
    threadpool_limits(1, user_api="blas")


def limit_threads() -> threadpool_limits:
    """Limits BLAS, OpenMP and torch to one thread each for the rest of the process."""
    # For libraries that are loaded later.
    os.environ.update(dict.fromkeys(_VARIABLES, "1"))
    if (torch := sys.modules.get("torch")) is not None:
        torch.set_num_threads(1)
    return threadpool_limits(1)
