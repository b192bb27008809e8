"""The style of the report's figures; its colours are distinguishable by the colour-blind."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.statistics import Estimate
from drake_shared.scenario import Scenario, obstacles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

# The palette of Okabe and Ito 2008.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE = (
    *("#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7"),
)
COLOURS = {
    "human": BLUE,
    "agent": VERMILION,
    "shared": GREEN,
    "confidence": PURPLE,
    "plain": SKY,
    "weighted": GREEN,
    "paper": ORANGE,
    "default": BLUE,
    "obstacle": "0.75",
    "demonstration": "0.45",
}
ROUTES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
"""Colours of the routes of a scenario, in their order."""
WIDTH = 8.0
"""Of a figure, in inches."""
_BAND_STEP = 0.1
"""Distance between points of the edge of a band, in [m] along the path."""


def new_figure(height: float, *, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Figure, Any]:
    """A figure of the width of the report with its axes, as `matplotlib.figure.Figure.subplots` returns them.

    Args:
        height: In inches.
        rows, columns: Of axes.
        options: For ``subplots``.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.subplots(rows, columns, **options)
    for one in figure.axes:
        one.spines[["top", "right"]].set_visible(False)
        one.tick_params(labelsize=8)
    return figure, axes


def legend_below(figure: Figure, handles: Any, labels: Sequence[str] | None = None, *, columns: int) -> None:
    """Adds one legend for all axes of a figure, below them.

    Args:
        figure: From `new_figure`.
        handles, labels: Of the entries; default: the labels of the handles.
        columns: Number of entries in a line.
    """
    words = [handle.get_label() for handle in handles] if labels is None else labels
    figure.legend(handles, words, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)


def marker_legend(figure: Figure, styles: Mapping[str, tuple[str, str]], *, columns: int) -> None:
    """Adds one legend for all axes of a figure, below them, with a marker for each entry.

    Args:
        figure: From `new_figure`.
        styles: Colour and marker by label.
        columns: Number of entries in a line.
    """
    handles = [
        figure.axes[0].plot([], [], color=colour, marker=marker, linestyle="", markersize=4, label=label)[0]
        for label, (colour, marker) in styles.items()
    ]
    legend_below(figure, handles, columns=columns)


def draw_scene(axes: Axes, scenario: Scenario) -> None:
    """Draws obstacles, start and goals from above, in [m], to scale."""
    from matplotlib.patches import Circle

    for obstacle in scenario.obstacles:
        axes.add_patch(_outline(obstacle))
    for goal in scenario.all_goals:
        edge: Any = {"facecolor": "none", "edgecolor": GREEN, "linestyle": "--"}
        axes.add_patch(Circle((goal.x, goal.y), goal.radius, **edge))
        axes.annotate(goal.name, (goal.x, goal.y + goal.radius), ha="center", va="bottom", fontsize=8)
    axes.plot(scenario.start.x, scenario.start.y, marker="o", color=BLACK, markersize=4)
    axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")


def limit_to_workspace(axes: Axes, scenario: Scenario, *, left: float = 0.0, right: float = 0.0) -> None:
    """Limits axes to the workspace, less a margin on the left and on the right, in [m]."""
    space = scenario.workspace
    axes.set(xlim=(space.x_min + left, space.x_max - right), ylim=(space.y_min, space.y_max))


def draw_demonstrations(axes: Axes, paths: Iterable[Any]) -> None:
    """Draws paths, each of shape (N, 2) in [m], as dotted lines with one entry in the legend."""
    for index, path in enumerate(paths):
        label = None if index else "demonstrations"
        axes.plot(*np.array(path).T, ":", color=COLOURS["demonstration"], linewidth=0.7, label=label)


def _outline(obstacle: Any) -> Patch:
    from matplotlib.patches import Circle, Rectangle

    if isinstance(obstacle, obstacles.Circle):
        return Circle((obstacle.x, obstacle.y), obstacle.radius, facecolor=COLOURS["obstacle"])
    length, width = obstacle.length, obstacle.width
    return Rectangle(
        (obstacle.x - length / 2, obstacle.y - width / 2),
        length,
        width,
        angle=math.degrees(obstacle.yaw_angle()),
        rotation_point="center",
        facecolor=COLOURS["obstacle"],
    )


def draw_band(
    axes: Axes,
    mean: NDArray[np.float64],
    sigma: NDArray[np.float64],
    colour: str,
    label: str | None = None,
    **line: Any,
) -> None:
    """Draws a predicted path (N, 2) in [m] in a band of one standard deviation (N, 2) across it on each side.

    Args:
        axes: Where to draw.
        mean, sigma: Finite.
        colour, label: Of the path.
        line: Other properties of its line.
    """
    # Where the path hardly moves it has no direction.
    arc_length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(mean, axis=0), axis=1))])
    kept = np.unique(np.floor(arc_length / _BAND_STEP), return_index=True)[1]
    if len(kept) > 1:
        ahead = np.gradient(mean[kept], axis=0)
        across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
        across *= np.linalg.norm(across * sigma[kept], axis=1, keepdims=True)
        edge = np.concatenate([mean[kept] + across, (mean[kept] - across)[::-1]])
        axes.fill(*edge.T, color=colour, alpha=0.2, linewidth=0)
    axes.plot(*np.asarray(mean).T, color=colour, label=label, **{"linewidth": 1.5, **line})


def draw_curve(
    axes: Axes,
    at: Sequence[float],
    estimates: Sequence[Estimate],
    colour: str,
    label: str | None = None,
    **line: Any,
) -> None:
    """Draws means as a curve in the band of their intervals, where these are finite.

    Args:
        axes: Where to draw.
        at: The abscissa of each estimate, shape (n,).
        estimates, colour, label: Of the curve.
        line: Other properties of its line.
    """
    edges = np.array([[one.low, one.high] for one in estimates]).T
    edges[:, ~np.isfinite(edges).all(axis=0)] = np.nan
    axes.fill_between(at, *edges, color=colour, alpha=0.18, linewidth=0)
    properties = {"marker": "o", "markersize": 3, "linewidth": 1.4, "label": label, **line}
    axes.plot(at, [one.mean for one in estimates], color=colour, **properties)


def draw_interval(axes: Axes, height: float, found: Estimate, colour: str, **marker: Any) -> None:
    """Draws a mean as a marker with its interval as a horizontal bar; an infinite one is not drawn."""
    widths = np.array([[found.mean - found.low], [found.high - found.mean]])
    axes.errorbar(
        [found.mean],
        [height],
        xerr=np.where(np.isfinite(widths), widths, np.nan),
        color=colour,
        capsize=2,
        linewidth=1.2,
        **marker,
    )


def title_panel(axes: Axes, title: str, unit: str) -> None:
    """Titles a panel of horizontal bars; percentages have the same axis everywhere."""
    axes.set_title(title, fontsize=9)
    axes.set_xlabel(unit, fontsize=8)
    rule_lines(axes)
    if unit == "%":
        axes.set_xlim(-5, 105)


def rule_lines(axes: Axes) -> None:
    """Draws a faint line behind each horizontal bar."""
    axes.grid(axis="y", color="0.93")
    axes.set_axisbelow(True)


def label_lines(axes: Axes, labels: Sequence[str]) -> None:
    """Labels the heights 0, 1, ... of horizontal bars, the first at the top."""
    axes.set_yticks(range(len(labels)), labels, fontsize=8)
    axes.invert_yaxis()
