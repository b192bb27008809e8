"""Where the person is heading, and how sure that is: a learner conditioned at every step."""

from __future__ import annotations

import dataclasses
import math
from bisect import bisect_right
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from drake_shared.demonstrations import ProgressClock
from drake_shared.learners import Learner, confidence
from drake_shared.learners.modes import Modes
from drake_shared.robots import DiffDrive


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Intention:
    """The trajectory that the person is expected to follow.

    Attributes:
        time: Now, by the clock of ``times``, in [s].
        times: Shape (N,), of the grid, in [s]; the same array at every step.
        mean: Shape (N, 2), expected positions, in [m], world frame; NaN at or before ``time``. Of the way
            that the driver is on, if the learner tells several apart.
        variance: Shape (N, 2), in [m^2], within and between ways; NaN at or before ``time``.
        first: Index of the first entry that is later than ``time`` (the last one at the end).
        modes: The ways that are possible, from entry ``first`` on, if the learner tells several apart.
    """

    time: float
    times: np.ndarray
    mean: np.ndarray
    variance: np.ndarray
    first: int
    modes: Modes | None = None

    def position(self, time: float) -> tuple[float, float]:
        """Expected position at ``time`` later than now, in [m]; interpolated, held at both ends."""
        times = self.times
        after = min(max(int(times.searchsorted(time)), self.first), len(times) - 1)
        x, y = self.mean[after].tolist()
        if after == self.first or times[after] <= time:
            return x, y
        share = (times[after] - time) / (times[after] - times[after - 1])
        before_x, before_y = self.mean[after - 1].tolist()
        return x + share * (before_x - x), y + share * (before_y - y)


# At so many moments of the task, evenly spread, it is noted where the robot is expected.
_MOMENTS = 8
# A command that leads less far than this, in [m], points nowhere.
_POINTING = 0.05

EMPTY_INTENTION = Intention(
    time=0.0, times=np.zeros(1), mean=np.full((1, 2), math.nan), variance=np.full((1, 2), math.inf), first=0
)


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class _Estimate(Intention):
    """An intention with what the other outputs and the state are made of.

    A value of its own in the cache would cost one more call from C++ to Python and back in every step.
    """

    confidence: float
    mean_variance: float
    expected: np.ndarray
    by_command: float


def _lost(now: float, grid: np.ndarray, first: int) -> _Estimate:
    """What is expected of a robot of which it is not known where it is."""
    return _Estimate(
        time=now,
        times=grid,
        mean=np.full((len(grid), 2), math.nan),
        variance=np.full((len(grid), 2), math.inf),
        first=first,
        confidence=0.0,
        mean_variance=math.inf,
        expected=np.full(2 * _MOMENTS, math.nan),
        by_command=0.0,
    )


class IntentionEstimator(LeafSystem):
    """Conditions a learner on where the robot is, and says how sure the outcome is.

    .. pydrake_system::

        name: IntentionEstimator
        input_ports:
        - pose
        - human_command
        output_ports:
        - intention
        - confidence
        - mean_variance
        - influence

    Inputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame. Where it is no number nothing is expected, and c_f
            is 0.
        human_command (2): Wheel speeds [left, right] in [rad/s]; may be left open. Evidence for learners
            whose evidence is "pose+command", and not looked at for others.

    Outputs:
        intention: :class:`Intention`. Feeds through.
        confidence (1): c_f of eq. (1) of Amirshirzad et al. 2022, in [0, 1]; NaN where the learner says NaN.
        mean_variance (1): Mean variance of the steps to come, over x and y, in [m^2].
        influence (2): How far the pose and how far the human's command moved the expected path in this step:
            root mean square over what is to come, in [m].

    Parameters (of the Context, so that trials may differ in them):
        learner: See :meth:`set_learner`.
        confidence_gain: K of eq. (1), in [1/m^2].

    State:
        progress (1): The time of the demonstrated point that was reached, in [s]; for learners whose clock
            is "progress". It is updated once a period.
        expected (16): Where the pose alone made the robot expected at 8 moments of the task, in [m].

    All outputs come from one estimate, made when the first is asked for and kept until an input, a parameter
    or time changes.

    Once the agent holds the control, the human's command cannot change the pose, and from the pose alone the
    estimate would never learn of it (compare Aronson and Short, arXiv 2408.12103). So where the command
    points is a second observation: the place to which it leads in ``reach`` s, at the time of the nearest
    demonstrated point. It moves the mean; the variance is the largest of those with and without it and of the
    squared distance between both means. To point along one of several ways that are still open thus makes
    the agent go along, but does not take control from the human; to point elsewhere gives it back.

    Args:
        learner: Any object with the learners' ``predict``; see :class:`drake_shared.learners.Learner`. Its
            ``predict_modes`` or ``predict_prefixes`` is asked instead if it has one.
        robot: For where a command leads.
        period: Of the control step, in [s].
        reach: How far ahead a command points, in [s].
    """

    def __init__(
        self, *, learner: Learner, robot: DiffDrive | None = None, period: float = 0.05, reach: float = 0.8
    ) -> None:
        super().__init__()
        self._robot = robot or DiffDrive()
        self._reach = reach
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._human_port = self.DeclareVectorInputPort("human_command", 2)
        self._learner_index = self.DeclareAbstractParameter(Value(_Prepared(learner)))
        self._gain_index = self.DeclareNumericParameter(BasicVector([learner.confidence_gain]))
        self._progress_index = self.DeclareDiscreteState(1)
        self._expected_index = self.DeclareDiscreteState(np.full(2 * _MOMENTS, math.nan))
        prerequisites = {
            self.time_ticket(),
            self.xd_ticket(),
            self.all_parameters_ticket(),
            self.input_port_ticket(self._pose_port.get_index()),
            self.input_port_ticket(self._human_port.get_index()),
        }
        self._intention_port = self.DeclareAbstractOutputPort(
            "intention", lambda: Value(EMPTY_INTENTION), self._calc_estimate, prerequisites
        )
        self.DeclareVectorOutputPort("confidence", 1, self._calc_confidence, prerequisites)
        self.DeclareVectorOutputPort("mean_variance", 1, self._calc_mean_variance, prerequisites)
        self.DeclareVectorOutputPort("influence", 2, self._calc_influence, prerequisites)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def set_learner(
        self,
        context: Context,
        learner: Learner,
        *,
        confidence_gain: float | None = None,
        use_human_command: bool = True,
    ) -> None:
        """Makes ``learner`` the one of this Context.

        Args:
            context: Of this system.
            learner: Any object with the learners' ``predict``.
            confidence_gain: K of eq. (1), in [1/m^2]; the learner's own if None.
            use_human_command: Whether the human's command may be evidence, for learners that take it.
        """
        prepared = _Prepared(learner, use_human_command=use_human_command)
        context.get_mutable_abstract_parameter(self._learner_index).set_value(prepared)
        gain = learner.confidence_gain if confidence_gain is None else confidence_gain
        context.get_mutable_numeric_parameter(self._gain_index)[0] = gain

    def _calc_estimate(self, context: Any, output: Value) -> None:
        prepared: _Prepared = context.get_abstract_parameter(self._learner_index).get_value()
        gain = context.get_numeric_parameter(self._gain_index)[0]
        x, y, yaw = self._pose_port.Eval(context).tolist()
        if prepared.clock is None:
            now = min(context.get_time(), prepared.duration)
        else:
            reached = context.get_discrete_state(self._progress_index)[0]
            now = prepared.clock.advance(reached, x, y)
        first = prepared.first_after(now)
        later = prepared.later[first]
        if not math.isfinite(x + y + yaw):
            # To go on from the last pose would be to guess, with the robot on its way: the human drives.
            output.set_value(_lost(now, prepared.grid, first))
            return
        times, positions = [now], [(x, y)]
        pointed = self._pointed(context, x, y, yaw) if prepared.uses_command else None
        if pointed is not None:
            times.append(
                now + self._reach if prepared.clock is None else prepared.clock.advance(now, *pointed)
            )
            positions.append(pointed)
        answers, modes = prepared.predict(times, positions, later)
        mean, variance = answers[0]
        whole_mean = prepared.padded(mean)
        expected = whole_mean.take(prepared.moments)
        by_command = 0.0
        if pointed is not None:
            told, told_variance = answers[1]
            moved = (told - mean) ** 2
            whole_mean = prepared.padded(told)
            variance = np.maximum(np.maximum(variance, told_variance), moved)
            by_command = math.sqrt(2.0 * float(moved.sum()) / moved.size)
        # All queries are later than now: this is the mean of eq. (1), without looking for where to begin.
        spread = float(variance.sum()) / variance.size
        if modes is not None:
            # The agent helps on the way that the driver is on, not on the mean between two.
            whole_mean = prepared.padded(modes.mean[modes.aim])
        output.set_value(
            _Estimate(
                time=now,
                times=prepared.grid,
                mean=whole_mean,
                variance=prepared.padded(variance),
                first=first,
                modes=modes,
                confidence=confidence(spread, gain),
                mean_variance=spread,
                expected=expected,
                by_command=by_command,
            )
        )

    def _pointed(self, context: Context, x: float, y: float, yaw: float) -> tuple[float, float] | None:
        """Where the human's command leads in ``reach`` s, in [m]; None if there is none."""
        if not self._human_port.HasValue(context):
            return None
        speed, yaw_rate = self._robot.twist(*self._human_port.Eval(context).tolist())
        if not math.isfinite(speed + yaw_rate) or abs(speed) * self._reach < _POINTING:
            return None
        half = 0.5 * yaw_rate * self._reach
        chord = speed * self._reach * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
        return x + chord * math.cos(yaw + half), y + chord * math.sin(yaw + half)

    def _calc_confidence(self, context: Context, output: BasicVector) -> None:
        output[0] = self._intention_port.Eval(context).confidence

    def _calc_mean_variance(self, context: Context, output: BasicVector) -> None:
        output[0] = self._intention_port.Eval(context).mean_variance

    def _calc_influence(self, context: Context, output: BasicVector) -> None:
        estimate = self._intention_port.Eval(context)
        before = context.get_discrete_state(self._expected_index).value()
        moved = (estimate.expected - before).tolist()
        known = [offset * offset for offset in moved if math.isfinite(offset)]
        output[0] = math.sqrt(2.0 * sum(known) / len(known)) if known else 0.0
        output[1] = estimate.by_command

    def _update(self, context: Context, state: DiscreteValues) -> None:
        estimate = self._intention_port.Eval(context)
        state.set_value(self._progress_index, [estimate.time])
        state.set_value(self._expected_index, estimate.expected)


class _Prepared:
    """A learner, with what depends on it alone."""

    def __init__(self, learner: Learner, *, use_human_command: bool = True) -> None:
        self.learner = learner
        self.grid = np.asarray(learner.grid)
        self.duration = float(self.grid[-1])
        self._times = self.grid.tolist()
        # Queries still to come, from each index on: views made once, so that a step makes none.
        self.later = [self.grid[first:] for first in range(len(self.grid))]
        self.clock = None
        if learner.metadata.get("clock") == "progress" and learner.demonstrations is not None:
            self.clock = ProgressClock(self.grid, learner.demonstrations)

        self._predict_modes = getattr(learner, "predict_modes", None)
        self._predict_prefixes = getattr(learner, "predict_prefixes", None)
        self.uses_command = use_human_command and learner.metadata.get("evidence") == "pose+command"
        moments = np.linspace(0, len(self.grid) - 1, _MOMENTS + 1).round().astype(int)[1:]
        # Where x and y of the moments are in the numbers of a whole grid.
        self.moments = (2 * moments[:, None] + [0, 1]).ravel()
        self._unknown = np.full((len(self.grid), 2), math.nan)

    def predict(
        self, times: list[float], positions: list[tuple[float, float]], later: np.ndarray
    ) -> tuple[list[tuple[np.ndarray, np.ndarray]], Modes | None]:
        """Mean and variance after the first observation, the first two, and so on.

        And the modes after all of them, if the learner tells them.
        """
        seen_times, seen = np.array(times), np.array(positions)
        if self._predict_modes is not None:
            told = [self._predict_modes(seen_times[:n], seen[:n], later) for n in range(1, len(times) + 1)]
            return [(mean, variance) for mean, variance, _ in told], told[-1][2]
        if self._predict_prefixes is not None:
            return self._predict_prefixes(seen_times, seen, later), None
        predict = self.learner.predict
        return [predict(seen_times[:n], seen[:n], later) for n in range(1, len(times) + 1)], None

    def first_after(self, now: float) -> int:
        """Index of the first query later than ``now``; the last one if there is none."""
        return min(bisect_right(self._times, now + 1e-9), len(self._times) - 1)

    def padded(self, later: np.ndarray) -> np.ndarray:
        """The last rows of a whole grid, NaN before them."""
        whole = self._unknown.copy()
        whole[len(whole) - len(later) :] = later
        return whole

    def __deepcopy__(self, memo: dict) -> _Prepared:
        # Contexts are cloned with their parameters; a learner is never changed, so one serves all.
        return self
