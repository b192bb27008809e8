"""What a log says: the measures of a trial, by the names and definitions of the field."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats

from drake_shared.common.errors import InputError
from drake_shared.scenario.paths import passing_side
from drake_shared.simulation.trial import Trial


def metrics(trial: Trial) -> dict[str, Any]:
    """All measures of one trial.

    The last row of a log is not applied and does not count in sums and means. What cannot be said is NaN
    (disagreement without a learner, agreement where nobody gave a command) or None (intent success where no
    route was instructed, clearance without obstacles).

    Returns:
        success: Goal reached within its radius by T, without contact.
        intent_success: Success, and past every obstacle on the side of the route that was meant.
        collision, timeout: Whether the robot touched an obstacle; whether time ran out on the way.
        completion_time: From the first command of the human (in mode "agent": the start) to the goal, in
            [s]; NaN if it was not reached.
        human_effort: Integral of the norm of the human command over time, in [rad] (Javdani et al. 2018).
        mean_human_weight, human_weight_variance: Of w; a property of the arbiter, not of the human.
        intervention_share: Share of the time in which the human gives a command.
        disagreement: Sum over steps of abs(human - autonomous) of both wheels, in [rad/s], the measure of
            Amirshirzad et al. 2022; disagreement_rate: the same integrated and per second, in [rad/s].
        saturated_share: Share of steps at which either command is at the wheels' limit.
        dissimilarity: Mean norm of human - shared, in [rad/s].
        agreement: Mean cosine of human and autonomous command; agreement_share: the share of steps that it
            speaks of (both commands not zero).
        command_continuity, weight_continuity: Largest change of the shared command, in [rad/s], and of w in
            one step.
        path_length: In [m]; clearance, mean_clearance: least and mean distance of the body to the nearest
            obstacle, in [m].
        safety_change, safety_share: Mean norm of safe - shared, in [rad/s], and the share of steps at which
            they differ; only of trials with a safety filter. No part of the dissimilarity.
        smoothness: SPARC of the speed (Balasubramanian et al. 2015), negative, nearer 0 is smoother.
    """
    applied = slice(0, len(trial["t"]) - 1)
    period = np.diff(trial["t"])
    human, autonomous = trial.commands("human")[applied], trial.commands("autonomous")[applied]
    shared, weight = trial.commands("shared")[applied], trial["human_weight"][applied]
    reached = trial.status == "reached"
    contact = bool(trial["contact"].any())
    gap = np.abs(human - autonomous).sum(axis=1)
    human_norm = np.linalg.norm(human, axis=1)
    limit = wheel_limit(trial)
    saturated = np.maximum(np.abs(human), np.abs(autonomous)).max(axis=1, initial=0.0) >= limit - 1e-9
    agreement, agreement_share = _agreement(human, autonomous)
    steps = np.diff(trial.positions, axis=0)
    success = reached and not contact
    clearance = trial["clearance"]
    filtered = {}
    if "safe_left" in trial.columns:
        changed = np.linalg.norm(trial.commands("safe")[applied] - shared, axis=1)
        filtered = {"safety_change": _mean(changed), "safety_share": _mean(changed > 0.0)}
    return {
        "success": success,
        "intent_success": _intent_success(trial, success),
        "collision": contact,
        "timeout": trial.status == "timed_out",
        "completion_time": _completion_time(trial, human_norm) if reached else math.nan,
        "human_effort": float(human_norm @ period),
        "mean_human_weight": _mean(weight),
        "human_weight_variance": float(np.var(weight)) if weight.size else math.nan,
        "intervention_share": _mean(human_norm > 1e-9),
        "disagreement": float(gap.sum()),
        "disagreement_rate": float(gap @ period / period.sum()) if period.size else math.nan,
        "saturated_share": _mean(saturated),
        "dissimilarity": _mean(np.linalg.norm(human - shared, axis=1)),
        "agreement": agreement,
        "agreement_share": agreement_share,
        "command_continuity": float(np.abs(np.diff(shared, axis=0)).max(initial=0.0)),
        "weight_continuity": float(np.abs(np.diff(weight)).max(initial=0.0)),
        "path_length": float(np.hypot(*steps.T).sum()),
        "clearance": float(clearance.min()) if np.isfinite(clearance).all() else None,
        "mean_clearance": float(clearance.mean()) if np.isfinite(clearance).all() else None,
        "smoothness": sparc(np.hypot(*steps.T) / period, float(np.median(period)))
        if period.size
        else math.nan,
        **filtered,
    }


def sides_passed(trial: Trial) -> dict[str, str]:
    """The side, "left" or "right", on which the robot passed each obstacle that stands, by name."""
    obstacles = [item for item in trial.metadata["scenario"]["obstacles"] if not item.get("path")]
    return {item["name"]: passing_side(trial.positions, (item["x"], item["y"])) for item in obstacles}


def sparc(speed: np.ndarray, period: float, *, cutoff: float = 10.0, threshold: float = 0.05) -> float:
    """Spectral arc length of a speed profile (Balasubramanian, Melendez-Calderon, Roby-Brami, Burdet 2015).

    Args:
        speed: Shape (n,), in any unit.
        period: Between samples, in [s].
        cutoff: Highest frequency looked at, in [Hz].
        threshold: The spectrum counts up to the last frequency at which it, normalised, is above this.

    Returns:
        The negative arc length of the normalised spectrum; nearer 0 is smoother. NaN if nothing moves.
    """
    if speed.size < 2 or not np.any(speed):
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


def summarize(rows: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, float | None]]:
    """Mean and 95% interval of each measure over trials.

    Shares (of trials that succeed, say) get Wilson's interval, other measures Student's. Trials that say
    nothing of a measure do not count in it.

    Raises:
        InputError: There are no trials.
    """
    if not rows:
        raise InputError("summary", "trials", "must be at least one")
    summary = {}
    for name in rows[0]:
        values = [row[name] for row in rows if isinstance(row[name], bool | int | float)]
        values = [value for value in values if math.isfinite(value)]
        summary[name] = _interval(values)
    return summary


def _interval(values: Sequence[bool | float]) -> dict[str, float | None]:
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


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if values.size else math.nan


def wheel_limit(trial: Trial) -> float:
    """The fastest that a wheel of the trial's robot turns, in [rad/s]."""
    robot = trial.metadata["scenario"]["robot"]
    return robot["max_speed"] / robot["wheel_radius"]


def _intent_success(trial: Trial, success: bool) -> bool | None:
    # Who changes to another route on the way means that one.
    meant = trial.metadata.get("then") or trial.metadata.get("route")
    if meant is None:
        return None
    routes = {route["name"]: route for route in trial.metadata["scenario"]["routes"]}
    return success and sides_passed(trial) == routes[meant]["sides"]


def _completion_time(trial: Trial, human_norm: np.ndarray) -> float:
    given = np.flatnonzero(human_norm > 1e-9)
    first = 0 if trial.metadata.get("mode") == "agent" or not given.size else given[0]
    # A trial may go on at the goal until its time is over.
    goal = trial.metadata["scenario"]["goal"]
    away = np.hypot(*(trial.positions - (goal["x"], goal["y"])).T)
    there = np.flatnonzero(away <= goal["radius"])
    arrived = there[0] if there.size else -1
    return float(trial["t"][arrived] - trial["t"][first])


def _agreement(human: np.ndarray, autonomous: np.ndarray) -> tuple[float, float]:
    norms = np.linalg.norm(human, axis=1) * np.linalg.norm(autonomous, axis=1)
    both = norms > 1e-9
    if not both.any():
        return math.nan, 0.0
    cosine = (human * autonomous).sum(axis=1)[both] / norms[both]
    return float(cosine.mean()), float(both.mean())
