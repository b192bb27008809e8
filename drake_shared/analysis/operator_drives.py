"""The laws of simulated operators at the poses of a recorded trial, for `operator_likelihood`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.operator_likelihood import DriveLikelihood
from drake_shared.common.elementwise import ARRAYS
from drake_shared.operators.reaching import CORRECTION_TIME, PLANES, ReachingLaw
from drake_shared.operators.steering import SteeringLaw
from drake_shared.scenario import Scenario
from drake_shared.scenario.paths import Path
from drake_shared.scenario.space_path import SpacePath
from drake_shared.simulation.lockstep.routes import RouteTable, TrialRoutes
from drake_shared.simulation.trial import Trial

Floats = NDArray[np.float64]


class WheelDrive(DriveLikelihood):
    """A trial of a differential drive, whose operator drives by the `SteeringLaw`.

    Args:
        trial, scenario, name: See `DriveLikelihood`.
        path: The intended path.
    """

    def __init__(self, trial: Trial, scenario: Scenario, path: Path, name: str) -> None:
        self._law = SteeringLaw(scenario)
        self._robot = scenario.diff_drive
        self._path = path
        self._table = RouteTable([path], search=self._law.search)
        poses = np.stack([trial["x"], trial["y"], trial["yaw"]], axis=-1)[:-1]
        # Interpolation between poses needs a continuous yaw.
        poses[:, 2] = np.unwrap(poses[:, 2])
        self._observed = np.concatenate([poses[::-1].ravel(), self._law.initial_memory])
        self._count = len(poses)
        self._observations: dict[float, Floats] = {}
        commands = trial.commands("human")[1:]
        effort = np.abs(commands).max(axis=1) / self._robot.max_wheel_speed
        super().__init__(trial, scenario, name, effort)
        # While the operator gives no command, the planned motion does not advance.
        self._time = trial["t"][:-1] - scenario.control_period * np.cumsum(~self._hands_on)

    def law_commands(self, delay: float, speed_factor: float) -> tuple[Floats, Floats]:
        """Wheel speeds (n, 2) of the law at skill 0, and their increase per unit of skill, in [rad/s]."""
        x, y, yaw, reached = self._observe(delay)
        path = TrialRoutes(self._table, np.zeros(self._count, int))
        speed, turn, correction = self._law.steer(
            path, (x, y, yaw), reached, time=self._time, delay=delay, speed_factor=speed_factor, xp=ARRAYS
        )
        half = 0.5 * self._robot.track
        base = np.stack([speed - half * turn, speed + half * turn], axis=-1) / self._robot.wheel_radius
        per_skill = np.stack([-half * correction, half * correction], axis=-1) / self._robot.wheel_radius
        return base, per_skill

    def _observe(self, delay: float) -> Floats:
        """The delayed pose and the arc length reached along the path, at each step: shape (4, n)."""
        if delay not in self._observations:
            steps = _seen(self._law, self._path, self._observed, self._count, delay)
            self._observations[delay] = np.array([(*pose, reached) for pose, reached in steps]).T
        return self._observations[delay]


class TipDrive(DriveLikelihood):
    """A trial of an arm, whose operator moves its tip by the `ReachingLaw`.

    Args:
        trial, scenario, name: See `DriveLikelihood`.
        path: The intended path.

    Attributes:
        aim_ahead: Distance on the route, in [m], of the position to which the operator moves; None follows
            the route.
        switch_times: From each switch of plane to the next command, in [s].
        in_planes: Whether each command keeps to its plane.
    """

    def __init__(self, trial: Trial, scenario: Scenario, path: SpacePath, name: str) -> None:
        self._law, self._path = ReachingLaw(scenario), path
        positions = trial.positions[:-1]
        start = np.tile(scenario.routes[0].waypoints[0], self._law.memory)
        self._observed = np.concatenate([positions[::-1].ravel(), start])
        self._count = len(positions)
        self._observations: dict[float, tuple[Floats, ...]] = {}
        self.aim_ahead: float | None = None
        commands = trial.commands("human")[1:]
        effort = np.linalg.norm(commands, axis=1) / scenario.robot.command_limits[0]
        super().__init__(trial, scenario, name, effort)
        planes = trial["plane"][1:].astype(int)
        moved = np.array(PLANES)[planes]
        self.in_planes = not commands[moved == 0.0].any()
        self._moved = moved if self.in_planes else np.ones_like(commands)
        self.axes = 2 if self.in_planes else 3
        self.switch_times = self._switches(planes, scenario.control_period)

    @property
    def has_skill(self) -> bool:  # type: ignore[override]
        """Whether the operator follows the route; one who aims ahead has no skill."""
        return self.aim_ahead is None

    def law_commands(self, delay: float, speed_factor: float) -> tuple[Floats, Floats]:
        """Velocities (n, 3) of the law at skill 0, and their increase per unit of skill, in [m/s]."""
        seen, reached, slowing, direction, offset = self._observe(delay)
        pace = speed_factor * self._law.pace(self._path)
        if self.aim_ahead is None:
            return self._moved * pace * slowing[:, None] * direction, self._moved * offset / CORRECTION_TIME
        errors = self._path.positions_at(reached + self.aim_ahead) - seen
        return self._law.toward(self._moved * errors, pace), np.zeros_like(seen)

    def _observe(self, delay: float) -> tuple[Floats, ...]:
        """The delayed position, the arc length reached, and what `ReachingLaw.guide` returns, at each
        step."""
        if delay not in self._observations:
            steps = _seen(self._law, self._path, self._observed, self._count, delay)
            observed = [
                (position, reached, *self._law.guide(self._path, position, reached))
                for position, reached in steps
            ]
            self._observations[delay] = tuple(map(np.array, zip(*observed, strict=True)))
        return self._observations[delay]

    def _switches(self, planes: NDArray[np.int64], period: float) -> list[float]:
        switches = 1 + np.flatnonzero(np.diff(planes))
        gives = np.flatnonzero(self._hands_on)
        found = []
        for at, end in pairwise([*switches.tolist(), len(planes)]):
            later = gives[(gives >= at) & (gives < end)]
            if len(later):
                found.append(float(period * (later[0] - at)))
        return found


def _seen(law: Any, path: Any, memory: Floats, count: int, delay: float) -> Iterator[tuple[Any, float]]:
    """What an operator sees after its delay, and the arc length reached, at each of ``count`` steps.

    Args:
        law: Of the operator.
        path: The intended one, of the kind that ``law`` follows.
        memory: Three numbers for each step, the newest first, and those before the start.
        count: Number of steps.
        delay: In [s].
    """
    reached = 0.0
    for index in range(count):
        seen = law.recall(memory[3 * (count - 1 - index) :], delay)
        reached = law.progress(path, seen, reached)
        yield seen, reached
