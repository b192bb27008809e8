"""Fit of a simulated operator to recorded trials: skill, delay, noise and yielding.

The fit is by maximum likelihood, see `drake_shared.analysis.operator_likelihood`. A fit to a person models
these drives, with its goodness of fit, and does not predict that person's behaviour elsewhere.

Ten trials determine the delay to about 10 ms. Skill is less certain, since errors to correct arise only from
noise or the agent; its confidence interval shows how much.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy import optimize, stats

from drake_shared.analysis.operator_likelihood import (
    DriveLikelihood,
    Floats,
    Optimum,
    maximize_likelihood,
)
from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import LONGEST_DELAY
from drake_shared.robots import DiffDrive
from drake_shared.scenario import Route, Scenario, scenario_from_dict
from drake_shared.scenario.paths import Path
from drake_shared.simulation.trial import Trial
from drake_shared.systems.surrogate_operator import SurrogateOperator

FITTED = ("skill", "delay", "noise", "noise_time", "yielding")
# Steps of the coarse and the fine search for the delay, in [s].
_COARSE, _FINE = 0.1, 0.01
_YIELDING = np.linspace(0.0, 0.96, 25)
_SPEED_STEP = 0.1
_SPEED_FACTORS = np.arange(0.5, 2.01, _SPEED_STEP)
# Least standard deviation of the commands, and least correction of an error, in [rad/s], that tell anything:
# those of a straight line are zero but for rounding.
_LEAST_VARIATION = 1e-6
# Yielding is undefined if the human weight never falls below 1 by more than this.
_LEAST_ASSISTANCE = 0.02
_LEAST_MOTION = 0.08
"""Least distance moved, as a share of the length of the route."""
# Spacing of path points, in [m], with which the likelihood is smooth. A simulated operator steers by the
# coarser points of `Scenario.path_of`. Its steps from point to point would look like white noise, and make
# the noise seem shorter than it is: the last searches use them as well, in the end in steps of the delay so
# small that few steps of the operator fall on other points.
_SPACING = 0.0005
_NEAR = ((0.02, 0.0025), (0.004, 0.0005))
"""How far from the best delay, and in which steps, the last searches go, in [s]."""
# Speed factors around the best, with which yielding varies in the jackknife.
_SPEEDS_NEAR = np.linspace(-0.03, 0.03, 25)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Estimate:
    """A fitted value with its 95% jackknife interval over trials.

    The interval is None for a single trial, and where the value is not known without one of the trials.
    """

    value: float
    low: float | None = None
    high: float | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class OperatorFit:
    """The simulated operator of maximum likelihood.

    Attributes:
        simulated: Whether the trials were driven by a simulated operator; otherwise by a person.
        trials, steps: Number of trials, and of their steps with an informative command.
        skill, delay, noise, noise_time, yielding: As in :class:`drake_shared.operators.behaviour.Behaviour`.
            Yielding is None if there was no assistance.
        speed_factor: As there; the same for all trials.
        explained: Share of the variance of the commands that the law explains without noise.
        explained_a_step_ahead: The same for the prediction from the commands up to the previous step.
    """

    simulated: bool
    trials: int
    steps: int
    skill: Estimate
    delay: Estimate
    noise: Estimate
    noise_time: Estimate
    yielding: Estimate | None
    speed_factor: float
    explained: float
    explained_a_step_ahead: float


def fit_operator(trials: Sequence[Trial], *, names: Sequence[str] | None = None) -> OperatorFit:
    """Fits a simulated operator to the trials of one operator.

    Args:
        trials: Of a differential drive, in mode "shared" or "human", of one scenario, one preset and one type
            of operator, each with its intended route.
        names: Of the trials, for errors.

    Raises:
        InputError: The trials do not meet these conditions, hold too little motion, or do not determine a
            parameter: commands that do not vary, or no error to correct.
    """
    if not trials:
        raise InputError("fit", "trials", "must be at least one")
    names = names or [f"trial {index}" for index in range(len(trials))]
    _check(trials, names)
    scenario = scenario_from_dict(trials[0].metadata["scenario"], source=f"{names[0]}: scenario")
    names_and_trials = list(zip(trials, names, strict=True))
    _check_motion(names_and_trials, scenario)

    def likelihoods(path_of: Callable[[Route], Path]) -> list[DriveLikelihood]:
        return [
            DriveLikelihood(trial, scenario, path_of(scenario.route(trial.metadata["route"])), name)
            for trial, name in names_and_trials
        ]

    drives = likelihoods(lambda route: route.path(scenario.start, spacing=_SPACING))
    _check_variation(drives, names)
    assisted = min(drive.least_weight for drive in drives) < 1.0 - _LEAST_ASSISTANCE
    yielding = _YIELDING if assisted else _YIELDING[:1]

    def search(delays: Floats, yielding: Floats, speed_factor: float) -> tuple[Floats, Optimum]:
        sums = np.stack([drive.sums(delays, yielding, speed_factor) for drive in drives])
        return sums, maximize_likelihood(sums.sum(axis=0), delays, yielding)

    def cost_of(speed_factor: float) -> float:
        return search(np.array([best.delay]), yielding, speed_factor)[1].cost

    # The speed factor and the delay hardly depend on each other. The likelihood may have several maxima over
    # the speed factor, since long-lasting noise explains a wrong one.
    speed_factor = 1.0
    for _ in range(2):
        _, best = search(np.arange(_COARSE, LONGEST_DELAY + 1e-9, _COARSE), yielding, speed_factor)
        for drive in drives:
            drive.select_informative(best.yielding)
        near_by = min(_SPEED_FACTORS, key=cost_of) + np.array([-_SPEED_STEP, _SPEED_STEP])
        found = optimize.minimize_scalar(cost_of, bounds=near_by, options={"xatol": 1e-4})
        speed_factor = float(found.x)
    low, high = max(best.delay - _COARSE, 0.0), min(best.delay + _COARSE, LONGEST_DELAY)
    _, best = search(np.linspace(low, high, round((high - low) / _FINE) + 1), yielding, speed_factor)
    # The steps of the delay are now so small that its interval comes from the trials and not from the grid.
    drives = likelihoods(scenario.path_of)
    for drive in drives:
        drive.select_informative(best.yielding)
    if assisted:
        around = best.yielding + np.linspace(-_YIELDING[1], _YIELDING[1], 33)
        yielding = around[(around >= 0.0) & (around < 1.0)]
    for near, step in _NEAR:
        bounds = speed_factor + _SPEEDS_NEAR[[0, -1]]
        speed_factor = float(optimize.minimize_scalar(cost_of, bounds=bounds, options={"xatol": 1e-5}).x)
        delays = best.delay + np.arange(-near, near + 1e-9, step)
        delays = delays[(delays >= 0.0) & (delays <= LONGEST_DELAY)]
        sums, best = search(delays, yielding, speed_factor)

    period = scenario.control_period
    fitted = best.behaviour(period)
    others = [item.behaviour(period) for item in _without_each(sums, delays, yielding)]
    for name, value in fitted.items():
        if not math.isfinite(value):
            raise InputError(_all(names), name, "cannot be told from these drives; add drives with turns")
    estimates = {name: _jackknife(fitted[name], [item[name] for item in others]) for name in FITTED}
    if assisted:
        # An operator who yields more and means to go faster gives nearly the same commands.
        estimates["yielding"] = _jackknife_yielding(drives, best, speed_factor, yielding)
    law, ahead, steps = (
        sum(item)
        for item in zip(*(drive.squared_errors(best, speed_factor) for drive in drives), strict=True)
    )
    commands = np.concatenate([drive.commands[drive.informative] for drive in drives])
    variation = float(((commands - commands.mean(axis=0)) ** 2).sum())
    return OperatorFit(
        simulated=_simulated(trials[0]),
        trials=len(trials),
        steps=int(steps),
        skill=estimates["skill"],
        delay=estimates["delay"],
        noise=estimates["noise"],
        noise_time=estimates["noise_time"],
        yielding=estimates["yielding"] if assisted else None,
        speed_factor=speed_factor,
        explained=1.0 - law / variation,
        explained_a_step_ahead=1.0 - ahead / variation,
    )


def _jackknife_yielding(
    drives: Sequence[DriveLikelihood], best: Optimum, speed_factor: float, yielding: Floats
) -> Estimate:
    """Yielding, with an interval in which the speed factor varies too."""
    speeds, delay = speed_factor + _SPEEDS_NEAR, np.array([best.delay])
    sums = np.array([[drive.sums(delay, yielding, float(speed))[0] for speed in speeds] for drive in drives])
    return _jackknife(best.yielding, [item.yielding for item in _without_each(sums, speeds, yielding)])


def _without_each(sums: Floats, grid: Floats, yielding: Floats) -> list[Optimum]:
    """Fits without each trial in turn, for the jackknife; none if one of the trials is needed."""
    if len(sums) == 1:
        return []
    found = [maximize_likelihood(sums.sum(axis=0) - one, grid, yielding) for one in sums]
    return found if all(math.isfinite(item.skill) for item in found) else []


def _jackknife(value: float, others: Sequence[float]) -> Estimate:
    """Interval of a value from the values without each trial in turn."""
    count = len(others)
    if count < 2:
        return Estimate(value=value)
    half = float(stats.t.ppf(0.975, count - 1)) * math.sqrt(count - 1) * float(np.std(others))
    return Estimate(value=value, low=max(value - half, 0.0), high=value + half)


def _simulated(trial: Trial) -> bool:
    return bool(trial.metadata.get("operator") == SurrogateOperator.__name__)


def _check(trials: Sequence[Trial], names: Sequence[str]) -> None:
    first = trials[0].metadata
    for trial, name in zip(trials, names, strict=True):
        metadata = trial.metadata
        if trial.robot.type != DiffDrive.__name__:
            expected = "must be a differential drive: the fitted law steers wheels"
            raise InputError(name, "robot", expected, trial.robot.type)
        if metadata.get("mode") not in ("shared", "human"):
            raise InputError(
                name,
                "mode",
                "must be shared or human, so that an operator steers",
                repr(metadata.get("mode")),
            )
        if metadata.get("operator") == "RecordedInput":
            raise InputError(name, "operator", "must react to the robot: a recording does not")
        if metadata.get("route") is None:
            raise InputError(name, "route", "must be given: the fit needs the intended route")
        if metadata.get("then") is not None:
            raise InputError(
                name, "then", "must not be given: the fit needs a single route", repr(metadata["then"])
            )
        for field in ("scenario", "preset", "operator"):
            if metadata.get(field) != first.get(field):
                raise InputError(name, field, f"must be that of {names[0]}")
        finite = np.isfinite(np.hstack([trial.positions, trial.commands("human")])).all(axis=1)
        if not finite.all():
            where = f"row {int(np.argmin(finite))}"
            raise InputError(name, where, "must hold a position and a human command without NaN")


def _check_motion(trials: Sequence[tuple[Trial, str]], scenario: Scenario) -> None:
    for trial, name in trials:
        least = _LEAST_MOTION * scenario.path_of(scenario.route(trial.metadata["route"])).length
        if np.linalg.norm(np.diff(trial.positions, axis=0), axis=1).sum() < least:
            raise InputError(name, "", f"must hold motion of at least {least:.2g} m")


def _check_variation(drives: Sequence[DriveLikelihood], names: Sequence[str]) -> None:
    commands = np.concatenate([drive.commands[drive.informative] for drive in drives])
    if commands.std(axis=0).max() < _LEAST_VARIATION:
        expected = (
            "must hold human commands that vary: constant ones tell neither skill nor delay; add drives with "
            "turns"
        )
        raise InputError(_all(names), "", expected)
    if max(drive.largest_correction for drive in drives) < _LEAST_VARIATION:
        expected = (
            "cannot be told from these drives: the robot never left its straight route, so that there was no "
            "error to correct; add drives with turns"
        )
        raise InputError(_all(names), "skill", expected)


def _all(names: Sequence[str]) -> str:
    """What names all trials in an error."""
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"


def settings_of(trials: Sequence[Trial]) -> dict[str, Any]:
    """The true values of the fitted parameters that are the same in all trials of simulated operators."""
    settings = {}
    for name in FITTED:
        values = {trial.metadata.get("behaviour", {}).get(name) for trial in trials}
        if len(values) == 1 and None not in values:
            settings[name] = values.pop()
    return settings
