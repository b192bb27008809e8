"""Calibration of an agent's confidence: how often it expects the operator's route, by its confidence."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import ProgressClock
from drake_shared.learners import Learner
from drake_shared.scenario import Scenario
from drake_shared.scenario.paths import passing_side
from drake_shared.simulation.trial import Trial

# A predicted path is on the operator's route if its root mean squared distance to it is less, in [m].
_SAME_ROUTE = 0.15


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ConfidenceSteps:
    """Confidence of the agent at n steps of trials, and whether its prediction was correct.

    Attributes:
        confidence: c_f: shape (n,).
        correct: Whether the predicted path was on the operator's route: shape (n,).
    """

    confidence: NDArray[np.float64]
    correct: NDArray[np.bool_]


def demonstrations_of_routes(scenario: Scenario, learner: Learner) -> dict[str, int]:
    """For each demonstrated route, the index of the first demonstration that passes obstacles alike."""
    found: dict[str, int] = {}
    for index, path in enumerate(() if learner.demonstrations is None else learner.demonstrations):
        sides = {item.name: passing_side(path, (item.x, item.y)) for item in scenario.static_obstacles}
        for route in scenario.routes:
            if route.sides == sides:
                found.setdefault(route.name, index)
    return found


def assess_confidence(learner: Learner, trial: Trial, route: int, *, every: int = 1) -> ConfidenceSteps:
    """Compares the path predicted at each step of ``trial`` with the route that the operator intended.

    The prediction is conditioned on the position alone. It is correct if its root mean squared distance to
    the demonstration of the route, at any time, is less than 0.15 m.

    Args:
        learner: The learner that took part, with its demonstrations.
        trial: The log.
        route: Index of the demonstration of the intended route.
        every: Distance between the assessed steps.

    Raises:
        InputError: The learner does not hold its demonstrations.
    """
    demonstrations = learner.demonstrations
    if demonstrations is None:
        raise InputError("learner", "demonstrations", "must be known to assess its confidence")
    grid = np.asarray(learner.grid)
    clock = ProgressClock(grid, demonstrations) if learner.metadata.get("clock") == "progress" else None
    intended = cKDTree(demonstrations[route])
    now, correct = 0.0, []
    for row, position in enumerate(trial.positions[:-1]):
        now = min(trial["t"][row], grid[-1]) if clock is None else clock.advance(now, *position)
        if row % every:
            continue
        first = min(int(grid.searchsorted(now + 1e-9, side="right")), len(grid) - 1)
        mean, _ = learner.predict(np.array([now]), position[None], grid[first:])
        correct.append(np.sqrt(np.mean(intended.query(mean)[0] ** 2)) < _SAME_ROUTE)
    return ConfidenceSteps(confidence=trial["confidence"][:-1][::every], correct=np.array(correct))


def confidence_calibration(parts: Sequence[ConfidenceSteps], *, bins: int = 10) -> dict[str, Any]:
    """Expected calibration error of c_f over all steps, and the share of confident wrong predictions.

    Returns:
        expected_calibration_error: Mean over steps of |c_f - share correct|, in ``bins`` equal bins of c_f.
        confident_and_wrong: Share of steps with c_f > 0.8 and a wrong prediction.
        bins: For each bin with steps: mean c_f, share correct ("right"), and number of steps.
    """
    confidence = np.concatenate([part.confidence for part in parts])
    correct = np.concatenate([part.correct for part in parts])
    index = np.minimum((confidence * bins).astype(int), bins - 1)
    table = [
        {
            "confidence": float(confidence[index == bin].mean()),
            "right": float(correct[index == bin].mean()),
            "steps": int((index == bin).sum()),
        }
        for bin in np.unique(index).tolist()
    ]
    error = sum(row["steps"] * abs(row["confidence"] - row["right"]) for row in table) / len(confidence)
    return {
        "expected_calibration_error": error,
        "confident_and_wrong": float(((confidence > 0.8) & ~correct).mean()),
        "bins": table,
    }
