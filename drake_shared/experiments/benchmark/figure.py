"""The benchmark's report as one figure, a row of two panels for each group."""

from __future__ import annotations

import os

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from drake_shared.common.files import replacing
from drake_shared.experiments.benchmark.results import GroupResult, Report
from drake_shared.experiments.benchmark.table import SIGNS

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
    """Ratios as bars, errors and growth as curves."""
    groups = list(report.groups.values())
    heights = [
        3.8 if group.curves or group.traces else max(2.0, 0.3 * len(group.ratios) + 1.0) for group in groups
    ]
    figure = Figure(figsize=(14.0, sum(heights)), layout="constrained")
    # Rows are laid out separately, so that long labels in one do not narrow the panels of another.
    rows = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)
    for group, row in zip(groups, rows[:, 0], strict=True):
        left, right = row.subplots(1, 2)
        for axes in (left, right):
            axes.tick_params(which="both", labelsize=8)
        left.set_title(group.name, loc="left", fontweight="bold", fontsize=10)
        if group.ratios:
            _draw_ratios(left, group)
        else:
            _draw_relative_growth(left, group)
        _draw_details(right, group)
    load = report.machine.get("load_before")
    figure.suptitle(f"{report.machine['processor']}, load {load}", fontsize=9, color=_GREY)
    return figure


def _draw_ratios(axes: Axes, group: GroupResult) -> None:
    names = [f"{item.name}{f'  ({item.aim})' if item.aim else ''}" for item in group.ratios]
    spreads = [item.spread for item in group.ratios]
    errors = [[item.median - item.low for item in spreads], [item.high - item.median for item in spreads]]
    bars = axes.barh(
        range(len(names)),
        [item.median for item in spreads],
        xerr=errors,
        color=[_BLUE if item.aim else _GREY for item in group.ratios],
        height=0.6,
    )
    labels = [f"{SIGNS[item.bound]}{item.spread.median:.3g}" for item in group.ratios]
    axes.bar_label(bars, labels=labels, padding=4, fontsize=8)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.axvline(1.0, color="black", lw=0.8)
    axes.margins(x=0.2)
    axes.set_xlabel("ratio: median, 10 to 90% of repeats", fontsize=8)


def _draw_relative_growth(axes: Axes, group: GroupResult) -> None:
    for curve in group.curves:
        sizes = [size / curve.sizes[0] for size in curve.sizes]
        costs = [item.median / curve.seconds[0].median for item in curve.seconds]
        name = f"{curve.name.removesuffix(', s')}, by {curve.size}: {curve.exponent:.2f}"
        axes.plot(sizes, costs, "o-", ms=3, lw=1.2, label=name)
    axes.margins(y=0.4)
    _set_logarithmic(axes, "size / smallest size", "time / time at smallest size (exponent)")
    axes.legend(fontsize=6.5, loc="upper left")


def _draw_details(axes: Axes, group: GroupResult) -> None:
    details = group.details
    if group.curves:
        for curve in group.curves:
            (line,) = axes.plot(curve.sizes, [item.median for item in curve.seconds], "o-", ms=3, lw=1.2)
            lows, highs = [item.low for item in curve.seconds], [item.high for item in curve.seconds]
            axes.fill_between(curve.sizes, lows, highs, color=line.get_color(), alpha=0.2, lw=0)
        _set_logarithmic(axes, "size", "CPU time, s")
    elif group.traces:
        for trace in group.traces:
            axes.plot(trace.seconds, trace.errors, "o-", ms=3, lw=1.2, label=trace.name)
        axes.axhline(details["target"], color="black", lw=0.8, ls=":")
        _set_logarithmic(axes, "CPU time, s", "error, m")
        axes.legend(fontsize=6.5)
    elif "memory" in details:
        memory = details["memory"]
        axes.plot(memory["trials"], memory["megabytes"], "o-", ms=3, color=_BLUE)
        axes.set_ylim(0.0, 1.2 * max(memory["megabytes"]))
        axes.set_xlabel("trials", fontsize=8)
        axes.set_ylabel("memory, MB", fontsize=8)
    elif group.seconds:
        axes.barh(list(group.seconds), [1e6 * item.median for item in group.seconds.values()], color=_BLUE)
        axes.invert_yaxis()
        axes.set_xlabel("CPU time, µs", fontsize=8)
    else:
        axes.set_axis_off()


def _set_logarithmic(axes: Axes, x: str, y: str) -> None:
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel(x, fontsize=8)
    axes.set_ylabel(y, fontsize=8)
