"""Timing on a shared machine: contenders take turns, and only ratios within one run are compared."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.threads import single_threaded

Task = Callable[[], object]
Seconds = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Spread:
    """Distribution of a value over repeats.

    Attributes:
        median, low, high: The 50th, 10th and 90th percentile.
        count: Number of repeats.
    """

    median: float
    low: float
    high: float
    count: int


def spread(values: ArrayLike) -> Spread:
    """The spread of ``values`` (n,), n >= 1."""
    low, median, high = np.percentile(np.asarray(values, dtype=float), (10.0, 50.0, 90.0)).tolist()
    return Spread(median=median, low=low, high=high, count=int(np.size(values)))


def interleave(contenders: Mapping[str, Task], *, repeats: int, block: float = 0.02) -> dict[str, Seconds]:
    """CPU time per call of each contender, on one thread, in each repeat.

    In every repeat each contender is called for about ``block`` seconds, in an order that rotates. CPU time
    of this process is measured, so that other processes affect it through shared caches only.

    Args:
        contenders: Functions without arguments; each is called at least once before it is timed.
        repeats: Number of repeats.
        block: Minimum duration of one measurement, in [s].

    Returns:
        Shape (repeats,) for each contender, in [s].
    """
    names = list(contenders)
    seconds = {name: np.empty(repeats) for name in names}
    with single_threaded():
        calls = {name: _number_of_calls(task, block) for name, task in contenders.items()}
        for index in range(repeats):
            for name in names[index % len(names) :] + names[: index % len(names)]:
                seconds[name][index] = _time(contenders[name], calls[name])
    return seconds


def exponent(sizes: ArrayLike, seconds: ArrayLike) -> float:
    """The p of the best fit c sizes^p to ``seconds``: least squares on logarithms; shapes (n,), n >= 2."""
    slope, _ = np.polyfit(np.log(np.asarray(sizes, dtype=float)), np.log(seconds), 1)
    return float(slope)


def _number_of_calls(task: Task, block: float) -> int:
    task()
    calls = 1
    while (spent := calls * _time(task, calls)) < block:
        calls = 2 * calls if spent < 0.1 * block else math.ceil(1.2 * calls * block / spent)
    return calls


def _time(task: Task, calls: int) -> float:
    start = time.process_time()
    for _ in range(calls):
        task()
    return (time.process_time() - start) / calls
