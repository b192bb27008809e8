"""Results of the benchmark: the same types for file, figure and table."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from drake_shared.experiments.benchmark.timing import Seconds, Spread, exponent, spread

FORMAT, VERSION = "drake_shared.benchmark", 1


@dataclasses.dataclass(frozen=True, kw_only=True)
class Ratio:
    """A ratio of two contenders.

    Attributes:
        name: Numerator and denominator.
        spread: Over the repeats.
        aim: The value to reach, such as "at most 2"; may be empty.
        bound: "at least" or "at most" if a contender did not finish; else empty.
    """

    name: str
    spread: Spread
    aim: str = ""
    bound: str = ""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Curve:
    """Growth of a computing time with a size.

    Attributes:
        name: What is timed, with its unit.
        size: What grows.
        sizes: Shape (n,).
        seconds: The spread at each size.
        exponent: p of the best fit c size^p.
        last_exponent: The same for the last two sizes only, where constant parts matter least.
    """

    name: str
    size: str
    sizes: list[int]
    seconds: list[Spread]
    exponent: float
    last_exponent: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class Trace:
    """Decrease of a learner's error with training time.

    Attributes:
        name: The learner.
        seconds: CPU time, shape (n,), in [s].
        errors: Shape (n,), in [m].
    """

    name: str
    seconds: list[float]
    errors: list[float]


@dataclasses.dataclass(frozen=True, kw_only=True)
class GroupResult:
    """Results of a group.

    Attributes:
        name: The group.
        method: How it was measured, in a few sentences.
        ratios, curves, traces: The results.
        seconds: CPU time of each contender, in [s].
        absent: The reason why a contender did not take part, by its name.
        details: Further results of this group.
    """

    name: str
    method: str
    ratios: list[Ratio] = dataclasses.field(default_factory=list)
    seconds: dict[str, Spread] = dataclasses.field(default_factory=dict)
    curves: list[Curve] = dataclasses.field(default_factory=list)
    traces: list[Trace] = dataclasses.field(default_factory=list)
    absent: dict[str, str] = dataclasses.field(default_factory=dict)
    details: dict[str, Any] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Report:
    """Results of a run of the benchmark.

    Attributes:
        quick: Whether it was a quick run.
        repeats: How often each contender was timed.
        seconds: Duration of the run, in [s].
        machine: Processor, system, Python, BLAS, and load before and after.
        versions: Of the packages that took part; None if one is not installed.
        groups: Results by group.
    """

    quick: bool
    repeats: int
    seconds: float
    machine: dict[str, Any]
    versions: dict[str, str | None]
    groups: dict[str, GroupResult]

    def to_json(self) -> dict[str, Any]:
        """The report as JSON-serializable data."""
        return {"format": FORMAT, "version": VERSION, **dataclasses.asdict(self)}


def make_ratio(
    seconds: Mapping[str, Seconds], numerator: str, denominator: str, *, aim: str = "", note: str = ""
) -> Ratio:
    """The ratio of two contenders' times (n,), formed repeat by repeat so that common disturbances cancel."""
    values = spread(seconds[numerator] / seconds[denominator])
    return Ratio(name=f"{numerator} / {denominator}{note}", spread=values, aim=aim)


def make_curve(name: str, size: str, sizes: Sequence[int], seconds: Sequence[ArrayLike]) -> Curve:
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
