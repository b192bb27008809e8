"""Fair timing on a machine that has other things to do: contenders take turns, and only ratios count."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

Task = Callable[[], object]
Seconds = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Spread:
    """The median of repeats, and where the middle 80% of them lie.

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


def ratio(of: Seconds, to: Seconds) -> Spread:
    """The spread of the ratio of two contenders (n,), taken repeat by repeat: what slows one slows both."""
    return spread(of / to)


def interleave(contenders: Mapping[str, Task], *, repeats: int, block: float = 0.02) -> dict[str, Seconds]:
    """CPU seconds of a call of each contender, on one thread, in each of the repeats.

    In every repeat each contender is called, in turn and in an order that rotates, for about ``block`` s. CPU
    time of this process is what counts, so that another process costs neither of them anything but its share
    of the caches.

    Args:
        contenders: Called without arguments; each is called at least once before it is timed.
        repeats: How often the turn goes round.
        block: Least time of one measurement, in [s].

    Returns:
        Shape (repeats,) for each contender, in [s].
    """
    names = list(contenders)
    seconds = {name: np.empty(repeats) for name in names}
    with threadpool_limits(1):
        calls = {name: _calls(task, block) for name, task in contenders.items()}
        for index in range(repeats):
            for name in names[index % len(names) :] + names[: index % len(names)]:
                seconds[name][index] = _time(contenders[name], calls[name])
    return seconds


def exponent(sizes: ArrayLike, seconds: ArrayLike) -> float:
    """The p of seconds = c sizes^p that fits best: least squares on the logarithms; shapes (n,), n >= 2."""
    slope, _ = np.polyfit(np.log(np.asarray(sizes, dtype=float)), np.log(seconds), 1)
    return float(slope)


def _calls(task: Task, block: float) -> int:
    """How often to call ``task`` to spend at least ``block`` s."""
    task()
    calls = 1
    while (spent := calls * _time(task, calls)) < block:
        calls = 2 * calls if spent < 0.1 * block else math.ceil(1.2 * calls * block / spent)
    return calls


def _time(task: Task, calls: int) -> float:
    begun = time.process_time()
    for _ in range(calls):
        task()
    return (time.process_time() - begun) / calls
