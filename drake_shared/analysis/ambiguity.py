"""Steps at which the operator's route is not decided yet, and w at these steps.

Fig. 4 of Amirshirzad et al. 2022 shows that the human weight rises where demonstrated paths run together and
separate later. `ambiguity` finds such steps from the demonstrations, from which w comes as well, so that it
checks an implementation. `undecided` finds them from the routes of the scenario and the obstacles that are
still ahead, without the demonstrations, the learner or time.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import rankdata

from drake_shared.demonstrations.progress_clock import TOLERANCE, ProgressClock
from drake_shared.robots import Arm, DiffDrive, Robot, scaled_length
from drake_shared.scenario import Route, Scenario
from drake_shared.simulation.trial import Trial

TOGETHER = 0.15
"""Paths run together within this distance, in [m] for the Pioneer P3-DX."""
SEPARATE = 0.3
"""Paths are separate beyond this distance, in the same unit."""
_POINTS = 501


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Ambiguity:
    """Ambiguous and clear steps of a trial with n applied rows (all but the last).

    Attributes:
        ambiguous: Whether another demonstration at equal progress is within 0.15 m of the robot and later
            separates from its own by over 0.3 m: shape (n,).
        clear: Whether every other demonstration is over 0.3 m away: shape (n,).
        human_weight: w: shape (n,).
    """

    ambiguous: NDArray[np.bool_]
    clear: NDArray[np.bool_]
    human_weight: NDArray[np.float64]


def ambiguity(
    trial: Trial,
    times: NDArray[np.float64],
    demonstrations: NDArray[np.float64],
    *,
    robot: Robot | None = None,
) -> Ambiguity:
    """Finds the ambiguous and the clear steps of ``trial``.

    The robot's own demonstration is the one nearest to its path at equal progress.

    Args:
        trial: A log.
        times: Grid of the demonstrations: shape (N,), in [s].
        demonstrations: Positions on that grid: shape (m, N, D), in [m]; m >= 2.
        robot: Its size scales the distances; the Pioneer P3-DX if None.
    """
    scale = scaled_length(robot or DiffDrive(), 1.0)
    positions = trial.positions[:-1]
    steps = [_progress(times, item, positions, tolerance=scale * TOLERANCE) for item in demonstrations]
    distances = [
        np.linalg.norm(positions - item[step], axis=1).mean()
        for item, step in zip(demonstrations, steps, strict=True)
    ]
    own = int(np.argmin(distances))
    step = steps[own]
    others = [index for index in range(len(demonstrations)) if index != own]
    away = np.linalg.norm(demonstrations[others][:, step] - positions, axis=2)
    # Distances between paths at any time: the same path at another speed does not separate.
    apart = np.stack([cKDTree(demonstrations[index]).query(demonstrations[own])[0] for index in others])
    later = np.maximum.accumulate(apart[:, ::-1], axis=1)[:, ::-1][:, step]
    return Ambiguity(
        ambiguous=((away < scale * TOGETHER) & (later > scale * SEPARATE)).any(axis=0),
        clear=(away > scale * SEPARATE).all(axis=0),
        human_weight=trial["human_weight"][:-1],
    )


def mean_weights(parts: Sequence[Ambiguity]) -> dict[str, float]:
    """Mean w over the ambiguous and over the clear steps of all trials; NaN if there are none."""
    high, low = _weights(parts)
    return {
        "weight_where_ambiguous": float(high.mean()) if high.size else math.nan,
        "weight_where_clear": float(low.mean()) if low.size else math.nan,
    }


def ambiguity_ranking(parts: Sequence[Ambiguity]) -> float:
    """Area under the ROC curve of w as a classifier of ambiguous and clear steps of all trials.

    1 if every ambiguous step has a higher w than every clear one, 0.5 if w is uninformative; NaN if there are
    no steps of one kind.
    """
    return area_under_curve(*_weights(parts))


def undecided(trial: Trial, scenario: Scenario) -> NDArray[np.bool_]:
    """Whether the operator's route is still open at each applied step of ``trial``: shape (n,).

    It is open where another route runs within 0.15 m of the robot, scaled with its size, and passes an
    obstacle that the operator's own route has not passed on the other side; for an arm, where a route to
    another goal runs within 5 cm of the tip. Every step is one or the other.

    Args:
        trial: A log with the route of the operator.
        scenario: Its routes need not have been demonstrated.
    """
    own = scenario.route(trial.metadata["route"])
    if isinstance(scenario.robot, Arm):
        return _undecided_goals(trial, scenario, own)
    positions = trial.positions[:-1, :2]
    path = scenario.points_of(own, _POINTS)
    # The farthest point so far: an operator who swerves does not lose progress.
    reached = np.maximum.accumulate(cKDTree(path).query(positions)[1])
    open_ = np.zeros(len(positions), dtype=bool)
    for route in scenario.routes:
        distance = cKDTree(scenario.points_of(route, _POINTS)).query(positions)[0]
        near = distance < scaled_length(scenario.robot, TOGETHER)
        for item in scenario.static_obstacles:
            if route.sides.get(item.name) != own.sides.get(item.name):
                ahead = reached < cKDTree(path).query([item.x, item.y])[1]
                open_ |= near & ahead
    return open_


def _undecided_goals(trial: Trial, scenario: Scenario, own: Route) -> NDArray[np.bool_]:
    positions = trial.positions[:-1]
    together = scaled_length(scenario.robot, TOGETHER)
    others = [route for route in scenario.routes if scenario.goal_of(route) is not scenario.goal_of(own)]
    near = [cKDTree(scenario.points_of(route, _POINTS)).query(positions)[0] < together for route in others]
    return np.any(near, axis=0) if near else np.zeros(len(positions), dtype=bool)


def area_under_curve(high: NDArray[np.float64], low: NDArray[np.float64]) -> float:
    """Area under the ROC curve: the probability that a value of ``high`` is larger than one of ``low``.

    Equal values count half; NaN if one of the samples is empty.
    """
    if not (high.size and low.size):
        return math.nan
    ranks = rankdata(np.concatenate([high, low]))[: high.size]
    return float((ranks.sum() - high.size * (high.size + 1) / 2) / (high.size * low.size))


def _weights(parts: Sequence[Ambiguity]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """w at the ambiguous steps and at the clear steps of all trials."""
    return (
        np.concatenate([part.human_weight[part.ambiguous] for part in parts]),
        np.concatenate([part.human_weight[part.clear] for part in parts]),
    )


def _progress(
    times: NDArray[np.float64],
    demonstration: NDArray[np.float64],
    positions: NDArray[np.float64],
    *,
    tolerance: float,
) -> NDArray[np.intp]:
    """Index on the grid of the progress along a demonstration at each position: shape (n,)."""
    clock = ProgressClock(times, demonstration[None], tolerance=tolerance)
    reached, steps = 0.0, []
    for position in positions:
        reached = clock.advance(reached, *position)
        steps.append(min(int(times.searchsorted(reached)), len(times) - 1))
    return np.array(steps)
