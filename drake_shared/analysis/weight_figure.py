"""Figure of the demonstrations' scores and sampling weights (Fig. 5 of Amirshirzad et al. 2022)."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing
from drake_shared.demonstrations import Demonstrations, demonstration_weights, min_score_width
from drake_shared.demonstrations.weights import DEFAULT_WIDTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_weights(
    demonstrations: Demonstrations, path: str | os.PathLike[str], *, width: float = DEFAULT_WIDTH
) -> None:
    """Writes a PNG file: demonstrations with an opacity by weight, and the density over their scores.

    Raises:
        InputError: A demonstration has no score, or the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    draw_weights_on(left, right, demonstrations, width=width)
    left.set(title="demonstrations")
    right.set(title="sampling weights")
    if len(demonstrations) <= 12:
        left.legend(
            fontsize="x-small", loc="upper left", bbox_to_anchor=(-0.05, -0.3), ncols=3, frameon=False
        )
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=120)


def draw_weights_on(
    left: Axes,
    right: Axes,
    demonstrations: Demonstrations,
    *,
    previous: int = 0,
    width: float = DEFAULT_WIDTH,
) -> None:
    """Draws the same on given axes.

    Args:
        left: For the demonstrations, each labelled with its score and probability.
        right: For the density.
        demonstrations: All with scores.
        previous: Number of demonstrations, from the first, to draw dashed.
        width: Of `demonstration_weights`.

    Raises:
        InputError: A demonstration has no score.
    """
    scores = demonstrations.scores
    if scores is None:
        raise InputError(demonstrations.source, "scores", "are needed for the figure of sampling weights")
    weights = demonstration_weights(demonstrations, width=width)
    for index, (item, weight) in enumerate(zip(demonstrations, weights, strict=True)):
        label = f"{index}: score {scores[index]:.3f}, drawn {100 * weight:.0f}%"
        color, strength = f"C{index % 10}", min(0.2 + 0.8 * weight / weights.max(), 1.0)
        style = "--" if index < previous else "-"
        left.plot(*item.positions.T, style, color=color, alpha=strength, label=label)
        right.plot([scores[index]] * 2, [0, weight], color=color, linewidth=4)
    # The density, scaled to pass through the top of each bar.
    best = int(np.argmax(scores))
    least = min_score_width(demonstrations)
    reach = max(float(np.ptp(scores)), least)
    fine = np.linspace(scores.min() - 0.3 * reach, scores.max() + 0.3 * reach, 200)
    sigma = max(width * float(np.std(scores)), least)
    right.plot(fine, weights[best] * np.exp(-0.5 * ((fine - scores[best]) / sigma) ** 2), color="0.6")
    left.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    right.set(xlabel="score", ylabel="sampling probability", ylim=(0, None))
