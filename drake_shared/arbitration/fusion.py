"""Posterior fusion: which route the driver intends, how noisy the driver is, and the command that follows.

The state of knowledge is a joint distribution over the intended route, or none of the known ones, and the
standard deviation and the time constant of the noise on the driver's commands. Each step it is updated by
Bayes' rule from the turn that the driver commands, and the shared command is the mean over that distribution
of a precision-weighted blend. It builds on shared autonomy by inference of goals (Javdani et al. 2018; Dragan
and Srinivasa 2013); routes without a demonstration are hypotheses too, since the obstacles are known.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.routes import POINTS, Routes
from drake_shared.arbitration.rule import ArbiterInputs, State
from drake_shared.common.elementwise import ARRAYS
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive

Floats = NDArray[np.float64]

# Points of a route that are searched for the one nearest to the robot.
_WINDOW = 25
_STILL = 1e-6


@dataclasses.dataclass(frozen=True, kw_only=True)
class FusionModel:
    """The model of a driver, and of what the agent knows of it.

    Raises:
        InputError: A value is out of range.
    """

    look_ahead: float = 0.6
    """Time ahead on a route of the point to which a driver on that route steers, in s."""
    delay: float = 0.2
    """Reaction delay of the driver, in s."""
    mismatch: float = 0.8
    """Standard deviation of the turn by which drivers on a route differ from that steering, in rad/s."""
    mismatch_time: float = 1.0
    """Time constant of that difference, in s."""
    style: float = 0.5
    """Standard deviation of the part of that difference that is meant, and left to the driver, in rad/s."""
    style_planned: float = 0.8
    """The same on a route that was planned, of which the agent knows only the side of each obstacle."""
    none_turn: float = 3.0
    """Standard deviation of the turn of a driver on none of the routes, in rad/s."""
    none_time: float = 1.0
    """Time constant of that turn, in s."""
    prior_planned: float = 0.3
    """Prior probability of a route that was planned, relative to one that was demonstrated."""
    prior_none: float = 0.03
    """Prior probability of none of the routes."""
    switching: float = 0.1
    """Rate at which drivers change their route, in 1/s."""
    switching_to_none: float = 0.05
    """Share of these changes that lead to none of the routes."""
    drifting: float = 0.02
    """Rate at which the noise of a driver changes, in 1/s."""
    noises: tuple[float, ...] = (0.1, 0.3, 0.6, 0.9, 1.3, 1.8)
    """Standard deviations of the noise on each wheel's command that are considered, in rad/s."""
    noise_times: tuple[float, ...] = (0.1, 0.25, 0.5, 1.0, 2.0)
    """Time constants of the noise that are considered, in s."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            values = value if isinstance(value, tuple) else (value,)
            share = field.name in ("prior_none", "switching_to_none")
            most = 1.0 if share else math.inf
            if not values or not all(0.0 < item < most for item in values):
                expected = "must be from 0 to 1" if share else "must be positive and finite"
                raise InputError("fusion", field.name, expected, value)


class Fusion:
    """The arithmetic of posterior fusion, for n drivers of one robot at once.

    The axes of arrays are those of K routes (and none of them, the last), G pairs of noise and time constant,
    and n drivers.

    Args:
        model: Of a driver.
        routes: K routes.
        robot: Steers toward points, and turns commands into turns.
        period: Of the control step, in [s].
        travel_time: Time in which a driver takes a route from start to goal, in [s].
    """

    def __init__(
        self, model: FusionModel, routes: Routes, *, robot: DiffDrive, period: float, travel_time: float
    ) -> None:
        self._model = model
        self._routes = routes
        self._robot = robot
        count = self._count = len(routes.lengths)
        self._spacings = routes.lengths / (POINTS - 1)
        self._ahead = model.look_ahead * routes.lengths / travel_time / self._spacings
        self._memory = max(round(model.delay / period), 0) + 1
        noises, times = (part.ravel() for part in np.meshgrid(model.noises, model.noise_times, indexing="ij"))
        # A turn is half the difference of two wheels, whose noises are independent.
        self._noise_variance = 0.5 * noises**2
        kept_noise = np.exp(-period / times)
        kinds = [(model.mismatch, model.mismatch_time)] * count + [(model.none_turn, model.none_time)]
        variances = np.array([deviation**2 for deviation, _ in kinds])[:, None]
        kept = np.array([math.exp(-period / time) for _, time in kinds])[:, None]
        # The sum of two processes of first order, as one with the same variance and correlation of a step.
        total = self._noise_variance + variances
        self._correlation = (self._noise_variance * kept_noise + variances * kept) / total
        self._innovation = total * (1.0 - self._correlation**2)
        prior = np.where(routes.demonstrated, 1.0, model.prior_planned)
        prior = np.append(prior * (1.0 - model.prior_none) / prior.sum(), model.prior_none)
        self._prior = prior
        # A driver who changes the route may change to any route, demonstrated or not.
        change = np.append(np.full(count, (1.0 - model.switching_to_none) / count), model.switching_to_none)
        self._change = change[:, None, None]
        self._changes = min(model.switching * period, 1.0)
        self._drifts = min(model.drifting * period, 1.0)
        self._style = np.where(routes.demonstrated, model.style, model.style_planned)[:, None] ** 2

    def initial_state(self, count: int) -> State:
        """Before the first step of ``count`` drivers; the last axis of each array is theirs."""
        pairs = len(self._noise_variance)
        probability = np.repeat(self._prior[:, None] / pairs, pairs, axis=1)
        return {
            "reached": np.zeros((self._count, count), dtype=np.int64),
            "probability": np.repeat(probability[..., None], count, axis=2),
            "difference": np.full((self._count + 1, count), math.nan),
            "turns": np.full((self._memory, self._count, count), math.nan),
        }

    def step(self, state: State, inputs: ArbiterInputs) -> tuple[Floats, Floats, State]:
        """See `drake_shared.arbitration.rule.ArbitrationRule`; pose and the drivers' commands are used."""
        pose, human = inputs.pose, inputs.human
        reached = self._advance(state["reached"], pose)
        commands = self._commands(reached, pose)
        turns = np.concatenate([state["turns"][1:], _turn(commands)[None]])
        # Until the delay has passed, what is known is the first command of each route.
        past = np.where(np.isnan(turns[0]), turns[-1], turns[0])
        turn = _turn(human)
        difference = np.concatenate([turn - past, turn[None]])
        probability = self._updated(state, difference, human)
        weight, command = self._blend(probability, commands, human)
        after = {
            "reached": reached,
            "probability": probability,
            "difference": difference,
            "turns": turns,
        }
        return weight, command, after

    def route_probability(self, state: State) -> Floats:
        """Probability (K + 1, n) of each route, and of none of them."""
        return np.asarray(state["probability"].sum(axis=1))

    def noise(self, state: State) -> Floats:
        """Expected standard deviation (n,) of the noise on each wheel's command, in [rad/s]."""
        variance = np.einsum("kgn,g->n", state["probability"], 2.0 * self._noise_variance)
        return np.asarray(np.sqrt(variance))

    def _advance(self, reached: NDArray[np.int64], pose: Floats) -> NDArray[np.int64]:
        """Index (K, n) of the point of each route that is nearest to the robot, at or after ``reached``."""
        index = np.minimum(reached[..., None] + np.arange(_WINDOW), POINTS - 1)
        points = self._routes.points[np.arange(self._count)[:, None, None], index]
        square = np.square(points - pose[:2].T[:, None]).sum(axis=-1)
        return np.asarray(np.minimum(reached + square.argmin(axis=-1), POINTS - 1))

    def _commands(self, reached: NDArray[np.int64], pose: Floats) -> Floats:
        """Commands (K, 2, n), in [rad/s], that steer toward a point ahead on each route."""
        ahead = np.minimum(reached + self._ahead[:, None], POINTS - 1.0)
        before = np.minimum(ahead.astype(np.int64), POINTS - 2)
        share = (ahead - before)[..., None]
        route = np.arange(self._count)[:, None]
        points = self._routes.points
        target = (1.0 - share) * points[route, before] + share * points[route, before + 1]
        commands = self._robot.command_toward(
            pose, (target[..., 0], target[..., 1]), self._model.look_ahead, ARRAYS
        )
        return np.stack(commands, axis=1)

    def _updated(self, state: State, difference: Floats, human: Floats) -> Floats:
        """The probability (K + 1, G, n) after one more command."""
        before, probability = state["difference"], state["probability"]
        innovation = difference[:, None] - self._correlation[..., None] * before[:, None]
        variance = self._innovation[..., None]
        log = -0.5 * (np.square(innovation) / variance + np.log(variance))
        # Without a command, or a step before, there is no evidence.
        known = np.isfinite(log).all(axis=(0, 1)) & (np.abs(human).max(axis=0) > _STILL)
        log = np.where(known, log, 0.0)
        probability = probability * np.exp(log - log.max(axis=(0, 1)))
        # Products of small numbers must not all vanish.
        probability = np.maximum(probability, 1e-290)
        probability = probability / probability.sum(axis=(0, 1))
        changed = self._change * probability.sum(axis=0)
        probability = (1.0 - self._changes) * probability + self._changes * changed
        drifted = probability.sum(axis=1, keepdims=True) / len(self._noise_variance)
        return np.asarray((1.0 - self._drifts) * probability + self._drifts * drifted)

    def _blend(self, probability: Floats, commands: Floats, human: Floats) -> tuple[Floats, Floats]:
        """w (n,) and shared command (2, n): each route's own blend, weighted by its probability.

        On a route, the driver's share is that of the meant difference in the variance of all differences.
        """
        route = probability.sum(axis=1)
        noise = np.einsum("kgn,g->kn", probability, self._noise_variance) / route
        agent = route[:-1] * noise[:-1] / (self._style + noise[:-1])
        weight = np.clip(1.0 - agent.sum(axis=0), 0.0, 1.0)
        return weight, weight * human + np.einsum("kn,kcn->cn", agent, commands)


def _turn(command: Floats) -> Floats:
    """Half the difference of the wheels' speeds, in [rad/s], of commands (..., 2, n)."""
    return np.asarray(0.5 * (command[..., 1, :] - command[..., 0, :]))
