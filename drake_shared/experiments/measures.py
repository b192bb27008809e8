"""Measures of trials: means over the trials of each learner, their intervals, and tables of both."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.mean_tests import UNBOUNDED
from drake_shared.analysis.statistics import PERCENT, Estimate, interval
from drake_shared.experiments.section import Rows, Table
from drake_shared.experiments.text import with_interval


@dataclasses.dataclass(frozen=True)
class Measure:
    """A measure as the report shows it.

    Attributes:
        name: Its name in the rows.
        title: Its name in the report.
        unit: The unit in the report; empty for a plain number.
        factor: From the unit of the rows to that of the report.
        limits: The least and the largest possible value in the report, if the unit is not %.
    """

    name: str
    title: str
    unit: str = ""
    factor: float = 1.0
    limits: tuple[float, float] = UNBOUNDED

    @property
    def label(self) -> str:
        """Title and unit."""
        return f"{self.title}, {self.unit}" if self.unit else self.title

    @property
    def bounds(self) -> tuple[float, float]:
        """The least and the largest possible value."""
        return PERCENT if self.unit == "%" else self.limits

    @property
    def difference_bounds(self) -> tuple[float, float]:
        """The least and the largest possible difference of two values."""
        low, high = self.bounds
        return low - high, high - low


INTENT_SUCCESS = Measure("intent_success", "intent success", "%", 100.0)
COLLISIONS = Measure("collision", "collisions", "%", 100.0)
HUMAN_EFFORT = Measure("human_effort", "human effort", "rad")
DISAGREEMENT = Measure("disagreement", "disagreement", "rad/s")
MEAN_HUMAN_WEIGHT = Measure("mean_human_weight", "mean human weight", limits=(0.0, 1.0))


def select(rows: Iterable[Mapping[str, Any]], **where: Any) -> list[Mapping[str, Any]]:
    """The rows that have these values."""
    return [row for row in rows if all(row[name] == value for name, value in where.items())]


def by_learner(
    rows: Iterable[Mapping[str, Any]], measure: str, *, unit: str = "learner", **where: Any
) -> NDArray[np.float64]:
    """The mean of a measure over the trials of each learner, shape (learners,), ordered by index.

    Args:
        rows: Of trials.
        measure: Name of a column. None and NaN are skipped; a learner with no other value has NaN.
        unit: The column of the index: "learner", or another unit of independent repeats.
        where: Only rows with these values count.
    """
    found: dict[int, list[float]] = {}
    for row in select(rows, **where):
        value = row[measure]
        found.setdefault(row[unit], []).append(np.nan if value is None else float(value))
    return np.array([finite_mean(found[index]) for index in sorted(found)])


def finite_mean(values: Sequence[float]) -> float:
    """The mean of the finite values, or NaN if there are none."""
    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    return float(finite.mean()) if finite.size else np.nan


def estimate(rows: Rows, measure: Measure, *, unit: str = "learner", **where: Any) -> Estimate:
    """Mean and interval of a measure over learners, in the unit of the report; see `by_learner`."""
    values = measure.factor * by_learner(rows, measure.name, unit=unit, **where)
    return interval(values, bounds=measure.bounds)


def means_table(
    rows: Rows,
    measures: Sequence[Measure],
    lines: Iterable[tuple[Sequence[str], Mapping[str, Any]]],
    *,
    head: Sequence[str],
    caption: str,
    unit: str = "learner",
) -> Table:
    """A table of means with intervals.

    Args:
        rows: Of trials.
        measures: One column each, after the first columns.
        lines: The first cells of each line, and the values of its rows.
        head: Names of the first columns.
        caption: Of the table.
        unit: See `by_learner`.
    """
    return Table(
        caption=caption,
        head=[*head, *(measure.label for measure in measures)],
        rows=[
            [
                *cells,
                *(with_interval(estimate(rows, measure, unit=unit, **where)) for measure in measures),
            ]
            for cells, where in lines
        ],
    )
