"""Where the person is heading, and how sure that is: a learner conditioned at every step."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from drake_shared.learners import Learner, confidence
from drake_shared.systems.progress_clock import ProgressClock


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Intention:
    """The trajectory that the person is expected to follow.

    Attributes:
        time: Now, by the clock of ``times``, in [s].
        times: Shape (N,), of the grid, in [s]; the same array at every step.
        mean: Shape (N, 2), expected positions, in [m], world frame; NaN at or before ``time``.
        variance: Shape (N, 2), in [m^2]; NaN at or before ``time``.
        first: Index of the first entry that is later than ``time`` (the last one at the end).
    """

    time: float
    times: np.ndarray
    mean: np.ndarray
    variance: np.ndarray
    first: int

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


NOTHING_YET = Intention(
    time=0.0, times=np.zeros(1), mean=np.full((1, 2), math.nan), variance=np.full((1, 2), math.inf), first=0
)


class IntentionEstimator(LeafSystem):
    """Conditions a learner on where the robot is, and says how sure the outcome is.

    .. pydrake_system::

        name: IntentionEstimator
        input_ports:
        - pose
        output_ports:
        - intention
        - confidence
        - mean_variance

    Inputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame.

    Outputs:
        intention: :class:`Intention`. Feeds through.
        confidence (1): c_f of eq. (1) of Amirshirzad et al. 2022, in [0, 1]; NaN where the learner says NaN.
        mean_variance (1): Mean variance of the steps to come, over x and y, in [m^2].

    Parameters (of the Context, so that trials may differ in them):
        learner: See :meth:`set_learner`.
        confidence_gain: K of eq. (1), in [1/m^2].

    State:
        progress (1): The time of the demonstrated point that was reached, in [s]; for learners whose clock
            is "progress". It is updated once a period.

    All outputs come from one prediction, made when the first is asked for and kept until pose, parameters
    or time change.

    Args:
        learner: Any object with the learners' ``predict``; see :class:`drake_shared.learners.Learner`.
        period: Of the control step, in [s].
    """

    def __init__(self, *, learner: Learner, period: float = 0.05) -> None:
        super().__init__()
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._learner_index = self.DeclareAbstractParameter(Value(_Prepared(learner)))
        self._gain_index = self.DeclareNumericParameter(BasicVector([learner.confidence_gain]))
        self._progress_index = self.DeclareDiscreteState(1)
        prerequisites = {
            self.time_ticket(),
            self.xd_ticket(),
            self.all_parameters_ticket(),
            self.input_port_ticket(self._pose_port.get_index()),
        }
        self._estimate = self.DeclareCacheEntry(
            "estimate", ValueProducer(lambda: Value(_Estimate()), self._calc_estimate), prerequisites
        )
        from_estimate = {self._estimate.ticket()}
        self.DeclareAbstractOutputPort(
            "intention", lambda: Value(NOTHING_YET), self._calc_intention, from_estimate
        )
        self.DeclareVectorOutputPort("confidence", 1, self._calc_confidence, from_estimate)
        self.DeclareVectorOutputPort("mean_variance", 1, self._calc_mean_variance, from_estimate)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def set_learner(self, context: Context, learner: Learner, confidence_gain: float | None = None) -> None:
        """Makes ``learner`` the one of this Context, with its own K or the one given, in [1/m^2]."""
        context.get_mutable_abstract_parameter(self._learner_index).set_value(_Prepared(learner))
        gain = learner.confidence_gain if confidence_gain is None else confidence_gain
        context.get_mutable_numeric_parameter(self._gain_index)[0] = gain

    def _calc_estimate(self, context: Any, output: Value) -> None:
        prepared: _Prepared = context.get_abstract_parameter(self._learner_index).get_value()
        gain = context.get_numeric_parameter(self._gain_index)[0]
        x, y, _ = self._pose_port.Eval(context).tolist()
        if prepared.clock is None:
            now = min(context.get_time(), prepared.duration)
        else:
            reached = context.get_discrete_state(self._progress_index)[0]
            now = prepared.clock.advance(reached, x, y)
        first = prepared.first_after(now)
        mean, variance = prepared.learner.predict(np.array([now]), np.array([[x, y]]), prepared.later[first])
        # All queries are later than now: this is the mean of eq. (1), without looking for where to begin.
        spread = float(variance.sum()) / variance.size
        output.set_value(
            _Estimate(
                intention=Intention(
                    time=now,
                    times=prepared.grid,
                    mean=prepared.padded(mean),
                    variance=prepared.padded(variance),
                    first=first,
                ),
                confidence=confidence(spread, gain),
                mean_variance=spread,
            )
        )

    def _calc_intention(self, context: Context, output: Value) -> None:
        output.set_value(self._estimate.Eval(context).intention)

    def _calc_confidence(self, context: Context, output: BasicVector) -> None:
        output[0] = self._estimate.Eval(context).confidence

    def _calc_mean_variance(self, context: Context, output: BasicVector) -> None:
        output[0] = self._estimate.Eval(context).mean_variance

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._progress_index, [self._estimate.Eval(context).intention.time])


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class _Estimate:
    intention: Intention = NOTHING_YET
    confidence: float = 0.0
    mean_variance: float = math.inf


class _Prepared:
    """A learner, with what depends on it alone."""

    def __init__(self, learner: Learner) -> None:
        self.learner = learner
        self.grid = np.asarray(learner.grid)
        self.duration = float(self.grid[-1])
        # Queries still to come, from each index on: views made once, so that a step makes none.
        self.later = [self.grid[first:] for first in range(len(self.grid))]
        self.clock = None
        if learner.metadata.get("clock") == "progress" and learner.demonstrations is not None:
            self.clock = ProgressClock(self.grid, learner.demonstrations)

    def first_after(self, now: float) -> int:
        """Index of the first query later than ``now``; the last one if there is none."""
        return min(int(self.grid.searchsorted(now + 1e-9, side="right")), len(self.grid) - 1)

    def padded(self, later: np.ndarray) -> np.ndarray:
        """The last rows of a whole grid, NaN before them."""
        whole = np.full((len(self.grid), 2), math.nan)
        whole[len(self.grid) - len(later) :] = later
        return whole

    def __deepcopy__(self, memo: dict) -> _Prepared:
        # Contexts are cloned with their parameters; a learner is never changed, so one serves all.
        return self
