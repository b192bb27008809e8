"""Scores of demonstrations, and the probabilities with which training samples them."""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.errors import InputError
from drake_shared.demonstrations.trajectories import Demonstrations

Scorer = Callable[[NDArray[np.float64]], float]
"""Takes the positions (n, D) of one demonstration in [m]; the higher the result the better."""

DEFAULT_WIDTH = 2.0
"""Of the density over scores, in standard deviations of the scores."""
# Of the extent of the demonstrations; scores that differ by less count as equal.
_MIN_WIDTH = 0.01


def sampling_weights(
    scores: ArrayLike, width: float | None = None, *, min_width: float = 0.05
) -> NDArray[np.float64]:
    """Sampling probabilities Pd of Alg. 1, line 3, of Amirshirzad et al. 2022.

    A normal density over scores, centred on the best one, normalized over the demonstrations.

    Args:
        scores: Shape (m,), m >= 1; the higher the better, of either sign.
        width: Standard deviation of the density, in the unit of the scores, positive. Default: twice the
            standard deviation of the scores (ddof 0), `DEFAULT_WIDTH`, at least ``min_width``.
        min_width: Least default width, in the unit of the scores.

    Returns:
        Shape (m,), summing to 1. Equal scores give equal weights.

    Raises:
        InputError: A score is not finite, there are none, or the width is not positive and finite.
    """
    values = np.array(scores, dtype=float)
    if values.ndim != 1 or not len(values):
        raise InputError("scores", "", "must be a list of at least one number", f"shape {values.shape}")
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InputError("scores", f"demonstration {bad[0]}", "must be finite", values[bad[0]])
    if width is None:
        width = max(DEFAULT_WIDTH * float(values.std()), min_width)
    if not (np.isfinite(width) and width > 0.0):
        raise InputError("scores", "width", "must be positive and finite", width)
    density: NDArray[np.float64] = np.exp(-0.5 * np.square((values - values.max()) / width))
    density /= density.sum()
    return density


def demonstration_weights(
    demonstrations: Demonstrations, *, weighted: bool = True, width: float = DEFAULT_WIDTH
) -> NDArray[np.float64]:
    """Sampling probabilities of demonstrations, shape (m,): `sampling_weights` of their scores.

    The width of the density is at least a hundredth of the demonstrations' extent, so that a task of another
    size has the same weights. They are even if ``weighted`` is False or a score is unknown.

    Args:
        demonstrations: At least one.
        weighted: Whether scores weight them.
        width: Of the density, in standard deviations of the scores (ddof 0), positive. The smaller it is, the
            more the best demonstration outweighs the others.

    Raises:
        InputError: A score, or the width, is not finite, or the width is not positive.
    """
    if not (np.isfinite(width) and width > 0.0):
        raise InputError("scores", "width", "must be positive and finite", width)
    scores = demonstrations.scores
    if scores is None or not weighted:
        return np.full(len(demonstrations), 1.0 / len(demonstrations))
    least = min_score_width(demonstrations)
    return sampling_weights(scores, max(width * float(np.std(scores)), least))


def min_score_width(demonstrations: Demonstrations) -> float:
    """The ``min_width`` of `demonstration_weights`, in [m]; positive."""
    return _MIN_WIDTH * demonstrations.extent or 1e-3


def score_demonstrations(demonstrations: Demonstrations, scorer: Scorer) -> Demonstrations:
    """Returns the demonstrations with the scores that ``scorer`` gives to their positions.

    Raises:
        InputError: A score is not a finite number.
    """
    scored = []
    for index, item in enumerate(demonstrations):
        score = scorer(item.positions)
        try:
            value = float(score)
        except (TypeError, ValueError):
            value = np.nan
        if not np.isfinite(value):
            raise InputError(
                demonstrations.source, f"score of demonstration {index}", "must be finite", score
            )
        scored.append(dataclasses.replace(item, score=value))
    return dataclasses.replace(demonstrations, items=tuple(scored))


def load_scorer(name: str) -> Scorer:
    """Imports the scorer that "module:function" names.

    Raises:
        InputError: The name has another form, or there is no such function.
    """
    module_name, _, function_name = name.partition(":")
    if not (module_name and function_name):
        raise InputError("score", "", 'must be "module:function"', repr(name))
    try:
        scorer: Scorer = getattr(importlib.import_module(module_name), function_name)
    except (ImportError, AttributeError) as error:
        raise InputError("score", name, f"must be a function that can be imported ({error})") from error
    if not callable(scorer):
        raise InputError("score", name, "must be callable", type(scorer).__name__)
    return scorer
