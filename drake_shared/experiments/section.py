"""Experiments: the tasks that they run, and the sections of the report that they return."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from drake_shared.analysis.statistics import Claim
from drake_shared.experiments.training import CAPPED
from drake_shared.simulation.runner import Task

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Rows = Sequence[Mapping[str, Any]]
"""Rows of plain values, most often one for each trial."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Size:
    """The size of a reproduction.

    Attributes:
        name: "full" or "quick".
        repeats: Repeats of the experiment of Fig. 6 for the primary operator.
        other_repeats: Its repeats for each other operator; 0 leaves them out.
        all_arms: Whether all arms of it are run, or the primary arm only.
        learners: Number of learners over which other experiments average, each with demonstrations and a seed
            of its own.
        trials: Trials with each learner.
        paper: Size with preset paper, whose learners take ten times as long to train; None: the same.
    """

    name: str
    repeats: int
    other_repeats: int
    all_arms: bool
    learners: int
    trials: int
    paper: Size | None = None

    def of(self, preset: str) -> Size:
        """The size with a preset."""
        return self.paper or self if preset == "paper" else self

    def fewer(self, preset: str) -> int:
        """The number of learners of experiments that train several from the data of each."""
        return min(max(2, self.learners // 2), self.of(preset).learners)


FULL = Size(
    name="full",
    repeats=100,
    other_repeats=20,
    all_arms=True,
    learners=20,
    trials=10,
    paper=Size(name="full", repeats=20, other_repeats=0, all_arms=False, learners=10, trials=10),
)
QUICK = Size(
    name="quick",
    repeats=6,
    other_repeats=0,
    all_arms=False,
    learners=2,
    trials=3,
    paper=Size(name="quick", repeats=1, other_repeats=0, all_arms=False, learners=1, trials=3),
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Picture:
    """A figure of the report.

    Attributes:
        svg: The drawing.
        caption: Its caption.
    """

    svg: str
    caption: str

    @classmethod
    def of(cls, figure: Figure, caption: str) -> Picture:
        """A matplotlib figure as SVG; the same figure gives the same bits."""
        import matplotlib as mpl

        with mpl.rc_context({"svg.hashsalt": "drake_shared", "svg.fonttype": "path"}):
            buffer = io.StringIO()
            figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        text = buffer.getvalue()
        return cls(svg=text[text.index("<svg") :], caption=caption)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Table:
    """A table of the report.

    Attributes:
        caption: Its caption.
        head: Names of the columns, with units.
        rows: The cells of each row, as text.
    """

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Section:
    """A section of the report.

    Attributes:
        title: Its heading.
        text: Its paragraphs; see `paragraphs`.
        pictures, tables, claims: In the order of the page.
        data: Rows by name, written beside the report as Parquet.
        replays: Stand-alone pages by caption, embedded in the report.
    """

    title: str
    text: Sequence[str]
    pictures: Sequence[Picture] = ()
    tables: Sequence[Table] = ()
    claims: Sequence[Claim] = ()
    data: Mapping[str, Rows] = dataclasses.field(default_factory=dict)
    replays: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def with_early_stops(self) -> Section:
        """The section with a paragraph about learners that stopped before their loss threshold, if any did.

        Such a learner has a true value in the column ``stopped_early`` of its rows.
        """
        notes = []
        for name, rows in self.data.items():
            stopped = [row["stopped_early"] for row in rows if "stopped_early" in row]
            if any(stopped):
                notes.append(
                    f"{sum(stopped)} of the {len(stopped)} rows of {name} are of learners whose training "
                    "ended before the loss threshold of their preset was reached"
                )
        if not notes:
            return self
        limits = "; ".join(
            f"learners of preset {preset} with more than three demonstrations are trained for at most "
            f"{iterations:,} iterations"
            for preset, iterations in CAPPED.items()
        )
        return dataclasses.replace(self, text=[*self.text, f"{'; '.join(notes)} ({limits})."])


@dataclasses.dataclass(frozen=True)
class PlannedTask:
    """A task and the approximate time that it takes on one core, in [s]."""

    task: Task
    seconds: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class Experiment:
    """An experiment.

    Attributes:
        name: Its name on the command line.
        plan: Returns the tasks for a scenario (file or name) and size. They can run in any order and process.
        report: Returns the section, from the results in the order of the tasks.
    """

    name: str
    plan: Callable[[str | None, Size], list[PlannedTask]]
    report: Callable[[str | None, Size, list[Any]], Section]
