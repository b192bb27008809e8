"""Posterior fusion: which route the driver intends, how noisy the driver is, and the command that follows.

The state of knowledge is a joint distribution over the intended destination (a route, straight to a goal, or
none of these) and the standard deviation and the time constant of the noise on the driver's commands. Each
step it is updated by Bayes' rule from the command. What drivers mean is smooth, and noise is not, which tells
the two apart whatever the route; see `drake_shared.arbitration.command_filter`. The shared command is the
mean of what the driver means. It builds on shared autonomy by inference of goals (Javdani et al. 2018; Dragan
and Srinivasa 2013); routes without a demonstration are hypotheses too, since the obstacles are known.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.command_filter import CommandFilters
from drake_shared.arbitration.driver_change import DriverChange
from drake_shared.arbitration.fusion_model import FusionModel
from drake_shared.arbitration.route_guide import RouteGuide
from drake_shared.arbitration.routes import Routes
from drake_shared.arbitration.rule import ArbiterInputs, State
from drake_shared.robots import DiffDrive
from drake_shared.scenario import Scenario

Floats = NDArray[np.float64]

STILL = 1e-6
"""Below this, in [rad/s], a wheel is not commanded to move."""
# A robot that moves by less than this share of the commanded distance is held.
_HELD = 0.1


class Fusion:
    """The arithmetic of posterior fusion, for n drivers of one robot at once: an `ArbitrationRule`.

    The axes of arrays are those of H destinations (K routes, J goals and, the last, none of them), G pairs of
    noise and time constant, and n drivers. w is the share of a lasting difference from the agent's command
    that is executed. The command of one step is not a convex combination of the human's and the agent's:
    quick changes of the human's command, which are likely to be noise, are smoothed.

    Args:
        model: Of a driver.
        routes: K routes.
        scenario: Goals, static obstacles and travel time.
        robot: Steers toward points.
        period: Of the control step, in [s].
    """

    def __init__(
        self, model: FusionModel, routes: Routes, *, scenario: Scenario, robot: DiffDrive, period: float
    ) -> None:
        self._model = model
        self._robot, self._period = robot, period
        self._guide = RouteGuide(routes, scenario, robot)
        planned = [*(~routes.demonstrated).tolist(), *(True for _ in scenario.all_goals)]
        self._count = count = len(planned)
        self._look_aheads = np.array([model.look_ahead, model.driver_look_ahead])
        self._memory = max(round(model.delay / period), 0) + 1
        noises, times = (part.ravel() for part in np.meshgrid(model.noises, model.noise_times, indexing="ij"))
        self._noises, self._times = noises, times
        # Nothing is impossible: a person may drive as never before.
        weights = np.array(model.noise_prior or np.ones(len(noises))) + 1e-9
        self._noise_prior = weights / weights.sum()
        self._driver_change = DriverChange(
            self._noise_prior,
            period=period,
            memory=model.noise_memory,
            false_notices=model.false_notices,
        )
        # Turn and speed are made of two wheels, whose noises are independent.
        kinds = [(model.meant, model.meant_rate), (model.meant_planned, model.meant_planned_rate)]
        self._filters = CommandFilters(
            [
                *(kinds[item] for item in planned),
                (model.none_turn, model.none_rate),
                (model.speed, model.speed_rate),
            ],
            noises / math.sqrt(2.0),
            times,
            period=period,
            tail=model.tail,
        )
        self._share = self._filters.share[:-1, :, None]
        prior = np.where(planned, model.prior_planned, 1.0)
        self._prior = np.append(prior * (1.0 - model.prior_none) / prior.sum(), model.prior_none)
        # A driver who changes the route may change to any route, demonstrated or not.
        change = np.append(np.full(count, (1.0 - model.switching_to_none) / count), model.switching_to_none)
        self._change = change[:, None, None]
        self._changes = min(model.switching * period, 1.0)
        self._gradual = model.gradual
        self._drifts = min(model.drifting * period, 1.0)
        self._blocked = period / model.blocked_time

    def initial_state(self, count: int) -> State:
        """Before the first step of ``count`` drivers; the last axis of each array is theirs."""
        probability = self._prior[:, None] * self._noise_prior
        return {
            "progress": self._guide.initial_progress(count),
            "probability": np.repeat(probability[..., None], count, axis=2),
            "command": self._filters.initial_state(count),
            "expected": np.full((self._memory, self._count + 2, count), math.nan),
            "place": np.full((2, count), math.nan),
            "held": np.zeros(count),
            "driver_noise": np.full(count, self._noises @ self._noise_prior),
            "another_driver": np.zeros(count),
            "cusum": np.zeros(count),
        }

    def step(self, state: State, inputs: ArbiterInputs) -> tuple[Floats, Floats, State]:
        """See `drake_shared.arbitration.rule.ArbitrationRule`; the agent's own command is not used.

        Without a command the robot stops. One that an obstacle stops turns to the likeliest free destination.
        """
        model, pose, human = self._model, inputs.pose, inputs.human
        progress = self._guide.advance(state["progress"], pose)
        left, right, target = self._guide.commands(progress, pose, self._look_aheads)
        agent, driver = 0.5 * (right - left)
        driver = np.minimum(np.maximum(driver, -model.largest_turn), model.largest_turn)
        now = np.zeros((self._count + 2, len(human[0])))
        now[:-2] = driver
        now[-1] = 0.5 * (right[1] + left[1]).mean(axis=0)
        expected = np.concatenate([state["expected"][1:], now[None]])
        # Until the delay has passed, what is known is the first command of each route.
        past = np.where(np.isnan(expected[0]), expected[-1], expected[0])
        gives = np.abs(human).max(axis=0) > STILL
        given = np.empty_like(past)
        given[:-1] = 0.5 * (human[1] - human[0])
        given[-1] = 0.5 * (human[1] + human[0])
        continued, log, fresh, fresh_log = self._filters.step(state["command"], given - past, gives)
        blocked = np.zeros_like(log[:-1, :1])
        is_free = ~self._guide.is_blocked(pose, target[1])
        blocked[:-1, 0] = ~is_free
        evidence = log[-1] - self._blocked * blocked
        before = self._drifted(state["probability"], state["another_driver"])
        # Drivers keep their destination, or take one, known or not, from here on.
        kept = (1.0 - self._changes) * before
        taken = self._changes * self._change * before.sum(axis=0)
        largest = np.maximum(log[:-1], fresh_log[:-1]).max(axis=(0, 1))
        # A new destination may already show in the commands before, or begin with a jerk.
        kept = (kept + self._gradual * taken) * np.exp(log[:-1] - largest + evidence)
        taken = (1.0 - self._gradual) * taken * np.exp(fresh_log[:-1] - largest + evidence)
        probability = np.maximum(kept + taken, 1e-290)
        begun = taken / probability
        probability = probability / probability.sum(axis=(0, 1))
        meant = continued.copy()
        meant[:, :-1] += begun * (fresh[:, :-1] - continued[:, :-1])
        share = (probability * self._share).sum(axis=1)
        rest = probability.sum(axis=1) - share
        # Where hardly anything is noise, what is meant is the command, whatever the route.
        turn = (rest[:-1] * agent).sum(axis=0) + (share * past[:-1]).sum(axis=0)
        turn = turn + (probability * meant[0, :-1]).sum(axis=(0, 1))
        noise = probability.sum(axis=0)
        speed = past[-1] + (noise * meant[0, -1]).sum(axis=0)
        held = self._held(state, inputs)
        if held.any():
            free = is_free * probability[:-1].sum(axis=1)
            way_out = (free * agent).sum(axis=0) / np.maximum(free.sum(axis=0), 1e-9)
            turn = turn + held * (way_out - turn)
        command = np.where(gives, np.stack([speed - turn, speed + turn]), 0.0)
        cusum, another = state["cusum"], state["another_driver"]
        if self._model.noise_prior:
            # Without a person's prior there is nobody to compare with.
            cusum, another, factor = self._driver_change.step(cusum, another, noise, gives)
            if (another != state["another_driver"]).any():
                # What follows from the commands so far with the prior of who drives now.
                probability = probability * factor
                probability = probability / probability.sum(axis=(0, 1))
        after = {
            "progress": progress,
            "probability": probability,
            "command": meant,
            "expected": expected,
            "place": pose[:2].copy(),
            "held": held,
            "driver_noise": (self._noises[:, None] * noise).sum(axis=0),
            "another_driver": another,
            "cusum": cusum,
        }
        weight = np.minimum(share.sum(axis=0), 1.0)
        return np.where(gives, weight, 1.0), command, after

    def route_probability(self, state: State) -> Floats:
        """Probability (K + J + 1, n) of each route, of straight to each goal, and of none of them."""
        return np.asarray(state["probability"].sum(axis=1))

    def noise(self, state: State) -> Floats:
        """Mean and standard deviation, each (n,), of the noise on each wheel's command, in [rad/s]."""
        return _moments(self.noise_probability(state), self._noises)

    def noise_time(self, state: State) -> Floats:
        """Mean and standard deviation, each (n,), of the time constant of the noise, in [s]."""
        return _moments(self.noise_probability(state), self._times)

    def noise_probability(self, state: State) -> Floats:
        """Probability (G, n) of each pair of noise and time constant."""
        return np.asarray(state["probability"].sum(axis=0))

    def _held(self, state: State, inputs: ArbiterInputs) -> Floats:
        """How long, from 0 to 1, an obstacle has kept a robot from driving on."""
        is_near = inputs.clearance < self._robot.footprint_radius
        if not (is_near.any() or state["held"].any()):
            return np.zeros_like(state["held"])
        moved = np.hypot(*(inputs.pose[:2] - state["place"]))
        is_held = is_near & (moved < _HELD * self._period * self._robot.speed(inputs.human))
        rate = self._period / self._model.held_time
        return np.asarray(np.minimum(np.maximum(state["held"] + np.where(is_held, rate, -rate), 0.0), 1.0))

    def _drifted(self, probability: Floats, another: Floats) -> Floats:
        """The probability (H, G, n) one step later: noise and its time constant may have changed."""
        # Without a person's prior nobody is found to be another.
        prior = self._driver_change.prior(another) if self._model.noise_prior else self._noise_prior[:, None]
        anew = probability.sum(axis=1, keepdims=True) * prior
        return np.asarray((1.0 - self._drifts) * probability + self._drifts * anew)


def _moments(probability: Floats, values: Floats) -> Floats:
    """Mean and standard deviation, shape (2, n), of ``values`` (G,) by probabilities (G, n)."""
    mean = values @ probability
    return np.stack([mean, np.sqrt(np.maximum(np.square(values) @ probability - mean**2, 0.0))])
