"""The simulated operators of many trials."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.elementwise import ARRAYS
from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.imperfections import answered, coloured_noise, slipped, within_limits
from drake_shared.operators.steering import SteeringLaw
from drake_shared.scenario import Scenario
from drake_shared.simulation.lockstep.noise import Noise
from drake_shared.simulation.lockstep.routes import RouteTable, TrialRoutes
from drake_shared.simulation.settings import TrialSettings

Floats = NDArray[np.float64]
State = dict[str, Any]

_FIELDS = tuple(field.name for field in dataclasses.fields(Behaviour))


class Operators:
    """Drives many trials as `drake_shared.systems.surrogate_operator.SurrogateOperator` drives one.

    The state, a dict of arrays whose last axis is that of the trials, holds the behaviours too.

    Args:
        scenario: The task.
        settings: Of n trials.
        noise: Of their seeds.
    """

    def __init__(self, scenario: Scenario, settings: Sequence[TrialSettings], noise: Noise) -> None:
        self._scenario = scenario
        self._law = SteeringLaw(scenario)
        self._fastest = scenario.diff_drive.max_wheel_speed
        self._routes = {route.name: index for index, route in enumerate(scenario.routes)}
        paths = [scenario.path_of(route) for route in scenario.routes]
        self._table = RouteTable(paths, search=self._law.search)
        self._memory = len(self._law.initial_memory) // 3
        behaviours = [item.behaviour for item in settings]
        self._answers = any(item.stubbornness or item.yielding for item in behaviours)
        self._slips = any(item.lag or item.random_share for item in behaviours)
        self._normal = noise.normal(0, 2)
        self._chance = noise.uniform(1, 4) if self._slips else None

    def initial_state(self, settings: Sequence[TrialSettings]) -> State:
        """The state at the start."""
        count, scenario = len(settings), self._scenario
        routes = [
            0 if item.route is None else self._routes[scenario.route(item.route).name] for item in settings
        ]
        then = [
            route if item.then is None else self._routes[scenario.route(item.then).name]
            for item, route in zip(settings, routes, strict=True)
        ]
        start = self._law.initial_memory.reshape(-1, 3)
        return {
            "behaviour": {
                name: np.array([getattr(item.behaviour, name) for item in settings]) for name in _FIELDS
            },
            "trial": np.arange(count),
            "route": np.array(routes),
            "then": np.array(then),
            "seen": np.repeat(start[:, :, None], count, axis=2),
            "reached": np.zeros(count),
            "noise": np.zeros((2, count)),
            "intended": np.zeros((2, count)),
            "command": np.zeros((2, count)),
        }

    def update(self, state: State, step: int, pose: Floats, shared: Floats, weight: Floats) -> None:
        """Replaces ``state`` by that of the next step.

        Args:
            state: At ``step``.
            step: Index of the control step.
            pose: Shape (3, n), at ``step``.
            shared: Shape (2, n), command of the arbiter at ``step``, in [rad/s].
            weight: Shape (n,), w at ``step``.
        """
        law, period = self._law, self._scenario.control_period
        behaviour: Any = SimpleNamespace(**state["behaviour"])
        now = step * period
        # A ring: the pose of step k is at k modulo its length.
        seen = state["seen"]
        seen[step % self._memory] = pose
        route: Any = np.where(now >= behaviour.switch_time, state["then"], state["route"])
        path = TrialRoutes(self._table, route)
        recalled = self._recall(seen, step, behaviour.delay)
        reached = state["reached"] = law.progress(path, recalled, state["reached"])
        time = now - behaviour.late_start
        paused = time - behaviour.pause_time
        steers = (time >= 0.0) & ~((paused >= 0.0) & (paused < behaviour.pause))
        time = np.where(paused >= behaviour.pause, time - behaviour.pause, time)
        speed, turn, correction = law.steer(
            path,
            recalled,
            reached,
            time=time,
            delay=behaviour.delay,
            speed_factor=behaviour.speed_factor,
            xp=ARRAYS,
        )
        steered = self._scenario.diff_drive.wheel_speeds(speed, turn + behaviour.skill * correction, ARRAYS)
        meant = [np.where(steers, wheel, 0.0) for wheel in steered]
        keep = np.exp(-period / behaviour.noise_time)
        normal = self._normal[step][:, state["trial"]]
        noise = coloured_noise(behaviour, state["noise"], meant, normal, keep, ARRAYS)
        wished = [wheel + extra for wheel, extra in zip(meant, noise, strict=True)]
        intended = within_limits(wished, self._fastest, ARRAYS)
        if self._chance is not None:
            chance = self._chance[step][:, state["trial"]]
            intended = slipped(behaviour, intended, state["intended"], chance, self._fastest, ARRAYS)
        command = intended
        if self._answers:
            command = answered(behaviour, intended, state["intended"], shared, weight, self._fastest, ARRAYS)
        state["noise"] = np.stack(noise)
        state["intended"] = np.where(steers, intended, 0.0)
        state["command"] = np.where(steers, command, 0.0)

    def _recall(self, seen: Floats, step: int, delay: Floats) -> tuple[Floats, Floats, Floats]:
        """See `SteeringLaw.recall`."""
        index, share = np.divmod(
            np.maximum(delay - self._scenario.control_period, 0.0) / self._scenario.control_period, 1.0
        )
        newer = (step - index.astype(np.int64)) % self._memory
        rows = np.arange(len(delay))
        new, old = (np.ascontiguousarray(seen[index, :, rows].T) for index in (newer, newer - 1))
        x, y, yaw = new + share * (old - new)
        return x, y, yaw
