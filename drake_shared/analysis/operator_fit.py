"""Fit of a simulated operator to recorded trials: skill, delay, noise and yielding.

Of the operator of an arm it is found as well whether it follows the route or aims ahead, which has a distance
in place of a skill, and how long it takes to switch planes.

The fit is by maximum likelihood, see `drake_shared.analysis.operator_likelihood`. A fit to a person models
these drives, with its goodness of fit, and does not predict that person's behaviour elsewhere.

Ten trials determine the delay to about 10 ms. Skill is less certain, since errors to correct arise only from
noise or the agent; its confidence interval shows how much.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import optimize, stats

from drake_shared.analysis.operator_drives import TipDrive, WheelDrive
from drake_shared.analysis.operator_fit_checks import all_of, check_motion, check_trials, check_variation
from drake_shared.analysis.operator_likelihood import (
    DriveLikelihood,
    Floats,
    Optimum,
    maximize_likelihood,
)
from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import LONGEST_DELAY
from drake_shared.robots import Arm
from drake_shared.scenario import Scenario, scenario_from_dict
from drake_shared.scenario.space_path import SpacePath
from drake_shared.simulation.trial import Trial
from drake_shared.systems.surrogate_operator import SurrogateOperator
from drake_shared.systems.tip_operator import TipOperator

FITTED = ("skill", "aim_ahead", "delay", "noise", "noise_time", "yielding", "plane_switch_time")
# Steps of the coarse and the fine search for the delay, in [s].
_COARSE, _FINE = 0.1, 0.01
_YIELDING = np.linspace(0.0, 0.96, 25)
_SPEED_STEP = 0.1
_SPEED_FACTORS = np.arange(0.5, 2.01, _SPEED_STEP)
# Distances ahead at which an operator of an arm may aim, in [m], and how far from the best one is searched.
_AIMS, _AIM_STEP = (0.04, 0.08, 0.12, 0.16, 0.2), 0.04
# Yielding is undefined if the human weight never falls below 1 by more than this.
_LEAST_ASSISTANCE = 0.02
# Spacing of path points, in [m], with which the likelihood is smooth. A simulated operator steers by the
# coarser points of `Scenario.path_of`. Its steps from point to point would look like white noise, and make
# the noise seem shorter than it is: the last searches use them as well, in the end in steps of the delay so
# small that few steps of the operator fall on other points.
_SPACING = 0.0005
_FINE_POINTS = 4001
"""Number of points of an arm's path with which the likelihood is smooth."""
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
        skill, aim_ahead, delay, noise, noise_time, yielding, plane_switch_time: As in
            :class:`drake_shared.operators.behaviour.Behaviour`. Skill is None of an operator who aims ahead,
            and that distance of one who does not; yielding is None if there was no assistance, and the time
            of a switch if there was none.
        speed_factor: As there; the same for all trials.
        explained: Share of the variance of the commands that the law explains without noise.
        explained_a_step_ahead: The same for the prediction from the commands up to the previous step.
    """

    simulated: bool
    trials: int
    steps: int
    skill: Estimate | None
    aim_ahead: Estimate | None
    delay: Estimate
    noise: Estimate
    noise_time: Estimate
    yielding: Estimate | None
    plane_switch_time: Estimate | None
    speed_factor: float
    explained: float
    explained_a_step_ahead: float


def fit_operator(trials: Sequence[Trial], *, names: Sequence[str] | None = None) -> OperatorFit:
    """Fits a simulated operator to the trials of one operator.

    Args:
        trials: Of a differential drive or an arm, in mode "shared" or "human", of one scenario, one preset
            and one type of operator, each with its intended route.
        names: Of the trials, for errors.

    Raises:
        InputError: The trials do not meet these conditions, hold too little motion, or do not determine a
            parameter: commands that do not vary, or no error to correct.
    """
    if not trials:
        raise InputError("fit", "trials", "must be at least one")
    names = names or [f"trial {index}" for index in range(len(trials))]
    check_trials(trials, names)
    scenario = scenario_from_dict(trials[0].metadata["scenario"], source=f"{names[0]}: scenario")
    check_motion(trials, names, scenario)
    drives = _drives(trials, names, scenario, spacing=_SPACING)
    check_variation(drives, names)
    assisted = min(drive.least_weight for drive in drives) < 1.0 - _LEAST_ASSISTANCE
    yielding = _YIELDING if assisted else _YIELDING[:1]

    def search(delays: Floats, yielding: Floats, speed_factor: float) -> tuple[Floats, Optimum]:
        sums = np.stack([drive.sums(delays, yielding, speed_factor) for drive in drives])
        return sums, maximize_likelihood(sums.sum(axis=0), delays, yielding, has_skill=drives[0].has_skill)

    def cost_of(speed_factor: float) -> float:
        return search(np.array([best.delay]), yielding, speed_factor)[1].cost

    def cost_of_aim(distance: float) -> float:
        _aim(drives, distance)
        return cost_of(speed_factor)

    # The speed factor and the delay hardly depend on each other. The likelihood may have several maxima over
    # the speed factor, since long-lasting noise explains a wrong one.
    found: list[tuple[float, float | None, Optimum, float]] = []
    for aim in _aims(drives, names):
        _aim(drives, aim)
        speed_factor = 1.0
        for _ in range(2):
            _, best = search(np.arange(_COARSE, LONGEST_DELAY + 1e-9, _COARSE), yielding, speed_factor)
            for drive in drives:
                drive.select_informative(best.yielding)
            near_by = min(_SPEED_FACTORS, key=cost_of) + np.array([-_SPEED_STEP, _SPEED_STEP])
            nearest = optimize.minimize_scalar(cost_of, bounds=near_by, options={"xatol": 1e-4})
            speed_factor = float(nearest.x)
        found.append((float(nearest.fun), aim, best, speed_factor))
    _, aim, best, speed_factor = min(found, key=lambda item: item[0])
    _aim(drives, aim)
    low, high = max(best.delay - _COARSE, 0.0), min(best.delay + _COARSE, LONGEST_DELAY)
    delays = np.linspace(low, high, round((high - low) / _FINE) + 1)
    sums, best = search(delays, yielding, speed_factor)
    smooth = _without_each(sums, delays, yielding, has_skill=drives[0].has_skill)
    # The steps of the delay are now so small that its interval comes from the trials and not from the grid.
    drives = _drives(trials, names, scenario)
    _aim(drives, aim)
    for drive in drives:
        drive.select_informative(best.yielding)
    if assisted:
        around = best.yielding + np.linspace(-_YIELDING[1], _YIELDING[1], 33)
        yielding = around[(around >= 0.0) & (around < 1.0)]
    for near, step in _NEAR:
        bounds = speed_factor + _SPEEDS_NEAR[[0, -1]]
        speed_factor = float(optimize.minimize_scalar(cost_of, bounds=bounds, options={"xatol": 1e-5}).x)
        if aim is not None:
            bounds = np.array([max(aim - _AIM_STEP, 0.005), aim + _AIM_STEP])
            aim = float(optimize.minimize_scalar(cost_of_aim, bounds=bounds, options={"xatol": 1e-5}).x)
            _aim(drives, aim)
        delays = best.delay + np.arange(-near, near + 1e-9, step)
        delays = delays[(delays >= 0.0) & (delays <= LONGEST_DELAY)]
        sums, best = search(delays, yielding, speed_factor)

    period = scenario.control_period
    fitted = best.behaviour(period)
    has_skill = drives[0].has_skill
    others = [item.behaviour(period) for item in _without_each(sums, delays, yielding, has_skill=has_skill)]
    for name, value in fitted.items():
        if not math.isfinite(value):
            raise InputError(
                all_of(names), name, "cannot be estimated from these drives; add drives with turns"
            )
    estimates: dict[str, Estimate | None] = dict.fromkeys(FITTED)
    estimates |= {name: _jackknife(value, [item[name] for item in others]) for name, value in fitted.items()}
    if not has_skill:
        estimates["skill"] = None
    if isinstance(drives[0], TipDrive):
        # From one of the operator's points to the next the likelihood has a maximum of its own, whose
        # curvature is not that of the whole.
        estimates["delay"] = _jackknife(fitted["delay"], [item.delay for item in smooth])
    # An operator who yields more and means to go faster gives nearly the same commands.
    estimates["yielding"] = _jackknife_yielding(drives, best, speed_factor, yielding) if assisted else None
    if aim is not None:
        estimates["aim_ahead"] = _jackknife_aim(drives, best, speed_factor, aim)
    switches = [drive.switch_times for drive in drives if isinstance(drive, TipDrive)]
    estimates["plane_switch_time"] = _jackknife_switches(switches)
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
        **estimates,  # type: ignore[arg-type]
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
    without = _without_each(sums, speeds, yielding, has_skill=drives[0].has_skill)
    return _jackknife(best.yielding, [item.yielding for item in without])


def _jackknife_aim(
    drives: Sequence[DriveLikelihood], best: Optimum, speed_factor: float, aim: float
) -> Estimate:
    """The distance at which an operator aims, at the best delay and speed factor."""
    aims = np.linspace(max(aim - _AIM_STEP, 0.005), aim + _AIM_STEP, 65)
    delay, yielding = np.array([best.delay]), np.array([best.yielding])
    sums = []
    for distance in aims:
        _aim(drives, float(distance))
        sums.append([drive.sums(delay, yielding, speed_factor)[0] for drive in drives])
    _aim(drives, aim)
    without = _without_each(np.array(sums).swapaxes(0, 1), aims, yielding, has_skill=False)
    return _jackknife(aim, [item.delay for item in without])


def _jackknife_switches(times: Sequence[Sequence[float]]) -> Estimate | None:
    """Mean time of a switch of plane, in [s], from those of each trial."""
    switched = [item for item in times if item]
    if not switched:
        return None
    without = [
        np.concatenate(switched[:index] + switched[index + 1 :] or [[]]) for index in range(len(switched))
    ]
    others = [float(item.mean()) for item in without if len(item)]
    return _jackknife(float(np.concatenate(switched).mean()), others)


def _without_each(sums: Floats, grid: Floats, yielding: Floats, *, has_skill: bool) -> list[Optimum]:
    """Fits without each trial in turn, for the jackknife; none if one of the trials is needed."""
    if len(sums) == 1:
        return []
    total = sums.sum(axis=0)
    found = [maximize_likelihood(total - one, grid, yielding, has_skill=has_skill) for one in sums]
    return found if all(math.isfinite(item.skill) for item in found) else []


def _jackknife(value: float, others: Sequence[float]) -> Estimate:
    """Interval of a value from the values without each trial in turn."""
    count = len(others)
    if count < 2:
        return Estimate(value=value)
    half = float(stats.t.ppf(0.975, count - 1)) * math.sqrt(count - 1) * float(np.std(others))
    return Estimate(value=value, low=max(value - half, 0.0), high=value + half)


def _simulated(trial: Trial) -> bool:
    return trial.metadata.get("operator") in (SurrogateOperator.__name__, TipOperator.__name__)


def _drives(
    trials: Sequence[Trial], names: Sequence[str], scenario: Scenario, *, spacing: float | None = None
) -> list[DriveLikelihood]:
    """The trials with their intended paths, whose points are those of the operator without ``spacing``."""
    drives: list[DriveLikelihood] = []
    for trial, name in zip(trials, names, strict=True):
        route = scenario.route(trial.metadata["route"])
        if isinstance(scenario.robot, Arm):
            curve = (
                SpacePath(route.waypoints)
                if spacing is None
                else SpacePath(route.waypoints, count=_FINE_POINTS)
            )
            drives.append(TipDrive(trial, scenario, curve, name))
        else:
            path = scenario.path_of(route) if spacing is None else route.path(scenario.start, spacing=spacing)
            drives.append(WheelDrive(trial, scenario, path, name))
    return drives


def _aims(drives: Sequence[DriveLikelihood], names: Sequence[str]) -> tuple[float | None, ...]:
    """Distances at which the operator may aim, in [m], and None for one who follows the route."""
    arms = [drive for drive in drives if isinstance(drive, TipDrive)]
    if not arms:
        return (None,)
    for drive, name in zip(arms, names, strict=True):
        if drive.in_planes != arms[0].in_planes:
            raise InputError(name, "plane", f"must be used as in {names[0]}: one plane at a time, or not")
    return _AIMS if arms[0].in_planes else (None, *_AIMS)


def _aim(drives: Sequence[DriveLikelihood], distance: float | None) -> None:
    for drive in drives:
        if isinstance(drive, TipDrive):
            drive.aim_ahead = distance


def settings_of(trials: Sequence[Trial]) -> dict[str, Any]:
    """The true values of the fitted parameters that are the same in all trials of simulated operators."""
    settings = {}
    for name in FITTED:
        values = {trial.metadata.get("behaviour", {}).get(name) for trial in trials}
        if len(values) == 1 and None not in values:
            settings[name] = values.pop()
    return settings
