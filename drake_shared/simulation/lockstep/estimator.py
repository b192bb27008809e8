"""The intention estimators and waypoint controllers of many trials with one learner."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.path_repair import PathRepair
from drake_shared.common.elementwise import ARRAYS
from drake_shared.demonstrations import ProgressClock
from drake_shared.learners import Learner, confidence
from drake_shared.learners.rows import make_rows
from drake_shared.robots import DiffDrive, scaled_length
from drake_shared.systems.intention_estimator import LEAST_DISTANCE, REACH
from drake_shared.systems.prepared_learner import MOMENTS, PreparedLearner

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Rows of a block whose predictions stay in the cache.
_ROWS = 128


@dataclasses.dataclass(frozen=True, kw_only=True)
class Estimates:
    """What the estimators give in one step, for n trials.

    Attributes:
        reached: Shape (n,), index of the time in the grid that a clock of progress has reached.
        confidence, mean_variance: Shapes (n,); see `IntentionEstimator`.
        influence: Shape (2, n), in [m].
        expected: Shape (2 MOMENTS, n), in [m]; NaN for moments that are past.
        target: Shape (2, n), position to which the controller steers, in [m].
    """

    reached: Integers
    confidence: Floats
    mean_variance: Floats
    influence: Floats
    expected: Floats
    target: Floats


class Estimators:
    """Does for many trials what `IntentionEstimator` and the lookup of `WaypointController` do for one.

    Args:
        learner: Of all these trials; `predicts_rows` must be true. None: the human drives alone.
        robot: Of the scenario.
        period: Of the control step, in [s].
        steps: Number of control steps.
        use_human_command: See `IntentionEstimator.SetLearner`.
        look_ahead: Of the controller, in [s].
        repair: Keeps predicted paths clear of known obstacles.
    """

    def __init__(
        self,
        learner: Learner | None,
        robot: DiffDrive,
        *,
        period: float,
        steps: int,
        use_human_command: bool,
        look_ahead: float,
        repair: PathRepair | None = None,
    ) -> None:
        self.default_gain = 1.0 if learner is None else learner.confidence_gain
        self._robot = robot
        self._learner = learner
        if learner is None:
            return
        prepared = PreparedLearner(learner, robot, use_human_command=use_human_command)
        self._least_distance = scaled_length(robot, LEAST_DISTANCE)
        self._count = len(prepared.grid)
        self._uses_command, self._calibrated = prepared.uses_command, prepared.calibrated
        self._clock = None if prepared.clock is None else _Clock(prepared.clock, prepared.grid)
        if self._clock is None:
            # Observations have the time of the step, and those of commands the same time later.
            now = np.minimum(np.arange(steps + 1) * period, prepared.duration)
            times = np.concatenate([now, now + REACH])
            self._later = steps + 1
        else:
            times = prepared.grid
        self._period, self._repair = period, repair
        self._grid, self._times = prepared.grid, times
        self._first = np.array([prepared.first_after(time) for time in times.tolist()])
        self._predictor = make_rows(learner, times)
        self._moments = prepared.moments[::2] // 2
        self._aims = _Aims(prepared.grid, times, self._first, look_ahead)

    def step(
        self, reached: Integers, before: Floats, gain: Floats, step: int, pose: Floats, human: Floats
    ) -> Estimates:
        """Estimates at one step.

        Args:
            reached: Shape (n,), `Estimates.reached` of the step before.
            before: `Estimates.expected` of the step before.
            gain: Shape (n,), K, in [1/m^2].
            step: Index of the control step.
            pose: Shape (3, n).
            human: Shape (2, n), in [rad/s].
        """
        rows = pose.shape[1]
        if self._learner is None:
            nothing = np.full((2, rows), math.nan)
            return Estimates(
                reached=reached,
                confidence=np.zeros(rows),
                mean_variance=np.full(rows, math.inf),
                influence=np.zeros((2, rows)),
                expected=np.full((2 * MOMENTS, rows), math.nan),
                target=nothing,
            )
        x, y, _ = pose
        index = np.full(rows, step) if self._clock is None else self._clock.advance(reached, x, y)
        positions = np.stack([x, y], axis=-1)[:, None]
        pointed = np.zeros(rows, bool)
        observed = index[:, None]
        if self._uses_command:
            pointed = np.isfinite(human.sum(axis=0))
            pointed &= self._robot.speed(human) * REACH >= self._least_distance
            ahead = self._robot.rollout(pose, human, REACH, ARRAYS)
            ahead_x, ahead_y = np.where(pointed, ahead, pose[:2])
            later = (
                index + self._later if self._clock is None else self._clock.advance(index, ahead_x, ahead_y)
            )
            observed = np.stack([index, later], axis=-1)
            positions = np.stack([positions[:, 0], np.stack([ahead_x, ahead_y], axis=-1)], axis=1)
        spread, moved, sure = np.empty(rows), np.zeros(rows), np.empty(rows)
        expected, target = np.full((2, MOMENTS, rows), math.nan), np.empty((2, rows))
        order = np.argsort(self._first[index], kind="stable")
        for begin in range(0, rows, _ROWS):
            part = order[begin : begin + _ROWS]
            block = self._block(
                observed[part],
                positions[part],
                pointed[part],
                pose[:, part].T,
                step * self._period,
                gain[part],
            )
            spread[part], moved[part], sure[part], target[:, part], later_expected = block
            expected[:, MOMENTS - later_expected.shape[1] :, part] = later_expected
        flat = expected.transpose(1, 0, 2).reshape(2 * MOMENTS, rows)
        offsets = flat - before
        known = np.isfinite(offsets)
        # Accumulated, since the order of a sum over an axis depends on the number of rows.
        square = 2.0 * np.cumsum(np.square(np.where(known, offsets, 0.0)), axis=0)[-1]
        by_pose = np.sqrt(square / np.maximum(known.sum(axis=0), 1))
        return Estimates(
            reached=index,
            confidence=sure,
            mean_variance=spread,
            influence=np.stack([by_pose, moved]),
            expected=flat,
            target=target,
        )

    def _block(
        self,
        observed: Integers,
        positions: Floats,
        pointed: NDArray[np.bool_],
        poses: Floats,
        time: float,
        gain: Floats,
    ) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Mean variance, distance moved by the command, confidence, target and expected positions of rows."""
        now = observed[:, 0]
        first = self._first[now]
        start = int(first[0])
        mean, variance, aimed = self._predictor.predict(observed, positions, first)
        to_come = (np.arange(start, self._count) >= first[:, None])[:, None]
        size = 2.0 * (self._count - first)

        def mean_to_come(values: Floats) -> Floats:
            # The order of the sum, and so its last bits, must not depend on the other rows of the block.
            whole = np.zeros((len(values), 2, self._count))
            np.multiply(values, to_come, out=whole[:, :, start:])
            mean: Floats = whole.reshape(len(values), -1).sum(axis=1) / size
            return mean

        total, chosen, moved = variance[:, 0], aimed[:, 0], np.zeros(len(now))
        if observed.shape[1] > 1:
            apart = np.square(mean[:, 1] - mean[:, 0])
            moved = np.where(pointed, np.sqrt(2.0 * mean_to_come(apart)), 0.0)
            both = np.maximum(np.maximum(total, variance[:, 1]), apart)
            total = np.where(pointed[:, None, None], both, total)
            chosen = np.where(pointed[:, None, None], aimed[:, 1], chosen)
        if self._repair is not None:
            chosen, moved_aside = self._repaired(self._repair, chosen, poses, now, time)
            total = total + np.square(moved_aside)[:, None]
        moments = self._moments[self._moments >= start]
        expected = mean[:, 0][:, :, moments - start].transpose(1, 2, 0)
        expected = np.where(moments[:, None] >= first, expected, math.nan)
        spread = mean_to_come(total)
        if self._calibrated is None:
            sure: Floats = confidence(spread, gain, ARRAYS)
        else:
            sure = self._calibrated(gain * spread, chosen.transpose(0, 2, 1), start, first)
        return spread, moved, sure, self._aims.target(chosen, now, start), expected

    def _repaired(
        self, repair: PathRepair, chosen: Floats, poses: Floats, now: Integers, time: float
    ) -> tuple[Floats, Floats]:
        """Means (n, 2, Q) and how far they were moved (n, Q), from `_first` of each row on."""
        count = chosen.shape[2]
        skipped = self._first[now] - (self._count - count)
        # Each row from its first query on; the last point is repeated beyond the end.
        index = np.minimum(skipped[:, None] + np.arange(count), count - 1)
        paths = np.take_along_axis(chosen, index[:, None], axis=2).transpose(0, 2, 1)
        times = time + self._grid[self._count - count + index] - self._times[now][:, None]
        found, moved = repair(poses, paths, times, np.full(len(now), time))
        back = np.maximum(np.arange(count) - skipped[:, None], 0)
        return (
            np.take_along_axis(found.transpose(0, 2, 1), back[:, None], axis=2),
            np.take_along_axis(moved, back, axis=1),
        )


class _Clock:
    """`ProgressClock` for arrays; a time is its index in the grid."""

    def __init__(self, clock: ProgressClock, grid: Floats) -> None:
        windows = [clock.window(time) for time in grid.tolist()]
        self._begin, self._end = (np.array(part) for part in zip(*windows, strict=True))
        self._width = int((self._end - self._begin).max())
        self._tolerance = clock.tolerance
        # Of each index its window of the demonstrations, the last point repeated: (G, m, W).
        index = np.minimum(self._begin[:, None] + np.arange(self._width), self._end[:, None] - 1)
        points = clock.points[index].transpose(0, 2, 1)
        self._x, self._y = points.real.copy(), points.imag.copy()

    def advance(self, reached: Integers, x: Floats, y: Floats) -> Integers:
        """See `ProgressClock.advance`."""
        square = np.square(self._x[reached] - x[:, None, None]) + np.square(
            self._y[reached] - y[:, None, None]
        )
        distance = np.sqrt(square.min(axis=1))
        near = distance <= distance.min(axis=1, keepdims=True) + self._tolerance
        latest = self._width - 1 - near[:, ::-1].argmax(axis=1)
        now: Integers = np.maximum(reached, np.minimum(self._begin[reached] + latest, self._end[reached] - 1))
        return now


class _Aims:
    """`Intention.position_at` a look-ahead from now, for arrays."""

    def __init__(self, grid: Floats, times: Floats, first: Integers, look_ahead: float) -> None:
        aim = times + look_ahead
        after = np.minimum(np.maximum(np.searchsorted(grid, aim), first), len(grid) - 1)
        between = (after != first) & (grid[after] > aim)
        self._after, self._before = after, np.where(between, after - 1, after)
        period = np.where(between, grid[after] - grid[self._before], 1.0)
        self._share = np.where(between, (grid[after] - aim) / period, 0.0)

    def target(self, mean: Floats, now: Integers, start: int) -> Floats:
        """Positions (2, n) on the means (n, 2, Q), which begin at ``start`` in the grid."""
        rows = np.arange(len(now))
        end = mean[rows, :, self._after[now] - start]
        before = mean[rows, :, self._before[now] - start]
        target: Floats = (end + self._share[now][:, None] * (before - end)).T
        return target
