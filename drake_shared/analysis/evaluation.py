"""Accuracy and calibration of a learner's predictions."""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from drake_shared.common.arrays import path_at
from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners import Learner

COVERAGES = (0.5, 0.9, 0.95)
_LEVELS = np.linspace(0.05, 0.95, 19)
# Number of intervals of the time to the end that are evaluated separately.
_PARTS = 5


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class PredictionErrors:
    """Errors of predictions of the rest of a demonstration from one observed point; m predicted points.

    Attributes:
        error: True minus mean position: shape (m, D), in [m].
        sigma: Predicted standard deviation: shape (m, D), in [m].
        case: Index from 0 of the observation that each point was predicted from: shape (m,).
        to_end: Time from each observation to the end: shape (cases,), in [s].
    """

    error: NDArray[np.float64]
    sigma: NDArray[np.float64]
    case: NDArray[np.intp]
    to_end: NDArray[np.float64]


def prediction_errors(
    learner: Learner, demonstrations: Demonstrations, *, noise: float = 0.0, every: int = 5, seed: int = 0
) -> PredictionErrors:
    """Conditions ``learner`` on one point of a demonstration at a time and predicts all later points.

    Args:
        learner: The learner to evaluate.
        demonstrations: Held out, or those that it was trained on.
        noise: Standard deviation of the noise on the observed point, in [m] per axis.
        every: Distance between observations, in points of the learner's grid.
        seed: For the noise.

    Raises:
        InputError: ``noise`` is negative or not finite, or no demonstration has two points within the
            learner's time.
    """
    if not (math.isfinite(noise) and noise >= 0):
        raise InputError("evaluate", "noise", "must be finite and not negative", noise)
    rng = np.random.default_rng(seed)
    grid = np.asarray(learner.grid)
    errors, sigmas, cases = [], [], []
    to_end: list[float] = []
    for item in demonstrations:
        times = grid[(grid >= item.times[0]) & (grid <= item.times[-1])]
        path = path_at(item.positions, item.times, times)
        for step in range(0, len(times) - 1, every):
            observed = path[step] + noise * rng.standard_normal(path.shape[1])
            mean, variance = learner.predict(times[step : step + 1], observed[None], times[step + 1 :])
            errors.append(path[step + 1 :] - mean)
            sigmas.append(np.sqrt(variance))
            cases.append(np.full(len(mean), len(to_end)))
            to_end.append(times[-1] - times[step])
    if not to_end:
        raise InputError(demonstrations.source, "t", "must have two points within the learner's time")
    return PredictionErrors(
        error=np.concatenate(errors),
        sigma=np.concatenate(sigmas),
        case=np.concatenate(cases),
        to_end=np.array(to_end),
    )


def evaluate(found: PredictionErrors) -> dict[str, Any]:
    """Accuracy and calibration over all predicted points, and by time to the end.

    Returns:
        nll: Mean of -log p(position), in nats; the density is per m^D.
        ade, fde: Mean distance of mean and true position, over all points and at the last one, in [m].
        crps: Continuous ranked probability score, mean over axes, in [m] (Gneiting and Raftery 2007).
        coverage50, coverage90, coverage95: Share of the coordinates of true positions inside the central
            interval.
        coverage90_of_points, ...: Share of true positions inside the ellipse that should hold that share.
        coverage90_of_paths, ...: Share of observations after which all later positions are inside their
            ellipses; no intervals of single points hold whole paths that often.
        reliability: The share inside at each of 19 levels.
        scale: The factor on standard deviations that maximises the likelihood of the errors.
        by_time_to_end: The same for each fifth of the task, the nearest to the end first.
    """
    result: dict[str, Any] = {**_scores(found, np.ones(len(found.case), dtype=bool))}
    z = np.abs(found.error / found.sigma)
    result["reliability"] = {
        "level": _LEVELS.tolist(),
        "covered": [float((z < norm.ppf(0.5 + level / 2)).mean()) for level in _LEVELS],
    }
    result["scale"] = sigma_scale(found)
    edges = np.linspace(0.0, found.to_end.max(), _PARTS + 1)
    parts = []
    for low, high in itertools.pairwise(edges):
        cases = (found.to_end > low) & (found.to_end <= high)
        chosen = cases[found.case]
        if chosen.any():
            parts.append({"from": float(low), "to": float(high), **_scores(found, chosen)})
    result["by_time_to_end"] = parts
    return result


def sigma_scale(found: PredictionErrors) -> float:
    """The factor on all standard deviations that maximises the likelihood of the errors."""
    return float(np.sqrt(np.mean((found.error / found.sigma) ** 2)))


def _scores(found: PredictionErrors, chosen: NDArray[np.bool_]) -> dict[str, float]:
    error, sigma, case = found.error[chosen], found.sigma[chosen], found.case[chosen]
    z = error / sigma
    distance = np.linalg.norm(error, axis=1)
    last = np.append(np.diff(case) != 0, True)
    crps = sigma * (z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / math.sqrt(math.pi))
    nll = (0.5 * z**2 + np.log(sigma) + 0.5 * math.log(2 * math.pi)).sum(axis=1)
    outside = (z**2).sum(axis=1)
    covered = {}
    for level in COVERAGES:
        name = f"coverage{round(100 * level)}"
        inside = outside < chi2.ppf(level, z.shape[1])
        # Points of one case follow each other.
        whole = np.minimum.reduceat(inside, np.flatnonzero(np.append(True, np.diff(case) != 0)))
        covered[name] = float((np.abs(z) < norm.ppf(0.5 + level / 2)).mean())
        covered[f"{name}_of_points"] = float(inside.mean())
        covered[f"{name}_of_paths"] = float(whole.mean())
    return {
        "nll": float(nll.mean()),
        "ade": float(distance.mean()),
        "fde": float(distance[last].mean()),
        "crps": float(crps.mean()),
        **covered,
    }


def draw_reliability(result: dict[str, Any], path: str | os.PathLike[str]) -> None:
    """Writes the reliability diagram and the errors by time to the end as a PNG file.

    Raises:
        InputError: The folder cannot be written to.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    reliability = result["reliability"]
    left.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    left.plot(reliability["level"], reliability["covered"], marker="o", markersize=3)
    left.set(
        xlabel="central interval",
        ylabel="share of true positions inside",
        xlim=(0, 1),
        ylim=(0, 1),
        aspect="equal",
    )
    left.set_title("reliability: above the line, sigma is too large")
    parts = result["by_time_to_end"]
    middle = [(part["from"] + part["to"]) / 2 for part in parts]
    right.plot(middle, [part["ade"] for part in parts], marker="o", label="ADE, m")
    right.plot(middle, [part["crps"] for part in parts], marker="s", label="CRPS, m")
    right.set(xlabel="time to the end, s", ylabel="m", ylim=(0, None))
    right.set_title("prediction errors")
    right.legend(frameon=False)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=120)
