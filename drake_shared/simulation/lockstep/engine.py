"""Runs many trials together: a step of all of them at a time, with arrays in place of a diagram."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.path_repair import make_path_repair
from drake_shared.arbitration.rule import ArbiterInputs
from drake_shared.common.elementwise import ARRAYS
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.robots import DiffDrive
from drake_shared.simulation.lockstep.arbiters import Arbitrations, apply_driver, driver_weights, kept
from drake_shared.simulation.lockstep.channel import Channels
from drake_shared.simulation.lockstep.estimator import Estimators
from drake_shared.simulation.lockstep.noise import Noise
from drake_shared.simulation.lockstep.operator import Operators
from drake_shared.simulation.lockstep.plant import Plants
from drake_shared.simulation.lockstep.safety import SafetyFilters
from drake_shared.simulation.lockstep.support import unsupported
from drake_shared.simulation.settings import TrialSettings
from drake_shared.simulation.trial import Simulation, Trial
from drake_shared.systems.prepared_learner import MOMENTS

Floats = NDArray[np.float64]
State = dict[str, Any]

BLOCK = 512
"""Trials that are run together: more would need more memory and take as long."""
# Of each trial: its columns in the log of the block, in its own log and in the file that is written, and the
# random numbers and metrics of each step.
_COPIES, _FURTHER = 2, 20
ENGINE = "lockstep"
"""The entry ``engine`` in the metadata of a trial of this engine."""


class Lockstep:
    """Runs trials of a `Simulation` in lock-step.

    The trajectories are those of the diagram within rounding. A trial does not depend on the others.

    Args:
        simulation: States scenario, config, learner and systems; its diagram is not run.

    Raises:
        InputError: This engine cannot run it; see `unsupported`.
    """

    def __init__(self, simulation: Simulation) -> None:
        _require(unsupported(simulation))
        self._simulation = simulation
        self._plants = Plants(simulation.scenario)
        self._columns = simulation.parts.columns

    def memory(self, count: int) -> int:
        """About the most memory that `run` takes for ``count`` trials, in bytes, without the diagram."""
        rows = min(count, BLOCK) * (self._simulation.scenario.steps + 1)
        return 8 * rows * (_COPIES * len(self._columns) + _FURTHER)

    def run(
        self, settings: Sequence[TrialSettings], *, learners: Sequence[Learner | None] | None = None
    ) -> Iterator[Trial]:
        """Runs a trial of each of ``settings`` to its end, and yields them in order.

        Args:
            settings: Of the trials.
            learners: Of each trial; where it is None, and by default, the simulation's own.

        Raises:
            InputError: A learner cannot be evaluated for many trials at once, or a route is unknown.
        """
        own = self._simulation.learner
        taking_part = [own if item is None else item for item in learners or [None] * len(settings)]
        for learner in {id(item): item for item in taking_part}.values():
            _require(unsupported(self._simulation, learner))
        for begin in range(0, len(settings), BLOCK):
            part = slice(begin, begin + BLOCK)
            yield from self._run(settings[part], taking_part[part])

    def _run(self, settings: Sequence[TrialSettings], learners: Sequence[Learner | None]) -> Iterator[Trial]:
        run = _Run(self._simulation, self._plants, settings, learners)
        log, lengths, reached = run.to_end()
        period = self._simulation.scenario.control_period
        names = self._columns
        for row, (setting, learner) in enumerate(zip(settings, learners, strict=True)):
            length = int(lengths[row])
            values = np.ascontiguousarray(log[:length, :, row].T)
            columns: dict[str, NDArray[Any]] = {"t": np.arange(length) * period}
            columns |= dict(zip(names, values, strict=True))
            columns["contact"] = columns["contact"] > 0.5
            described = self._simulation.describe(setting, learner=learner)
            status = "reached" if reached[row] else "timed_out"
            yield Trial(columns=columns, metadata=described | {"engine": ENGINE, "status": status})


class _Run:
    """One block of trials. The last axis of all arrays in the state is that of the trials still running."""

    def __init__(
        self,
        simulation: Simulation,
        plants: Plants,
        settings: Sequence[TrialSettings],
        learners: Sequence[Learner | None],
    ) -> None:
        scenario, config, parts = simulation.scenario, simulation.config, simulation.parts
        robot = scenario.diff_drive
        self._scenario = scenario
        self._robot: DiffDrive = robot
        self._plants = plants
        self._look_ahead = config.look_ahead
        self._ends_at_goal = config.end == "reached"
        self._columns = len(parts.columns)
        count = self._count = len(settings)
        drivers = [
            simulation.driver_of(item, learner) for item, learner in zip(settings, learners, strict=True)
        ]
        self._arbitrations = Arbitrations(parts.driver_switch, learners)
        noise = Noise([item.seed for item in settings], scenario.steps)
        self._operators = Operators(scenario, settings, noise)
        self._channels = self._filters = None
        if config.faults.on_channel:
            self._channels = Channels(config.faults, scenario.control_period, noise)
        if config.safety_clearance is not None:
            self._filters = SafetyFilters(scenario, config.safety_clearance)
        # Estimators of the same learner, some of which may ignore the human's command.
        kinds = [(id(learner), driver != "agent") for learner, driver in zip(learners, drivers, strict=True)]
        found = list(dict.fromkeys(kinds))
        self._estimators = [
            Estimators(
                learners[kinds.index(kind)],
                robot,
                period=scenario.control_period,
                steps=scenario.steps,
                use_human_command=kind[1],
                look_ahead=config.look_ahead,
                repair=make_path_repair(scenario, robot, look_ahead=config.look_ahead)
                if config.path_repair
                else None,
            )
            for kind in found
        ]
        which = np.array([found.index(kind) for kind in kinds])
        gains = [
            config.confidence_gain if item.confidence_gain is None else item.confidence_gain
            for item in settings
        ]
        start = scenario.start
        self._state: State = {
            "row": np.arange(count),
            "estimator": which,
            "gain": np.array(
                [
                    self._estimators[kind].default_gain if gain is None else gain
                    for gain, kind in zip(gains, which.tolist(), strict=True)
                ]
            ),
            "fixed": driver_weights(drivers),
            "pose": np.repeat([[start.x], [start.y], [start.yaw]], count, axis=1),
            "wheels": np.zeros((2, count)),
            "contact": np.zeros(count),
            "progress": np.zeros(count, np.int64),
            "expected": np.full((2 * MOMENTS, count), math.nan),
            "operator": self._operators.initial_state(settings),
            "channel": {} if self._channels is None else self._channels.initial_state(count),
        }

    def to_end(self) -> tuple[Floats, NDArray[np.int64], NDArray[np.bool_]]:
        """Log (steps + 1, columns, n), number of rows (n,) of each trial, and which reached a goal."""
        steps = self._scenario.steps
        goals = self._scenario.all_goals
        log = np.empty((steps + 1, self._columns, self._count))
        lengths, reached = np.full(self._count, steps + 1), np.zeros(self._count, bool)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for step in range(steps + 1):
                state = self._state
                pose = state["pose"]
                away = [np.hypot(pose[0] - goal.x, pose[1] - goal.y) - goal.radius for goal in goals]
                at_goal = np.min(away, axis=0) <= 0.0
                ends = at_goal & self._ends_at_goal
                log[step][:, state["row"]] = self._step(step, last=step == steps)
                if step == steps:
                    reached[state["row"]] = at_goal
                elif ends.any():
                    rows = state["row"][ends]
                    lengths[rows], reached[rows] = step + 1, True
                    self._state = kept(self._state, ~ends)
                    self._arbitrations.keep(~ends)
                    if not len(self._state["row"]):
                        break
        return log, lengths, reached

    def _step(self, step: int, *, last: bool) -> Floats:
        """The row (columns, n) of the log; replaces the state by that of the next step."""
        state, robot = self._state, self._robot
        pose, wheels, contact = state["pose"], state["wheels"], state["contact"]
        sent = human = state["operator"]["command"]
        if self._channels is not None:
            human = self._channels.receive(state["channel"], step, sent)
        estimates, target = self._estimate(step, pose, human)
        autonomous = np.stack(robot.command_toward(pose, target, self._look_ahead, ARRAYS))
        clearance = self._plants.clearance(pose)
        confidence, variance, by_pose, by_command = estimates
        inputs = ArbiterInputs(
            human=human, autonomous=autonomous, confidence=confidence, pose=pose, clearance=clearance
        )
        weight, shared = self._arbitrations.step(inputs)
        weight, shared = apply_driver(state["fixed"], weight, shared, human, autonomous)
        measures = [confidence, weight, variance, clearance, contact, by_pose, by_command]
        row = [pose, sent, autonomous, shared, wheels, np.stack(measures), self._arbitrations.logged()]
        applied = shared
        if self._filters is not None:
            applied = self._filters.apply(pose, wheels, shared, clearance)
            row.append(applied)
        if self._channels is not None:
            row.append(human)
        if not last:
            self._operators.update(state["operator"], step, pose, shared, weight)
            state["pose"], state["wheels"], state["contact"] = self._plants.update(
                pose, wheels, applied, clearance
            )
        return np.concatenate(row)

    def _estimate(self, step: int, pose: Floats, human: Floats) -> tuple[Floats, Floats]:
        """Confidence, mean variance and influences (4, n), and targets (2, n)."""
        state = self._state
        measures, target = np.empty((4, pose.shape[1])), np.empty((2, pose.shape[1]))
        progress, expected = state["progress"], state["expected"]
        for index, estimators in enumerate(self._estimators):
            rows: Any = slice(None)
            if len(self._estimators) > 1:
                rows = np.flatnonzero(state["estimator"] == index)
                if not len(rows):
                    continue
            found = estimators.step(
                progress[rows], expected[:, rows], state["gain"][rows], step, pose[:, rows], human[:, rows]
            )
            measures[:, rows] = found.confidence, found.mean_variance, *found.influence
            target[:, rows] = found.target
            progress[rows], expected[:, rows] = found.reached, found.expected
        return measures, target


def _require(reason: str | None) -> None:
    if reason is not None:
        raise InputError(f"--engine {ENGINE}", "", f"cannot run {reason}; use --engine drake or auto")
