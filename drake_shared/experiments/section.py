"""What an experiment says: text, figures, tables, claims and the numbers behind them."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from drake_shared.analysis.statistics import Claim
from drake_shared.simulation.runner import Task

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True, kw_only=True)
class Size:
    """How large a reproduction is.

    Attributes:
        name: "full" or "quick".
        repeats: Of the experiment of Fig. 6 for the primary operator.
        other_repeats: Of it for each other operator; 0 leaves them out.
        all_arms: Whether all arms of it are run, or the primary one alone.
        learners: How many learners, each from demonstrations and a seed of its own, other experiments average
            over.
        trials: Trials with each learner.
    """

    name: str
    repeats: int
    other_repeats: int
    all_arms: bool
    learners: int
    trials: int


FULL = Size(name="full", repeats=100, other_repeats=20, all_arms=True, learners=20, trials=10)
QUICK = Size(name="quick", repeats=10, other_repeats=0, all_arms=False, learners=2, trials=3)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Picture:
    """A figure of a report.

    Attributes:
        svg: The drawing.
        caption: What it shows.
    """

    svg: str
    caption: str

    @classmethod
    def of(cls, figure: Figure, caption: str) -> Picture:
        """A matplotlib figure as vectors, with the same bits whenever it is drawn."""
        import matplotlib as mpl

        with mpl.rc_context({"svg.hashsalt": "drake_shared", "svg.fonttype": "path"}):
            buffer = io.StringIO()
            figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        text = buffer.getvalue()
        return cls(svg=text[text.index("<svg") :], caption=caption)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Table:
    """A table of a report.

    Attributes:
        caption: What it shows.
        head: Names of the columns, with units.
        rows: Of each row the cells, as they are to be read.
    """

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Section:
    """A section of a report.

    Attributes:
        title: Its heading.
        text: Paragraphs: what was done, with what, and what to make of it.
        pictures, tables, claims: In the order of reading.
        data: Names to rows of plain values, written beside the report as Parquet.
        replays: Captions to stand-alone pages, each embedded.
    """

    title: str
    text: Sequence[str]
    pictures: Sequence[Picture] = ()
    tables: Sequence[Table] = ()
    claims: Sequence[Claim] = ()
    data: Mapping[str, Sequence[Mapping[str, Any]]] = dataclasses.field(default_factory=dict)
    replays: Mapping[str, str] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Experiment:
    """An experiment: what is to be computed, and what is made of it.

    Attributes:
        name: As the command line calls it.
        tasks: The tasks for a scenario (file or name) and size; each can run alone, in any order, anywhere.
        cost: Seconds that a task takes on one core, roughly, for the estimate given beforehand.
        report: The section, from the results in the order of the tasks.
    """

    name: str
    tasks: Callable[[str | None, Size], list[Task]]
    cost: Callable[[Task], float]
    report: Callable[[str | None, Size, list[Any]], Section]
