"""Metrics of a trial and their summary over trials, by the field's names and definitions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from drake_shared.common.errors import InputError
from drake_shared.robots.description import RobotDescription
from drake_shared.scenario.paths import passing_side
from drake_shared.simulation.trial import Trial

Floats = NDArray[np.float64]


class Metrics(TypedDict):
    """Metrics of one trial.

    Norms and differences of commands are in the unit of the robot's commands, [rad/s] for wheels. Undefined
    values are NaN (disagreement without a learner, agreement without human commands, what follows from
    positions or commands with NaN) or None (intent success without a route, clearance without obstacles).

    Attributes:
        success: The goal was reached within its radius by T, without contact.
        intent_success: Success, and every obstacle passed on the side of the intended route.
        collision: Whether the robot touched an obstacle.
        timeout: Whether time ran out before the goal was reached.
        completion_time: From the first human command (in mode "agent": the start) to the goal, in [s]; NaN if
            the goal was not reached.
        human_effort: Integral of the norm of the human command over time (Javdani et al. 2018).
        mean_human_weight, human_weight_variance: Of w; a property of the arbiter, not of the human.
        intervention_share: Share of the time in which the human gives a command.
        disagreement: Sum over steps and elements of abs(human - autonomous) (Amirshirzad et al. 2022).
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
    """

    success: bool
    intent_success: bool | None
    collision: bool
    timeout: bool
    completion_time: float
    human_effort: float
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


class Interval(TypedDict):
    """Mean and 95% interval of a metric over trials; None where it is undefined."""

    mean: float | None
    low: float | None
    high: float | None


def metrics(trial: Trial) -> Metrics:
    """The metrics of one trial, of any robot.

    The last row of a log is not applied and does not count in sums and means.
    """
    robot = trial.robot
    applied = slice(0, len(trial["t"]) - 1)
    period = np.diff(trial["t"])
    human, autonomous = trial.commands("human")[applied], trial.commands("autonomous")[applied]
    shared, weight = trial.commands("shared")[applied], trial["human_weight"][applied]
    reached = trial.status == "reached"
    contact = bool(trial["contact"].any())
    success = reached and not contact
    human_norm = np.linalg.norm(human, axis=1)
    difference = np.abs(human - autonomous).sum(axis=1)
    limits = np.array(robot.command_limits) - 1e-9
    saturated = (np.maximum(np.abs(human), np.abs(autonomous)) >= limits).any(axis=1)
    agreement, agreement_share = _agreement(human, autonomous)
    steps = np.linalg.norm(np.diff(trial.positions, axis=0), axis=1)
    clearance = trial["clearance"]
    obstacles = bool(np.isfinite(clearance).all())
    measured: Metrics = {
        "success": success,
        "intent_success": _intent_success(trial, success),
        "collision": contact,
        "timeout": trial.status == "timed_out",
        "completion_time": _completion_time(trial, robot, human_norm) if reached else math.nan,
        "human_effort": float(human_norm @ period),
        "mean_human_weight": _mean(weight),
        "human_weight_variance": float(np.var(weight)) if weight.size else math.nan,
        "intervention_share": _mean(human_norm > 1e-9),
        "disagreement": float(difference.sum()),
        "disagreement_rate": float(difference @ period / period.sum()) if period.size else math.nan,
        "saturated_share": _mean(np.asarray(saturated)),
        "dissimilarity": _mean(np.linalg.norm(human - shared, axis=1)),
        "agreement": agreement,
        "agreement_share": agreement_share,
        "command_continuity": float(np.abs(np.diff(shared, axis=0)).max(initial=0.0)),
        "weight_continuity": float(np.abs(np.diff(weight)).max(initial=0.0)),
        "path_length": float(steps.sum()),
        "clearance": float(clearance.min()) if obstacles else None,
        "mean_clearance": float(clearance.mean()) if obstacles else None,
        "smoothness": sparc(steps / period, float(np.median(period))) if period.size else math.nan,
    }
    if all(name in trial.columns for name in robot.columns("safe")):
        change = np.linalg.norm(trial.commands("safe")[applied] - shared, axis=1)
        measured["safety_change"], measured["safety_share"] = _mean(change), _mean(np.asarray(change > 0.0))
    return measured


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
        return {"mean": None, "low": None, "high": None}
    mean = float(np.mean(values))
    if all(isinstance(value, bool) for value in values):
        interval = stats.binomtest(sum(values), len(values)).proportion_ci(0.95, method="wilson")
        return {"mean": mean, "low": float(interval.low), "high": float(interval.high)}
    if len(values) < 2:
        return {"mean": mean, "low": None, "high": None}
    half = float(stats.t.ppf(0.975, len(values) - 1) * stats.sem(values))
    return {"mean": mean, "low": mean - half, "high": mean + half}


def _mean(values: NDArray[np.float64] | NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if values.size else math.nan


def _intent_success(trial: Trial, success: bool) -> bool | None:
    # An operator who changes to another route intends that one.
    intended = trial.metadata.get("then") or trial.metadata.get("route")
    if intended is None:
        return None
    routes = {route["name"]: route for route in trial.metadata["scenario"]["routes"]}
    return success and sides_passed(trial) == routes[intended]["sides"]


def _completion_time(trial: Trial, robot: RobotDescription, human_norm: Floats) -> float:
    commanded = np.flatnonzero(human_norm > 1e-9)
    first = 0 if trial.metadata.get("mode") == "agent" or not commanded.size else commanded[0]
    # A trial may continue at the goal until its time is over.
    goal = trial.metadata["scenario"]["goal"]
    names = robot.position_names
    known = [index for index, name in enumerate(names) if name in goal]
    offset = trial.positions[:, known] - [goal[names[index]] for index in known]
    at_goal = np.flatnonzero(np.linalg.norm(offset, axis=1) <= goal["radius"])
    arrived = at_goal[0] if at_goal.size else -1
    return float(trial["t"][arrived] - trial["t"][first])


def _agreement(human: Floats, autonomous: Floats) -> tuple[float, float]:
    norms = np.linalg.norm(human, axis=1) * np.linalg.norm(autonomous, axis=1)
    both = norms > 1e-9
    if not both.any():
        return math.nan, 0.0
    cosine = (human * autonomous).sum(axis=1)[both] / norms[both]
    return float(cosine.mean()), float(both.mean())
