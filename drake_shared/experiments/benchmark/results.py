"""What a group of the benchmark found, in one shape for file, figure and reader."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.experiments.benchmark.timing import Spread, exponent, spread


@dataclasses.dataclass(frozen=True, kw_only=True)
class Ratio:
    """One finding: how something compares.

    Attributes:
        name: What is divided by what.
        spread: Of the ratio over the repeats.
        aim: What it should be, such as "at most 2"; empty where nothing is asked.
        bound: "" or, where a contender did not finish, "at least" or "at most".
    """

    name: str
    spread: Spread
    aim: str = ""
    bound: str = ""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Curve:
    """How something grows.

    Attributes:
        name: What is timed, with its unit.
        size: What grows.
        sizes: Shape (n,).
        seconds: The spread at each size.
        exponent: p of the best fit c size^p over all sizes.
        last_exponent: The same between the last two sizes: what a constant share no longer hides.
    """

    name: str
    size: str
    sizes: list[int]
    seconds: list[Spread]
    exponent: float
    last_exponent: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class Trace:
    """How an error falls with time.

    Attributes:
        name: Whose.
        seconds: Shape (n,), CPU time, in [s].
        errors: Shape (n,), in [m].
    """

    name: str
    seconds: list[float]
    errors: list[float]


@dataclasses.dataclass(frozen=True, kw_only=True)
class GroupResult:
    """All that a group found.

    Attributes:
        name: Of the group.
        method: How it was measured, in a few sentences.
        ratios: The findings.
        seconds: CPU time of each contender, in [s], as far as that says anything.
        curves: How things grow.
        traces: How errors fall.
        absent: Each contender that did not take part, with the reason.
        details: Whatever else there is to know.
    """

    name: str
    method: str
    ratios: list[Ratio] = dataclasses.field(default_factory=list)
    seconds: dict[str, Spread] = dataclasses.field(default_factory=dict)
    curves: list[Curve] = dataclasses.field(default_factory=list)
    traces: list[Trace] = dataclasses.field(default_factory=list)
    absent: dict[str, str] = dataclasses.field(default_factory=dict)
    details: dict[str, Any] = dataclasses.field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return dataclasses.asdict(self)


def make_curve(name: str, size: str, sizes: Sequence[int], seconds: Sequence[NDArray[np.float64]]) -> Curve:
    """A curve from the repeats (n,) at each size."""
    spreads = [spread(values) for values in seconds]
    medians = [item.median for item in spreads]
    return Curve(
        name=name,
        size=size,
        sizes=list(sizes),
        seconds=spreads,
        exponent=exponent(sizes, medians),
        last_exponent=exponent(sizes[-2:], medians[-2:]),
    )
