"""How the figures of a report look: one colour for one thing, told apart by the colour-blind too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from drake_shared.scenario import Scenario, obstacles

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# The palette of Okabe and Ito 2008.
BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = (
    *("#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7"),
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
"""Of a scenario's routes, in their order."""
WIDTH = 8.0
"""Of a figure, in inches."""
_BAND_STEP = 0.1
"""Between the points of a band's edge, in [m] along the path."""


def new_figure(height: float, *, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Figure, Any]:
    """A figure of the report's width with its axes, as `matplotlib.figure.Figure.subplots` gives them.

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
    """One legend for all axes of a figure, below them.

    Args:
        figure: Of `new_figure`.
        handles, labels: What is explained, and by what words; default: those that the handles have.
        columns: How many entries stand side by side.
    """
    words = [handle.get_label() for handle in handles] if labels is None else labels
    figure.legend(handles, words, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)


def draw_scene(axes: Axes, scenario: Scenario) -> None:
    """Obstacles, start and goal from above, in [m], to scale."""
    from matplotlib.patches import Circle

    for obstacle in scenario.obstacles:
        axes.add_patch(obstacle_patch(obstacle))
    goal = scenario.goal
    axes.add_patch(Circle((goal.x, goal.y), goal.radius, facecolor="none", edgecolor=GREEN, linestyle="--"))
    axes.plot(scenario.start.x, scenario.start.y, marker="o", color=BLACK, markersize=4)
    axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")


def obstacle_patch(obstacle: Any):
    """The outline of an obstacle from above."""
    import math

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
    axes: Axes, mean: np.ndarray, sigma: np.ndarray, colour: str, label: str | None = None, **line: Any
) -> None:
    """An expected path (N, 2) in [m] in a band of one standard deviation (N, 2) across it to either side.

    Args:
        axes: Where to draw.
        mean, sigma: Finite.
        colour, label: Of the path.
        line: Other properties of its line.
    """
    import numpy as np

    # Where the path hardly moves it has no direction.
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(mean, axis=0), axis=1))])
    kept = np.unique(np.floor(way / _BAND_STEP), return_index=True)[1]
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
    estimates: Sequence[Any],
    colour: str,
    label: str | None = None,
    **line: Any,
) -> None:
    """Means as a curve in the band of their intervals; ``estimates`` are those of `statistics.interval`.

    Args:
        axes: Where to draw.
        at: Of each estimate its place, shape (n,).
        estimates, colour, label: Of the curve.
        line: Other properties of its line.
    """
    edges = [one.low for one in estimates], [one.high for one in estimates]
    axes.fill_between(at, *edges, color=colour, alpha=0.18, linewidth=0)
    own = {"marker": "o", "markersize": 3, "linewidth": 1.4, "label": label, **line}
    axes.plot(at, [one.mean for one in estimates], color=colour, **own)


def draw_estimates(
    axes: Axes, at: Sequence[float], estimates: Sequence[Any], colour: str, label: str | None = None
) -> None:
    """Means with their intervals as points with bars; ``estimates`` are those of `statistics.interval`."""
    mean = [one.mean for one in estimates]
    bars = [[one.mean - one.low for one in estimates], [one.high - one.mean for one in estimates]]
    axes.errorbar(
        at, mean, yerr=bars, color=colour, marker="o", markersize=4, capsize=2, linewidth=1.2, label=label
    )
