"""How good a learner's predictions are, and how honest its spread and its confidence."""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import norm

from drake_shared.common.arrays import path_at
from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners import Learner
from drake_shared.scenario import Scenario
from drake_shared.scenario.paths import passing_side
from drake_shared.simulation.trial import Trial

COVERAGES = (0.5, 0.9, 0.95)
_LEVELS = np.linspace(0.05, 0.95, 19)
# Times to the end are told apart in so many parts of the task.
_PARTS = 5
# A predicted way is the driver's if it strays from it by less than this, in [m]: root mean square.
_SAME_WAY = 0.15


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Predictions:
    """What a learner said, after one point each, of the rest of each demonstration; m points in all.

    Attributes:
        error: Shape (m, 2), truth - mean, in [m].
        sigma: Shape (m, 2), predicted standard deviation, in [m].
        case: Shape (m,), which condition each point belongs to; conditions are numbered from 0.
        to_end: Shape (cases,), time from the condition to the end, in [s].
    """

    error: np.ndarray
    sigma: np.ndarray
    case: np.ndarray
    to_end: np.ndarray


def predictions(
    learner: Learner, demonstrations: Demonstrations, *, noise: float = 0.0, every: int = 5, seed: int = 0
) -> Predictions:
    """Conditions ``learner`` on one point of each demonstration at a time, and asks for all that follows.

    Args:
        learner: Any.
        demonstrations: Held out, or those that it was taught.
        noise: Standard deviation of the noise on the point shown, in [m] per axis.
        every: A condition at every so many points of the learner's grid.
        seed: Of the noise.

    Raises:
        InputError: ``noise`` is negative or not finite, or nothing follows any condition.
    """
    if not (math.isfinite(noise) and noise >= 0):
        raise InputError("evaluate", "noise", "must be finite and not negative", noise)
    rng = np.random.default_rng(seed)
    grid = np.asarray(learner.grid)
    errors, sigmas, cases = [], [], []
    ends: list[float] = []
    for item in demonstrations:
        inside = grid[(grid >= item.times[0]) & (grid <= item.times[-1])]
        path = path_at(item.positions, item.times, inside)
        for step in range(0, len(inside) - 1, every):
            shown = path[step] + noise * rng.standard_normal(2)
            mean, variance = learner.predict(inside[step : step + 1], shown[None], inside[step + 1 :])
            errors.append(path[step + 1 :] - mean)
            sigmas.append(np.sqrt(variance))
            cases.append(np.full(len(mean), len(ends)))
            ends.append(inside[-1] - inside[step])
    if not ends:
        raise InputError(demonstrations.source, "t", "must have two points within the learner's time")
    return Predictions(
        error=np.concatenate(errors),
        sigma=np.concatenate(sigmas),
        case=np.concatenate(cases),
        to_end=np.array(ends),
    )


def evaluate(found: Predictions) -> dict[str, Any]:
    """Measures of predictions: over all, and by time to the end.

    Returns:
        nll: Mean of -log p(x, y), in nats, of a density per m^2.
        ade, fde: Mean distance of the mean from the truth, over all points and at the last one, in [m].
        crps: Continuous ranked probability score, mean of x and y, in [m] (Gneiting and Raftery 2007).
        coverage50, coverage90, coverage95: Share of truths inside the central interval, per axis.
        reliability: The share inside at each of 19 levels.
        scale: What standard deviations must be multiplied by to fit the errors best (by likelihood).
        by_time_to_end: The same for each fifth of the task, the nearest to the end first.
    """
    result: dict[str, Any] = {**_measures(found, np.ones(len(found.case), dtype=bool))}
    z = np.abs(found.error / found.sigma)
    result["reliability"] = {
        "level": _LEVELS.tolist(),
        "covered": [float((z < norm.ppf(0.5 + level / 2)).mean()) for level in _LEVELS],
    }
    result["scale"] = recalibration(found)
    edges = np.linspace(0.0, found.to_end.max(), _PARTS + 1)
    parts = []
    for low, high in itertools.pairwise(edges):
        cases = (found.to_end > low) & (found.to_end <= high)
        chosen = cases[found.case]
        if chosen.any():
            parts.append({"from": float(low), "to": float(high), **_measures(found, chosen)})
    result["by_time_to_end"] = parts
    return result


def recalibration(found: Predictions) -> float:
    """The factor on all standard deviations that makes the errors likeliest."""
    return float(np.sqrt(np.mean((found.error / found.sigma) ** 2)))


def _measures(found: Predictions, chosen: np.ndarray) -> dict[str, float]:
    error, sigma, case = found.error[chosen], found.sigma[chosen], found.case[chosen]
    z = error / sigma
    distance = np.linalg.norm(error, axis=1)
    last = np.append(np.diff(case) != 0, True)
    crps = sigma * (z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / math.sqrt(math.pi))
    nll = (0.5 * z**2 + np.log(sigma) + 0.5 * math.log(2 * math.pi)).sum(axis=1)
    covered = {
        f"coverage{round(100 * level)}": float((np.abs(z) < norm.ppf(0.5 + level / 2)).mean())
        for level in COVERAGES
    }
    return {
        "nll": float(nll.mean()),
        "ade": float(distance.mean()),
        "fde": float(distance[last].mean()),
        "crps": float(crps.mean()),
        **covered,
    }


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Confidence:
    """Steps of trials: how sure the agent was, and whether it was right.

    Attributes:
        confidence: Shape (n,), c_f.
        right: Shape (n,), whether the way that it expected was the driver's.
    """

    confidence: np.ndarray
    right: np.ndarray


def ways_of(scenario: Scenario, learner: Learner) -> dict[str, int]:
    """For each route, the index of a demonstration that passes every obstacle on its side; the first of them.

    A route that was not demonstrated is not there.
    """
    ways: dict[str, int] = {}
    for index, path in enumerate(() if learner.demonstrations is None else learner.demonstrations):
        sides = {item.name: passing_side(path, (item.x, item.y)) for item in scenario.static_obstacles}
        for route in scenario.routes:
            if route.sides == sides:
                ways.setdefault(route.name, index)
    return ways


def judge_confidence(learner: Learner, trial: Trial, route: int, *, every: int = 1) -> Confidence:
    """Asks at every step of ``trial`` whether the agent expected the way of the demonstration ``route``.

    It did if the way that it expected from the pose alone strays from that demonstration's, whenever that
    came by, less than 0.15 m (root mean square).

    Args:
        learner: The one that took part, with its demonstrations.
        trial: Its log.
        route: Index of the demonstration of the route that the operator meant.
        every: Look at every so many steps.

    Raises:
        InputError: The learner does not tell its demonstrations.
    """
    from drake_shared.demonstrations import ProgressClock

    demonstrations = learner.demonstrations
    if demonstrations is None:
        raise InputError("learner", "demonstrations", "must be known to judge its confidence")
    grid = np.asarray(learner.grid)
    clock = ProgressClock(grid, demonstrations) if learner.metadata.get("clock") == "progress" else None
    way = cKDTree(demonstrations[route])
    now, right = 0.0, []
    rows = range(len(trial["t"]) - 1)
    for row in rows:
        x, y = trial["x"][row], trial["y"][row]
        now = min(trial["t"][row], grid[-1]) if clock is None else clock.advance(now, x, y)
        if row % every:
            continue
        first = min(int(grid.searchsorted(now + 1e-9, side="right")), len(grid) - 1)
        mean, _ = learner.predict(np.array([now]), np.array([[x, y]]), grid[first:])
        right.append(np.sqrt(np.mean(way.query(mean)[0] ** 2)) < _SAME_WAY)
    return Confidence(confidence=trial["confidence"][:-1][::every], right=np.array(right))


def calibration_of_confidence(parts: Sequence[Confidence], *, bins: int = 10) -> dict[str, Any]:
    """Expected calibration error of c_f over all steps, and how much of the time it was sure and wrong.

    Returns:
        expected_calibration_error: Mean over steps of |c_f - share right|, in ``bins`` equal bins of c_f.
        confident_and_wrong: Share of steps with c_f > 0.8 at which the agent expected another way.
        bins: For each bin that has steps: mean c_f, share right, and number of steps.
    """
    confidence = np.concatenate([part.confidence for part in parts])
    right = np.concatenate([part.right for part in parts])
    index = np.minimum((confidence * bins).astype(int), bins - 1)
    table = [
        {
            "confidence": float(confidence[index == bin].mean()),
            "right": float(right[index == bin].mean()),
            "steps": int((index == bin).sum()),
        }
        for bin in range(bins)
        if (index == bin).any()
    ]
    error = sum(row["steps"] * abs(row["confidence"] - row["right"]) for row in table) / len(confidence)
    return {
        "expected_calibration_error": error,
        "confident_and_wrong": float(((confidence > 0.8) & ~right).mean()),
        "bins": table,
    }


def draw_reliability(result: dict[str, Any], path: str | os.PathLike[str]) -> None:
    """Writes the reliability diagram, and errors against time to the end, as a PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    reliability = result["reliability"]
    left.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    left.plot(reliability["level"], reliability["covered"], marker="o", markersize=3)
    left.set(xlabel="interval", ylabel="share of truths inside", xlim=(0, 1), ylim=(0, 1), aspect="equal")
    left.set_title("reliability: above the line is too wide")
    parts = result["by_time_to_end"]
    middle = [(part["from"] + part["to"]) / 2 for part in parts]
    right.plot(middle, [part["ade"] for part in parts], marker="o", label="ADE, m")
    right.plot(middle, [part["crps"] for part in parts], marker="s", label="CRPS, m")
    right.set(xlabel="time to the end, s", ylabel="m", ylim=(0, None))
    right.set_title("errors of the prediction")
    right.legend(frameon=False)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=120)
