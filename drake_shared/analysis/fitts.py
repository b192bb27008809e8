"""Throughput of aimed movements (Fitts' law), with effective targets as in ISO 9241-411."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.scenario import Scenario, scenario_from_dict
from drake_shared.simulation.log import Trial

# Width that holds 96% of normally distributed end points, in standard deviations.
_WIDTH = math.sqrt(2.0 * math.pi * math.e)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Throughput:
    """Throughput over the targets of a task.

    Attributes:
        throughput: Mean over the targets, in [bit/s]; NaN if one of them was selected less than twice, since
            its end points then have no deviation.
        selected: Share of the trials in which the target was selected.
    """

    throughput: float
    selected: float


def throughput(trials: Iterable[Trial], *, dwell: float = 0.5) -> Throughput:
    """Throughput of the movements to the targets of a scenario, from logs.

    A target is selected when the position has been inside it for ``dwell``. The throughput of a target is
    log2(A / W + 1) / T, where A is the mean distance moved along the line from start to target, W is 4.133
    standard deviations of the end points along it, and T is the mean time from the first human command to the
    selection (ISO 9241-411:2012; Soukoreff and MacKenzie 2004).

    Args:
        trials: Of one scenario, each with a route to its target, and long enough to stay there: config.end
            "duration".
        dwell: In [s].

    Raises:
        InputError: There are no trials, or one has no route.
    """
    moves: dict[str, list[tuple[float, float]]] = {}
    count, given = 0, None
    for trial in trials:
        # Reading a scenario takes as long as half a trial.
        if trial.metadata["scenario"] != given:
            given = trial.metadata["scenario"]
            scenario = scenario_from_dict(given)
        count += 1
        route = trial.metadata.get("route")
        if route is None:
            raise InputError(f"trial {count}", "route", "must be given: it leads to the target")
        found = _movement(trial, scenario, route, dwell)
        moves.setdefault(route, [])
        if found is not None:
            moves[route].append(found)
    if not moves:
        raise InputError("throughput", "trials", "must be at least one")
    return Throughput(
        throughput=float(np.mean([_of_target(np.array(selections)) for selections in moves.values()])),
        selected=sum(map(len, moves.values())) / count,
    )


def _of_target(moves: NDArray[np.float64]) -> float:
    """Throughput of movements (n, 2): distance along the line to the target, in [m], and time, in [s]."""
    if len(moves) < 2:
        return math.nan
    amplitude, time = moves.mean(axis=0).tolist()
    width = _WIDTH * moves[:, 0].std(ddof=1)
    throughput: float = math.log2(amplitude / width + 1.0) / time
    return throughput


def _movement(trial: Trial, scenario: Scenario, route: str, dwell: float) -> tuple[float, float] | None:
    """Distance moved along the line to the target, in [m], and the time, in [s]; None without selection."""
    goal = scenario.goal_of(scenario.route(route))
    target = np.array(goal.position(trial.robot.position_names))
    positions, time = trial.positions, trial["t"]
    inside = np.linalg.norm(positions - target, axis=1) <= goal.radius
    rows = np.arange(len(time))
    # Where the tip came in last, at each row inside.
    entered = np.maximum.accumulate(np.where(inside, 0, rows + 1)).clip(max=rows[-1])
    selected = np.flatnonzero(inside & (time - time[entered] >= dwell - 1e-9))
    if not selected.size:
        return None
    row = selected[0]
    along = (target - positions[0]) / np.linalg.norm(target - positions[0])
    first = np.argmax(trial.commands("human").any(axis=1))
    return float((positions[row] - positions[0]) @ along), float(time[row] - time[first])
