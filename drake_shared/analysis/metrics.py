"""Metrics of a trial and their summary over trials, by the field's names and definitions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NotRequired, TypedDict, cast

import numpy as np
from numpy.typing import NDArray
from scipy import signal, stats

from drake_shared.common.errors import InputError
from drake_shared.scenario.paths import passing_side
from drake_shared.simulation.trial import Trial

Floats = NDArray[np.float64]
# Prominence of a correction, as a share of the limit of the command.
_LEAST_TURN = 0.05


class Metrics(TypedDict):
    """Metrics of one trial.

    Norms and differences of commands are in the unit of the robot's commands, [rad/s] for wheels. Undefined
    values are NaN (disagreement without a learner, agreement without human commands, what follows from
    positions or commands with NaN) or None (intent success without a route, clearance without obstacles).

    Attributes:
        success: A goal was reached within its radius by T, without contact.
        intent_success: Success at the goal of the intended route, with every obstacle passed on its side.
        wrong_goal: Whether the robot reached another goal than that of the intended route.
        collision: Whether the robot touched an obstacle.
        timeout: Whether time ran out before a goal was reached.
        completion_time: From the first human command (in mode "agent": the start) to the goal, in [s]; NaN if
            the goal was not reached, so that means are over successes, and a late start costs nothing.
        human_effort: Integral of the norm of the human command over time (Javdani et al. 2018). For wheels
            it is nearly proportional to the path length, with help or without.
        excess_effort: The same less that of the shared command, which the path needs: how much harder the
            human pushed than the robot drove.
        input_work: Sum of the norms of the changes of the human command from step to step.
        corrections: Turning points of the human command that stand out by over 5% of its limit, per element.
        mean_human_weight, human_weight_variance: Of w; a property of the arbiter, not of the human.
        intervention_share: Share of the time in which the human gives a command.
        disagreement: Sum over steps and elements of abs(human - autonomous) (Amirshirzad et al. 2022). It
            grows with the number of steps: compare it at one period and duration, and otherwise its rate.
        disagreement_rate: The same, integrated over time and divided by the duration.
        saturated_share: Share of steps at which an element of either command is at its limit.
        dissimilarity: Mean norm of human - shared.
        agreement: Mean cosine of the angle between human and autonomous command.
        agreement_share: Share of steps that agreement is computed from: both commands are not zero.
        command_continuity: Largest change of an element of the shared command in one step.
        weight_continuity: Largest change of w in one step.
        path_length: In [m].
        clearance, mean_clearance: Least and mean distance of the body to the nearest obstacle, in [m].
        smoothness: Spectral arc length of the speed (Balasubramanian et al. 2015), negative; nearer 0 is
            smoother.
        safety_change: Mean norm of safe - shared; only with a safety filter. Not part of the dissimilarity.
        safety_share: Share of steps at which safe and shared differ; only with a safety filter.
        plane_switches: Number of switches between the planes x-y and y-z of an arm's tip; only with an arm.
    """

    success: bool
    intent_success: bool | None
    wrong_goal: bool | None
    collision: bool
    timeout: bool
    completion_time: float
    human_effort: float
    excess_effort: float
    input_work: float
    corrections: float
    mean_human_weight: float
    human_weight_variance: float
    intervention_share: float
    disagreement: float
    disagreement_rate: float
    saturated_share: float
    dissimilarity: float
    agreement: float
    agreement_share: float
    command_continuity: float
    weight_continuity: float
    path_length: float
    clearance: float | None
    mean_clearance: float | None
    smoothness: float
    safety_change: NotRequired[float]
    safety_share: NotRequired[float]
    plane_switches: NotRequired[float]


class Interval(TypedDict):
    """Mean and 95% interval of a metric over trials; None where it is undefined.

    ``n`` is the number of trials in which it is defined: completion times are of successes only.
    """

    mean: float | None
    low: float | None
    high: float | None
    n: int


def metrics(trial: Trial) -> Metrics:
    """The metrics of one trial, of any robot.

    The last row of a log is not applied and does not count in sums and means.
    """
    return metrics_of([trial])[0]


def metrics_of(trials: Sequence[Trial]) -> list[Metrics]:
    """`metrics` of each of many trials of one robot, with the same columns, many times as fast.

    Those of a trial do not depend on the others.
    """
    if not trials:
        return []
    rows = _Rows(trials)
    human, autonomous, shared = (rows.commands(who) for who in ("human", "autonomous", "shared"))
    weight, reached = rows.column("human_weight"), [trial.status == "reached" for trial in trials]
    contact = [bool(trial["contact"].any()) for trial in trials]
    success = [goal and not touched for goal, touched in zip(reached, contact, strict=True)]
    human_norm = _norm(human)
    difference = sum(np.abs(own - other) for own, other in zip(human, autonomous, strict=True))
    limits = [limit - 1e-9 for limit in trials[0].robot.command_limits]
    saturated = np.any(
        [
            np.maximum(np.abs(own), np.abs(other)) >= limit
            for own, other, limit in zip(human, autonomous, limits, strict=True)
        ],
        axis=0,
    )
    mean_weight = rows.mean(weight)
    speeds = rows.steps / np.where(rows.applied, rows.period, 1.0)
    duration = np.where(rows.counts, rows.sum(rows.period), math.nan)
    columns: dict[str, list[Any]] = {
        "success": success,
        "intent_success": [_intent_success(*pair) for pair in zip(trials, success, strict=True)],
        "wrong_goal": [_wrong_goal(trial) for trial in trials],
        "collision": contact,
        "timeout": [trial.status == "timed_out" for trial in trials],
        "completion_time": [
            _completion_time(trial, norm) if goal else math.nan
            for trial, goal, norm in zip(trials, reached, rows.cut(human_norm), strict=True)
        ],
        "human_effort": rows.sum(human_norm * rows.period).tolist(),
        "excess_effort": rows.sum((human_norm - _norm(shared)) * rows.period).tolist(),
        "input_work": rows.changes(human).tolist(),
        "corrections": np.mean(
            [rows.turning_points(own, limit) for own, limit in zip(human, limits, strict=True)], axis=0
        ).tolist(),
        "mean_human_weight": mean_weight.tolist(),
        "human_weight_variance": rows.mean(np.square(weight - mean_weight[:, None])).tolist(),
        "intervention_share": rows.mean(human_norm > 1e-9).tolist(),
        "disagreement": rows.sum(difference).tolist(),
        "disagreement_rate": (rows.sum(difference * rows.period) / duration).tolist(),
        "saturated_share": rows.mean(saturated).tolist(),
        "dissimilarity": rows.mean(
            _norm([own - made for own, made in zip(human, shared, strict=True)])
        ).tolist(),
    }
    columns["agreement"], columns["agreement_share"] = (
        part.tolist() for part in rows.agreement(human, autonomous)
    )
    columns["command_continuity"] = np.max([rows.largest_change(part) for part in shared], axis=0).tolist()
    columns["weight_continuity"] = rows.largest_change(weight).tolist()
    columns["path_length"] = rows.sum(rows.steps).tolist()
    # All rows count here: the last one is a place where the robot is.
    gaps = [gap if np.isfinite(gap := trial["clearance"]).all() else None for trial in trials]
    columns["clearance"] = [None if gap is None else float(gap.min()) for gap in gaps]
    columns["mean_clearance"] = [None if gap is None else float(gap.mean()) for gap in gaps]
    columns["smoothness"] = [
        sparc(speed, float(np.median(period))) if len(period) else math.nan
        for speed, period in zip(rows.cut(speeds), rows.cut(rows.period), strict=True)
    ]
    if all(name in trials[0].columns for name in trials[0].robot.columns("safe")):
        change = _norm([safe - made for safe, made in zip(rows.commands("safe"), shared, strict=True)])
        columns["safety_change"] = rows.mean(change).tolist()
        columns["safety_share"] = rows.mean(change > 0.0).tolist()
    if "plane_switches" in trials[0].columns:
        columns["plane_switches"] = [float(trial["plane_switches"][-1]) for trial in trials]
    return [
        cast(Metrics, dict(zip(columns, values, strict=True)))
        for values in zip(*columns.values(), strict=True)
    ]


class _Rows:
    """The applied rows of n trials as arrays (n, T), all but the last row of each trial; 0 beyond its end.

    Sums are accumulated: the order of a sum over an axis, and so its last bits, depends on its length.
    """

    def __init__(self, trials: Sequence[Trial]) -> None:
        self._trials = trials
        self._robot = trials[0].robot
        self.counts = np.array([len(trial["t"]) - 1 for trial in trials])
        """Shape (n,), number of applied rows."""
        self.applied = np.arange(max(int(self.counts.max()), 1)) < self.counts[:, None]
        """Shape (n, T): which rows there are."""
        self.period = self._filled([np.diff(trial["t"]) for trial in trials])
        """Shape (n, T), of each row, in [s]."""
        moved = [np.diff(trial.positions, axis=0) for trial in trials]
        self.steps = self._filled([np.linalg.norm(offsets, axis=1) for offsets in moved])
        """Shape (n, T), how far the robot moves in each row, in [m]."""

    def column(self, name: str) -> Floats:
        """The values of a column."""
        return self._filled([trial[name][:-1] for trial in self._trials])

    def commands(self, who: str) -> list[Floats]:
        """The elements of a command."""
        return [self.column(name) for name in self._robot.columns(who)]

    def cut(self, values: Floats) -> list[Floats]:
        """The rows of each trial."""
        return [row[:count] for row, count in zip(values, self.counts.tolist(), strict=True)]

    def sum(self, values: Any) -> Floats:
        """Sum over the rows of each trial, shape (n,)."""
        total: Floats = np.cumsum(np.where(self.applied, values, 0.0), axis=1)[:, -1]
        return total

    def mean(self, values: Any) -> Floats:
        """Mean over the rows of each trial, shape (n,); NaN without rows."""
        return self.sum(values) / np.where(self.counts, self.counts, math.nan)

    def largest_change(self, values: Floats) -> Floats:
        """Largest change from row to row of each trial, shape (n,); 0 without one."""
        change = np.where(self.applied[:, 1:], np.abs(np.diff(values, axis=1)), 0.0)
        largest: Floats = change.max(axis=1, initial=0.0)
        return largest

    def changes(self, elements: Sequence[Floats]) -> Floats:
        """Sum of the norms of the changes of a command from row to row of each trial, shape (n,)."""
        change = _norm([np.diff(element, axis=1) for element in elements])
        total: Floats = np.where(self.applied[:, 1:], change, 0.0).sum(axis=1)
        return total

    def turning_points(self, values: Floats, limit: float) -> Floats:
        """Number of peaks and valleys of each trial with a prominence above 5% of a limit, shape (n,)."""
        least = _LEAST_TURN * limit
        return np.array(
            [
                sum(len(signal.find_peaks(sign * row, prominence=least)[0]) for sign in (1.0, -1.0))
                if np.isfinite(row).all()
                else math.nan
                for row in self.cut(values)
            ]
        )

    def agreement(self, a: Sequence[Floats], b: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Mean cosine of the angle between two commands where neither is zero, and the share of such rows."""
        norms = _norm(a) * _norm(b)
        both = self.applied & (norms > 1e-9)
        cosine = sum(x * y for x, y in zip(a, b, strict=True)) / np.where(both, norms, 1.0)
        known = both.sum(axis=1)
        mean = self.sum(np.where(both, cosine, 0.0)) / np.where(known, known, math.nan)
        return mean, known / np.maximum(self.counts, 1)

    def _filled(self, rows: Sequence[NDArray[Any]]) -> Floats:
        """Shape (n, T), from the rows of each trial."""
        values = np.zeros(self.applied.shape)
        values[self.applied] = np.concatenate(rows)
        return values


def sides_passed(trial: Trial) -> dict[str, str]:
    """The side, "left" or "right", on which the robot passed each static obstacle, by the obstacle's name.

    Rows without a finite position are ignored; without any other row the result is empty.
    """
    positions = trial.positions[np.isfinite(trial.positions).all(axis=1)]
    obstacles = [item for item in trial.metadata["scenario"]["obstacles"] if not item.get("path")]
    if not len(positions):
        return {}
    return {item["name"]: passing_side(positions, (item["x"], item["y"])) for item in obstacles}


def sparc(speed: Floats, period: float, *, cutoff: float = 10.0, threshold: float = 0.05) -> float:
    """Spectral arc length of a speed profile (Balasubramanian, Melendez-Calderon, Roby-Brami, Burdet 2015).

    Args:
        speed: Shape (n,), in any unit.
        period: Sampling period, in [s].
        cutoff: Highest frequency used, in [Hz].
        threshold: The normalised spectrum is used up to the last frequency at which it reaches this value.

    Returns:
        The negative arc length of the normalised spectrum; nearer 0 is smoother. NaN if the speed
        is zero throughout or not finite.
    """
    if speed.size < 2 or not np.any(speed) or not np.isfinite(speed).all():
        return math.nan
    size = 2 ** (math.ceil(math.log2(speed.size)) + 4)
    spectrum = np.abs(np.fft.rfft(speed, size))
    frequency = np.fft.rfftfreq(size, period)
    spectrum = spectrum[frequency <= cutoff] / spectrum.max()
    frequency = frequency[frequency <= cutoff]
    last = int(np.flatnonzero(spectrum >= threshold)[-1]) + 1
    spectrum, frequency = spectrum[:last], frequency[:last]
    if last < 2:
        return 0.0
    return -float(np.hypot(np.diff(frequency) / (frequency[-1] - frequency[0]), np.diff(spectrum)).sum())


def summarize(rows: Sequence[Mapping[str, object]]) -> dict[str, Interval]:
    """Mean and 95% interval of each metric over trials.

    Shares, such as that of successful trials, get Wilson's interval, other metrics Student's. NaN, None and
    values that are not numbers are left out.

    Raises:
        InputError: There are no trials.
    """
    if not rows:
        raise InputError("summary", "trials", "must be at least one")
    summary = {}
    for name in rows[0]:
        values = [value for value in (row[name] for row in rows) if isinstance(value, bool | int | float)]
        summary[name] = _interval([value for value in values if math.isfinite(value)])
    return summary


def _interval(values: Sequence[bool | float]) -> Interval:
    if not values:
        return {"mean": None, "low": None, "high": None, "n": 0}
    n, mean = len(values), float(np.mean(values))
    if all(isinstance(value, bool) for value in values):
        interval = stats.binomtest(sum(values), len(values)).proportion_ci(0.95, method="wilson")
        return {"mean": mean, "low": float(interval.low), "high": float(interval.high), "n": n}
    if n < 2:
        return {"mean": mean, "low": None, "high": None, "n": n}
    half = float(stats.t.ppf(0.975, n - 1) * stats.sem(values))
    return {"mean": mean, "low": mean - half, "high": mean + half, "n": n}


def _intended_route(trial: Trial) -> Mapping[str, Any] | None:
    # An operator who changes to another route intends that one.
    intended = trial.metadata.get("then") or trial.metadata.get("route")
    routes = trial.metadata["scenario"]["routes"]
    return next((route for route in routes if route["name"] == intended), None)


def _goals(trial: Trial) -> list[Mapping[str, Any]]:
    """Those of the scenario; logs of single goals, and old ones, have no list."""
    scenario = trial.metadata["scenario"]
    return scenario.get("goals") or [scenario["goal"]]


def _goal_of(trial: Trial, route: Mapping[str, Any]) -> Mapping[str, Any]:
    x, y, *_ = route["waypoints"][-1]
    return min(_goals(trial), key=lambda goal: math.hypot(goal["x"] - x, goal["y"] - y))


def _wrong_goal(trial: Trial) -> bool | None:
    route = _intended_route(trial)
    if route is None:
        return None
    if trial.status != "reached" or len(_goals(trial)) == 1:
        return False
    goal = _goal_of(trial, route)
    return not bool(_distance_to(trial, goal)[-1] <= goal["radius"])


def _distance_to(trial: Trial, goal: Mapping[str, Any]) -> Floats:
    """Shape (rows,), in [m]."""
    known = [name for name in trial.robot.position_names if name in goal]
    return _norm([trial[name] - goal[name] for name in known])


def _intent_success(trial: Trial, success: bool) -> bool | None:
    route = _intended_route(trial)
    if route is None:
        return None
    if _wrong_goal(trial):
        return False
    goal, meant, driven = _goal_of(trial, route), route["sides"], sides_passed(trial)
    between = _between(trial.metadata["scenario"], goal)
    return success and all(driven.get(name) == meant[name] for name in between if name in meant)


def _between(scenario: Mapping[str, Any], end: Mapping[str, Any]) -> list[str]:
    """Names of the static obstacles that lie between start and a goal; the others are not passed.

    On which side a robot stops before an obstacle behind the goal is a matter of centimetres.
    """
    start, goal = ([place[name] for name in ("x", "y")] for place in (scenario["start"], end))
    ahead = np.subtract(goal, start)
    return [
        item["name"]
        for item in scenario["obstacles"]
        if not item.get("path") and 0.0 <= np.subtract([item["x"], item["y"]], start) @ ahead <= ahead @ ahead
    ]


def _completion_time(trial: Trial, human_norm: Floats) -> float:
    commanded = np.flatnonzero(human_norm > 1e-9)
    first = 0 if trial.metadata.get("mode") == "agent" or not commanded.size else commanded[0]
    # A trial may continue at the goal until its time is over.
    arrivals = [_distance_to(trial, goal) <= goal["radius"] for goal in _goals(trial)]
    at_goal = np.flatnonzero(np.any(arrivals, axis=0))
    arrived = at_goal[0] if at_goal.size else -1
    return float(trial["t"][arrived] - trial["t"][first])


def _norm(elements: Sequence[Floats]) -> Floats:
    """Euclidean norms of vectors that are given by their elements."""
    norm: Floats = np.sqrt(sum(np.square(element) for element in elements))
    return norm
