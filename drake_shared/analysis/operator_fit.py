"""Which simulated operator drives most like the one in recorded trials: skill, delay, noise and yielding.

The law of :class:`drake_shared.operators.steering.SteeringLaw` is fitted by maximum likelihood, with noise
of first order. A fit to a person is a model of that person's drives, with its goodness of fit, and no more.

Ten trials hold the delay to some 10 ms, and skill less firmly: an error is corrected only where noise or the
agent makes one, and hides in the same noise. Its interval is to be read with it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import optimize, stats

from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import LONGEST_DELAY
from drake_shared.operators.steering import Pose, SteeringLaw
from drake_shared.scenario import Scenario, scenario_from_dict
from drake_shared.scenario.paths import Path
from drake_shared.simulation.trial import Trial
from drake_shared.systems.surrogate_operator import SurrogateOperator

FITTED = ("skill", "delay", "noise", "noise_time", "yielding")
# Steps of the search for the delay, first and last, in [s].
_COARSE, _FINE = 0.1, 0.01
_YIELDING = np.linspace(0.0, 0.96, 25)
_PACES = (0.5, 2.0)
# A weight that never leaves 1 by more says nothing of yielding.
_LEAST_ASSISTANCE = 0.02
_LEAST_MOTION = 0.5
# Share of the wheels' limit below which a command is what was wanted: noise is added to a command cut there.
_FREE = 0.9
# Bounds of how much of the noise is kept from step to step.
_KEEPS = (1e-6, 0.99)
# Of the points of a route, in [m]: at those of a simulated operator likelihood would leap with the delay.
_SPACING = 0.0005


@dataclasses.dataclass(frozen=True, kw_only=True)
class Estimate:
    """A value fitted, with its 95% interval over trials (jackknife); none for a single trial."""

    value: float
    low: float | None = None
    high: float | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class OperatorFit:
    """The simulated operator that drives most like the one in the trials.

    Attributes:
        simulated: Whether the trials were those of a simulated operator; else of a person.
        trials, steps: How many trials, and steps of them with a command that tells something.
        skill, delay, noise, noise_time, yielding: As in :class:`drake_shared.operators.behaviour.Behaviour`.
            Yielding is None if there was no assistance to yield to.
        speed_factor: The pace that goes with it, alike for all trials.
        explained: Share of the variance of the commands that the law explains without noise.
        explained_a_step_ahead: The same for the prediction from the commands up to the step before.
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
    """Fits a simulated operator to the drives of one operator.

    Args:
        trials: In mode "shared" or "human", of one scenario, one preset and one kind of operator, each with
            the one route that was meant.
        names: Of the trials, for errors.

    Raises:
        InputError: The trials are not of that kind, or hold no motion.
    """
    if not trials:
        raise InputError("fit", "trials", "must be at least one")
    names = names or [f"trial {index}" for index in range(len(trials))]
    _check(trials, names)
    scenario = scenario_from_dict(trials[0].metadata["scenario"], source=f"{names[0]}: scenario")
    paths = {
        name: Path(np.array(scenario.route(name).waypoints), heading=scenario.start.yaw, spacing=_SPACING)
        for name in {trial.metadata["route"] for trial in trials}
    }
    drives = [
        _Drive(trial, scenario, paths[trial.metadata["route"]], name)
        for trial, name in zip(trials, names, strict=True)
    ]
    assisted = min(drive.least_weight for drive in drives) < 1.0 - _LEAST_ASSISTANCE
    yielding = _YIELDING if assisted else _YIELDING[:1]

    def search(delays: np.ndarray, yielding: np.ndarray, pace: float) -> tuple[np.ndarray, _Best]:
        sums = np.stack([drive.sums(delays, yielding, pace) for drive in drives])
        return sums, _best(sums.sum(axis=0), delays, yielding)

    def badness_of(pace: float) -> float:
        return search(np.array([best.delay]), yielding, pace)[1].badness

    # The pace barely depends on the delay, nor the delay on a pace that is nearly right.
    pace = 1.0
    for _ in range(2):
        _, best = search(np.arange(_COARSE, LONGEST_DELAY + 1e-9, _COARSE), yielding, pace)
        for drive in drives:
            drive.tell(best.yielding)
        pace = float(optimize.minimize_scalar(badness_of, bounds=_PACES, options={"xatol": 1e-3}).x)
    low, high = max(best.delay - _COARSE, 0.0), min(best.delay + _COARSE, LONGEST_DELAY)
    delays = np.linspace(low, high, round((high - low) / _FINE) + 1)
    if assisted:
        around = best.yielding + np.linspace(-_YIELDING[1], _YIELDING[1], 33)
        yielding = around[(around >= 0.0) & (around < 1.0)]
    sums, best = search(delays, yielding, pace)

    period = scenario.control_period
    found = best.behaviour(period)
    # Without each trial in turn: what a trial more or less does to the fit.
    others = [
        _best(sums.sum(axis=0) - one, delays, yielding).behaviour(period) for one in sums if len(trials) > 1
    ]
    estimates = {name: _interval(found[name], [item[name] for item in others]) for name in FITTED}
    law, ahead, steps = (
        sum(item) for item in zip(*(drive.missed(best, pace) for drive in drives), strict=True)
    )
    commands = np.concatenate([drive.commands[drive.told] for drive in drives])
    spread = float(((commands - commands.mean(axis=0)) ** 2).sum())
    return OperatorFit(
        simulated=_simulated(trials[0]),
        trials=len(trials),
        steps=int(steps),
        skill=estimates["skill"],
        delay=estimates["delay"],
        noise=estimates["noise"],
        noise_time=estimates["noise_time"],
        yielding=estimates["yielding"] if assisted else None,
        speed_factor=pace,
        explained=1.0 - law / spread,
        explained_a_step_ahead=1.0 - ahead / spread,
    )


def _interval(value: float, others: Sequence[float]) -> Estimate:
    """The jackknife's, of a value and of those without each trial in turn."""
    count = len(others)
    if count < 2:
        return Estimate(value=value)
    half = float(stats.t.ppf(0.975, count - 1)) * math.sqrt(count - 1) * float(np.std(others))
    return Estimate(value=value, low=max(value - half, 0.0), high=value + half)


def _simulated(trial: Trial) -> bool:
    return trial.metadata.get("operator") == SurrogateOperator.__name__


def _check(trials: Sequence[Trial], names: Sequence[str]) -> None:
    first = trials[0].metadata
    for trial, name in zip(trials, names, strict=True):
        told = trial.metadata
        if told.get("mode") not in ("shared", "human"):
            raise InputError(name, "mode", "must be shared or human: nobody steers", repr(told.get("mode")))
        if told.get("operator") == "RecordedInput":
            raise InputError(name, "operator", "must be one who answers what is seen, not a recording")
        if told.get("route") is None:
            raise InputError(name, "route", "must be given: the fit needs the way that was meant")
        if told.get("then") is not None:
            raise InputError(name, "then", "must not be given: the fit needs one way", repr(told["then"]))
        for field in ("scenario", "preset", "operator"):
            if told.get(field) != first.get(field):
                raise InputError(name, field, f"must be that of {names[0]}")
        if np.hypot(*np.diff(trial.positions, axis=0).T).sum() < _LEAST_MOTION:
            raise InputError(name, "", f"must hold motion of at least {_LEAST_MOTION} m")


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Best:
    """What fits best; ``badness`` is twice the negative logarithm of the likelihood, but for a constant."""

    badness: float
    delay: float
    yielding: float
    skill: float
    keep: float
    kick: float

    def behaviour(self, period: float) -> dict[str, float]:
        return {
            "skill": self.skill,
            "delay": self.delay,
            "noise": self.kick / math.sqrt(1.0 - self.keep**2),
            "noise_time": -period / math.log(self.keep),
            "yielding": self.yielding,
        }


class _Drive:
    """The commands of a trial, and what the law would have commanded in place of them.

    Attributes:
        commands: Shape (n, 2), in [rad/s]; row k is the answer to pose k.
        told: Shape (n,), whether row k says something: hands on, wheels not near their limit.
        least_weight: The least human weight.
    """

    def __init__(self, trial: Trial, scenario: Scenario, path: Path, name: str) -> None:
        period = scenario.control_period
        if not np.allclose(np.diff(trial["t"]), period, atol=1e-6):
            raise InputError(name, "t", f"must have a row each {period} s")
        self._law = SteeringLaw(scenario)
        self._robot = scenario.robot
        self._path = path
        poses = np.stack([trial["x"], trial["y"], trial["yaw"]], axis=-1)[:-1]
        # Whole turns do not matter to a driver, but to what lies between two poses.
        poses[:, 2] = np.unwrap(poses[:, 2])
        self._seen = np.concatenate([poses[::-1].ravel(), self._law.initial_memory])
        self._count = len(poses)
        self.commands = trial.commands("human")[1:]
        self._weight = trial["human_weight"][:-1]
        self.least_weight = float(self._weight.min())
        hands_off = (self.commands == 0.0).all(axis=1)
        self._hands_on = ~hands_off
        self._free = _FREE * scenario.robot.max_wheel_speed
        # What was planned for while the hands were off is done later.
        self._time = (trial["t"][:-1] - period * np.cumsum(hands_off)).tolist()
        self._views: dict[float, list[tuple[Pose, float]]] = {}
        self.tell(0.0)
        if self._pairs.sum() < 10:
            raise InputError(name, "", "must hold commands of the human in at least ten steps in a row")

    def tell(self, yielding: float) -> None:
        """Decides which rows say something, of an operator who yields as much."""
        wished = np.abs(self.commands).max(axis=1) / (1.0 - yielding * (1.0 - self._weight))
        self.told = self._hands_on & (wished < self._free)
        self._pairs = self.told[1:] & self.told[:-1]

    def _followed(self, delay: float) -> list[tuple[Pose, float]]:
        """What is seen in each step at that delay: pose, and arc length reached."""
        if delay not in self._views:
            law, reached, view = self._law, 0.0, []
            for index in range(self._count):
                pose = law.recall(self._seen[3 * (self._count - 1 - index) :], delay)
                reached = law.progress(self._path, pose, reached)
                view.append((pose, reached))
            self._views[delay] = view
        return self._views[delay]

    def _law_of(self, delay: float, pace: float) -> tuple[np.ndarray, np.ndarray]:
        """Wheel speeds (n, 2) at skill 0, and what skill 1 adds, in [rad/s]."""
        rows = [
            self._law.steer(self._path, pose, reached, time=time, delay=delay, speed_factor=pace)
            for time, (pose, reached) in zip(self._time, self._followed(delay), strict=True)
        ]
        speed, turn, correction = np.array(rows).T
        half = 0.5 * self._robot.track
        blind = np.stack([speed - half * turn, speed + half * turn], axis=-1) / self._robot.wheel_radius
        added = np.stack([-half * correction, half * correction], axis=-1) / self._robot.wheel_radius
        return blind, added

    def sums(self, delays: np.ndarray, yielding: np.ndarray, pace: float) -> np.ndarray:
        """All that the likelihood needs of the trial, shape (delays, yielding, 11), to be added over trials.

        Of what skill has to explain, u, and what it adds, f: the sums of u u, u f, f f of a step, of the step
        before, and of the two (u u', u f', f u', f f' apart from the first) in pairs of steps; the sum of
        log(1 - yielding (1 - w)); and the number of commands.
        """
        held = 1.0 - yielding[:, None] * (1.0 - self._weight)
        wished = self.commands[None] / held[..., None]
        jacobian = 2.0 * np.log(held[:, 1:][:, self._pairs]).sum(axis=1)
        count = np.full(len(yielding), 2.0 * self._pairs.sum())
        table = []
        for delay in delays:
            blind, added = self._law_of(float(delay), pace)
            u = wished - blind
            now, before = u[:, 1:][:, self._pairs], u[:, :-1][:, self._pairs]
            f, f_before = added[1:][self._pairs], added[:-1][self._pairs]
            ff, ff_before, ff_both = ((a * b).sum() for a, b in ((f, f), (f_before, f_before), (f, f_before)))
            each = np.ones(len(yielding))
            table.append(
                np.stack(
                    [
                        *((now * now).sum((1, 2)), (now * f).sum((1, 2)), ff * each),
                        *((before * before).sum((1, 2)), (before * f_before).sum((1, 2)), ff_before * each),
                        (now * before).sum((1, 2)),
                        (now * f_before).sum((1, 2)) + (before * f).sum((1, 2)),
                        *(ff_both * each, jacobian, count),
                    ],
                    axis=-1,
                )
            )
        return np.stack(table)

    def missed(self, best: _Best, pace: float) -> tuple[float, float, int]:
        """Sum of squared errors of the law and of the prediction a step ahead, and the number of steps."""
        blind, added = self._law_of(best.delay, pace)
        held = (1.0 - best.yielding * (1.0 - self._weight))[:, None]
        error = self.commands - held * (blind + best.skill * added)
        noise = error / held
        ahead = error.copy()
        ahead[1:][self._pairs] -= (held[1:] * best.keep * noise[:-1])[self._pairs]
        told = self.told
        return float((error[told] ** 2).sum()), float((ahead[told] ** 2).sum()), int(told.sum())


def _best(sums: np.ndarray, delays: np.ndarray, yielding: np.ndarray) -> _Best:
    """The likeliest of a grid of delays and yielding, and between its points."""
    uu, uf, ff, uu_before, uf_before, ff_before, uu_both, uf_both, ff_both, jacobian, count = np.moveaxis(
        sums, -1, 0
    )
    keep = np.full(uu.shape, 0.5)
    # In turns: each has a closed form given the other.
    for _ in range(12):
        skill = (uf - keep * uf_both + keep**2 * uf_before) / (
            ff - 2.0 * keep * ff_both + keep**2 * ff_before
        )
        now = uu - 2.0 * skill * uf + skill**2 * ff
        before = uu_before - 2.0 * skill * uf_before + skill**2 * ff_before
        both = uu_both - skill * uf_both + skill**2 * ff_both
        keep = np.clip(both / before, *_KEEPS)
    squares = np.maximum(now - 2.0 * keep * both + keep**2 * before, 1e-12)
    badness = count * np.log(squares / count) + 2.0 * jacobian
    row, column = np.unravel_index(badness.argmin(), badness.shape)

    def value(table: np.ndarray) -> float:
        return float(table[row, column])

    return _Best(
        badness=value(badness),
        delay=_lowest(delays, badness[:, column], int(row)),
        yielding=_lowest(yielding, badness[row], int(column)),
        skill=value(skill),
        keep=value(keep),
        kick=math.sqrt(value(squares) / value(count)),
    )


def _lowest(places: np.ndarray, heights: np.ndarray, index: int) -> float:
    """Where the parabola through the lowest point and its neighbours is lowest."""
    if not 0 < index < len(places) - 1:
        return float(places[index])
    before, at, after = heights[index - 1 : index + 2].tolist()
    bend = before - 2.0 * at + after
    shift = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return float(places[index] + shift * (places[1] - places[0]))


def settings_of(trials: Sequence[Trial]) -> dict[str, Any]:
    """What the trials of simulated operators had set of the values fitted, where all had the same."""
    settings = {}
    for name in FITTED:
        values = {trial.metadata.get("behaviour", {}).get(name) for trial in trials}
        if len(values) == 1 and None not in values:
            settings[name] = values.pop()
    return settings
