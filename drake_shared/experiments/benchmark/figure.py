"""The benchmark as one picture: a panel for each group."""

from __future__ import annotations

import os

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from drake_shared.common.files import replacing
from drake_shared.experiments.benchmark.groups import Report
from drake_shared.experiments.benchmark.results import GroupResult

_TITLES = {
    "predict": "A prediction",
    "trial": "A trial",
    "training": "Training",
    "batch": "Many trials",
    "growth": "Growth",
    "safety": "The safety filter",
}
_BLUE, _GREY = "#2b6cb0", "#8a8f98"


def write_figure(report: Report, path: str | os.PathLike[str]) -> None:
    """Draws the report as a PNG file.

    Raises:
        InputError: The folder cannot be written to.
    """
    figure = draw(report)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=120)


def draw(report: Report) -> Figure:
    """A row of panels for each group: ratios as bars, errors and growth as curves."""
    heights = [_height(group) for group in report.groups]
    figure = Figure(figsize=(14.0, sum(heights)), layout="constrained")
    # A row by itself: the long names of one are not to narrow the panels of another.
    rows = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)
    for group, row in zip(report.groups, rows[:, 0], strict=True):
        left, right = row.subplots(1, 2)
        _draw_ratios(left, group)
        _draw_right(right, group)
    load = report.machine.get("load_before")
    figure.suptitle(f"{report.machine['processor']}, load {load}", fontsize=9, color=_GREY)
    return figure


def _height(group: GroupResult) -> float:
    """Of a group's row, in inches."""
    return 3.8 if group.curves or group.traces else max(2.0, 0.3 * len(group.ratios) + 1.0)


def _draw_ratios(axes: Axes, group: GroupResult) -> None:
    axes.set_title(_TITLES.get(group.name, group.name), loc="left", fontweight="bold", fontsize=10)
    if not group.ratios:
        for curve in group.curves:
            sizes = [size / curve.sizes[0] for size in curve.sizes]
            costs = [item.median / curve.seconds[0].median for item in curve.seconds]
            name = f"{curve.name.removesuffix(', s')}, by {curve.size}: {curve.exponent:.2f}"
            axes.plot(sizes, costs, "o-", ms=3, lw=1.2, label=name)
        axes.margins(y=0.4)
        _label(axes, "size, by the smallest", "cost, by the smallest (exponent)")
        return
    names = [f"{item.name}{f'  ({item.aim})' if item.aim else ''}" for item in group.ratios]
    places = range(len(names))
    medians = [item.spread.median for item in group.ratios]
    errors = [
        [item.spread.median - item.spread.low for item in group.ratios],
        [item.spread.high - item.spread.median for item in group.ratios],
    ]
    colors = [_BLUE if item.aim else _GREY for item in group.ratios]
    axes.barh(places, medians, xerr=errors, color=colors, height=0.6, error_kw={"lw": 1.0})
    for place, item in zip(places, group.ratios, strict=True):
        sign = {"at least": "≥ ", "at most": "≤ "}.get(item.bound, "")
        axes.annotate(
            f"{sign}{item.spread.median:.3g}",
            (item.spread.high, place),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    axes.set_yticks(places, names, fontsize=8)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(axis="x", labelsize=8)
    axes.axvline(1.0, color="black", lw=0.8)
    axes.margins(x=0.2)
    axes.set_xlabel("ratio: median, 10 to 90% of repeats", fontsize=8)


def _draw_right(axes: Axes, group: GroupResult) -> None:
    if group.curves:
        for curve in group.curves:
            medians = [item.median for item in curve.seconds]
            (line,) = axes.plot(curve.sizes, medians, "o-", ms=3, lw=1.2)
            lows, highs = [item.low for item in curve.seconds], [item.high for item in curve.seconds]
            axes.fill_between(curve.sizes, lows, highs, color=line.get_color(), alpha=0.2, lw=0)
        _label(axes, "size", "CPU time, s")
    elif group.traces:
        for trace in group.traces:
            axes.plot(trace.seconds, trace.errors, "o-", ms=3, lw=1.2, label=trace.name)
        axes.axhline(group.details["target"], color="black", lw=0.8, ls=":")
        _label(axes, "CPU time, s", "off by, m")
    elif "time_goes" in group.details:
        parts = group.details["time_goes"]
        axes.barh(list(parts), [item["microseconds_per_step"] for item in parts.values()], color=_BLUE)
        axes.invert_yaxis()
        axes.tick_params(labelsize=8)
        axes.set_xlabel("µs per step", fontsize=8)
    elif "memory" in group.details:
        memory = group.details["memory"]
        axes.plot(memory["trials"], memory["megabytes"], "o-", ms=3, color=_BLUE)
        axes.set_ylim(0.0, 1.2 * max(memory["megabytes"]))
        axes.tick_params(labelsize=8)
        axes.set_xlabel("trials", fontsize=8)
        axes.set_ylabel("memory, MB", fontsize=8)
    elif group.seconds:
        names = list(group.seconds)
        axes.barh(names, [1e6 * item.median for item in group.seconds.values()], color=_GREY)
        axes.invert_yaxis()
        axes.tick_params(labelsize=7)
        axes.set_xlabel("CPU time, µs", fontsize=8)
    else:
        axes.set_axis_off()


def _label(axes: Axes, x: str, y: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(x, fontsize=8)
    axes.set_ylabel(y, fontsize=8)
    axes.tick_params(which="both", labelsize=8)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=6.5, loc="upper left" if axes.get_title(loc="left") else "best")
