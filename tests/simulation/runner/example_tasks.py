"""Tasks for the tests, imported by name in the process that runs them."""

import os
import signal
import time
from pathlib import Path

import numpy as np

from drake_shared.common.errors import InputError


def walk(seed: int, seconds: float = 0.0) -> dict:
    """Sums whose bits depend on the order in which BLAS adds, after a pause."""
    random = np.random.default_rng(seed)
    matrix = random.normal(size=(300, 300))
    product = matrix @ matrix.T
    time.sleep(seconds)
    return {
        "seed": seed,
        "trace": np.trace(product),
        "sums": product.sum(axis=0)[:5],
        "nothing": float("nan"),
    }


def spin(seed: int, rounds: int) -> int:
    """Keeps the processor busy."""
    value = seed
    for _ in range(rounds):
        value = (value * 1103515245 + 12345) % 2147483648
    return value


def threads() -> dict:
    import torch
    from threadpoolctl import threadpool_info

    return {
        "torch": torch.get_num_threads(),
        "blas": max(item["num_threads"] for item in threadpool_info() if item["user_api"] == "blas"),
    }


def first_time(marker: str) -> bool:
    """Whether this is the first call with that file, in any process."""
    try:
        os.close(os.open(marker, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return False
    return True


def killed_once(seed: int, marker: str) -> dict:
    if first_time(marker):
        os.kill(os.getpid(), signal.SIGKILL)
    return walk(seed)


def killed(calls: str) -> None:
    with Path(calls).open("a") as file:
        file.write("called\n")
    os.kill(os.getpid(), signal.SIGKILL)


def fails_once(seed: int, marker: str) -> dict:
    if first_time(marker):
        raise OSError("connection lost\nfor a while")
    return walk(seed)


def fails(calls: str) -> None:
    with Path(calls).open("a") as file:
        file.write("called\n")
    raise ZeroDivisionError("first line\nsecond line")


def refuses(calls: str) -> None:
    with Path(calls).open("a") as file:
        file.write("called\n")
    raise InputError("scenario.yaml", "duration", "must be positive", -1)


def extremes() -> dict:
    return {
        "z": [float("inf"), float("-inf"), float("nan"), -0.0, 5e-324, 0.1],
        "a": np.float32(0.1),
        "count": np.int64(3),
        "flag": np.bool_(True),
        "pair": (1, 2),
        7: "seven",
    }


def not_json() -> set:
    return {1}
